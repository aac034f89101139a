//! Where frames come from while views are taken.

use std::time::Duration;

use crate::frame::Frame;
use crate::view::Sensor;

/// One moment of a sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct LiveFrame {
    /// Seconds; one clock for as long as the source runs.
    pub stamp: f64,
    /// In the sensor's raw values.
    pub depth: Frame,
    /// Infrared amplitude of the same size, where the source has it.
    pub infrared: Option<Frame>,
}

/// What a source had to give.
#[derive(Debug, Clone, PartialEq)]
pub enum Arrival {
    Frame(LiveFrame),
    /// Nothing in the time allowed; more may come.
    Nothing,
    /// Nothing will come any more.
    End(End),
}

/// Why a source came to its end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct End {
    pub why: String,
    /// It went away while it was needed; a recording that was played to its end did not.
    pub lost: bool,
}

/// A sensor, or something that behaves like one.
pub trait Source {
    /// The unit, as `recording.json` will describe it.
    fn sensor(&self) -> &Sensor;

    /// The next frame, waiting for it about `wait` at most.
    fn next(&mut self, wait: Duration) -> Arrival;

    /// Does time go by while nobody asks for frames?
    fn live(&self) -> bool {
        false
    }

    /// Frames that came while there was no room for them.
    fn dropped(&self) -> usize {
        0
    }

    /// Oddities met so far, each a sentence.
    fn remarks(&self) -> &[String];
}
