//! Plays a recording back as if from a live sensor.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::source::{Arrival, End, LiveFrame, Source};
use crate::error::Result;
use crate::frame::Frame;
use crate::io::{Assumed, FrameSource, open_uncut, read_infrared};
use crate::view::{FrameRef, Sensor};

/// Longer pauses between frames (a board being moved) are cut to this, s.
const MAX_PAUSE_S: f64 = 0.5;

/// Frames of a recording in time order.
pub struct Playback {
    sensor: Sensor,
    frames: std::vec::IntoIter<(FrameRef, Option<FrameRef>)>,
    images: FrameSource,
    /// Whether to play at the recording's own pace, not as fast as frames can be read.
    paced: bool,
    previous: Option<(f64, Instant)>,
    root: PathBuf,
    remarks: Vec<String>,
}

impl Playback {
    /// Opens any layout that kinoise reads.
    /// Fails as [`crate::io::open`] does.
    pub fn open(root: &Path, assumed: &Assumed, paced: bool) -> Result<Self> {
        let recording = open_uncut(root, assumed)?;
        let mut frames: Vec<(FrameRef, Option<FrameRef>)> = Vec::new();
        for view in recording.views {
            let infrared = |stamp: f64| {
                let found = view.infrared.binary_search_by(|i| i.timestamp.total_cmp(&stamp));
                Some(view.infrared[found.ok()?].clone())
            };
            frames.extend(view.depth.into_iter().map(|d| (d.clone(), infrared(d.timestamp))));
        }
        frames.sort_by(|a, b| a.0.timestamp.total_cmp(&b.0.timestamp));
        let mut remarks = recording.remarks;
        remarks.extend(recording.excluded.iter().map(ToString::to_string));
        let camera = &recording.sensor.camera;
        Ok(Playback {
            images: FrameSource::new(camera.width, camera.height),
            sensor: recording.sensor,
            frames: frames.into_iter(),
            paced,
            previous: None,
            root: root.into(),
            remarks,
        })
    }

    /// Infrared image of the depth frame's size; `None`, with a remark, if it cannot be read.
    fn amplitude(&mut self, path: &Path, depth: &Frame) -> Option<Frame> {
        match read_infrared(path, [depth.width, depth.height]) {
            Ok(image) => Some(image),
            Err(why) => {
                self.remarks.push(format!("infrared left out: {why}"));
                None
            }
        }
    }

    fn keep_pace(&mut self, stamp: f64) {
        if let (true, Some((before, then))) = (self.paced, self.previous) {
            let due = Duration::from_secs_f64((stamp - before).clamp(0.0, MAX_PAUSE_S));
            std::thread::sleep(due.saturating_sub(then.elapsed()));
        }
        self.previous = Some((stamp, Instant::now()));
    }
}

impl Source for Playback {
    fn sensor(&self) -> &Sensor {
        &self.sensor
    }

    fn next(&mut self, _wait: Duration) -> Arrival {
        while let Some((depth, infrared)) = self.frames.next() {
            match self.images.frame(&depth) {
                Ok(frame) => {
                    self.keep_pace(depth.timestamp);
                    let infrared = infrared.and_then(|i| self.amplitude(&i.path, &frame));
                    let stamp = depth.timestamp;
                    return Arrival::Frame(LiveFrame { stamp, depth: frame, infrared });
                }
                Err(e) => self.remarks.push(format!("frame left out: {e}")),
            }
        }
        let why = format!("{} was played to its end", self.root.display());
        Arrival::End(End { why, lost: false })
    }

    fn remarks(&self) -> &[String] {
        &self.remarks
    }
}
