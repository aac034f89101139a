//! Sources of frames for a capture.

use std::time::Duration;

use crate::frame::Frame;
use crate::view::Sensor;

/// The images of one moment.
#[derive(Debug, Clone, PartialEq)]
pub struct LiveFrame {
    /// Timestamp, s, on one clock for as long as the source runs.
    pub stamp: f64,
    /// In the sensor's raw values.
    pub depth: Frame,
    /// Infrared amplitude of the same size, if the source has it.
    pub infrared: Option<Frame>,
}

/// Result of waiting for a frame.
#[derive(Debug, Clone, PartialEq)]
pub enum Arrival {
    Frame(LiveFrame),
    /// No frame in the time allowed; more may come.
    Nothing,
    /// No more frames will come.
    End(End),
}

/// Why a source ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct End {
    pub why: String,
    /// Whether it was lost while needed; a recording played to its end was not.
    pub lost: bool,
}

/// A sensor, or something that behaves like one.
pub trait Source {
    /// The sensor, as `recording.json` will describe it.
    fn sensor(&self) -> &Sensor;

    /// Returns the next frame, waiting about `wait` at most.
    fn next(&mut self, wait: Duration) -> Arrival;

    /// Whether time passes while nobody asks for frames.
    fn live(&self) -> bool {
        false
    }

    /// Number of frames lost because there was no room for them.
    fn dropped(&self) -> usize {
        0
    }

    /// Remarks so far, one sentence each.
    fn remarks(&self) -> &[String];
}
