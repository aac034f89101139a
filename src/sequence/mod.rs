//! A film to map: depth images in time order, each with its colour image and true pose if there are any.
//! Frames are read one at a time, on demand.
//!
//! Two layouts: that of the TUM RGB-D benchmark (depth.txt, rgb.txt, associations, groundtruth.txt)
//! and that of 7-Scenes (frame-XXXXXX.color/.depth/.pose).

mod scenes;
mod tum;

use std::path::{Path, PathBuf};

use crate::error::Result;
use crate::frame::Frame;
use crate::io::{Assumed, ColourImage, read_depth};
use crate::stats::median;
use crate::trajectory::Pose;
use crate::units::{counted, verb};
use crate::view::{FrameRef, Sensor};

/// Opens a folder in one of the two layouts, or a film in a file.
/// Fails if it is neither, a list in it cannot be read, or it holds no depth image.
pub fn open(root: &Path, assumed: &Assumed) -> Result<Sequence> {
    let mut sequence =
        if scenes::is_one(root) { scenes::open(root, assumed)? } else { tum::open(root, assumed)? };
    let before = sequence.moments.len();
    sequence.moments.dedup_by(|b, a| a.stamp == b.stamp);
    sequence.truth.dedup_by(|b, a| a.stamp == b.stamp);
    let dropped = before - sequence.moments.len();
    if dropped > 0 {
        sequence.remarks.push(format!(
            "{} {} the stamp of the one before; only the first is mapped",
            counted(dropped, "depth image"),
            verb(dropped, "has", "have")
        ));
    }
    let colourless = sequence.moments.iter().filter(|m| m.colour.is_none()).count();
    if colourless > 0 {
        sequence.remarks.push(format!(
            "{colourless} of {} depth images {} no colour image of the same moment",
            sequence.moments.len(),
            verb(colourless, "has", "have")
        ));
    }
    sequence.remarks.extend(gaps(&sequence.moments));
    Ok(sequence)
}

#[derive(Debug, Clone, PartialEq)]
pub struct Moment {
    /// Timestamp of the depth image, s.
    pub stamp: f64,
    pub depth: FrameRef,
    /// The colour image of the same moment, with its own timestamp.
    pub colour: Option<FrameRef>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Sequence {
    pub root: PathBuf,
    pub sensor: Sensor,
    /// Mean over the film, degrees Celsius, where a bag tells it.
    pub temperature_c: Option<f64>,
    /// In time order; no two have the same stamp.
    pub moments: Vec<Moment>,
    /// True poses, in time order; empty where there are none.
    pub truth: Vec<Pose>,
    /// Why existing ground truth is not used.
    pub unused_truth: Option<String>,
    pub remarks: Vec<String>,
}

impl Sequence {
    /// Name of the folder, also where it was given as `.` or `..`.
    pub fn name(&self) -> String {
        let whole = self.root.canonicalize().unwrap_or_else(|_| self.root.clone());
        whole.file_name().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// Keeps every `stride`-th moment, at most `limit` of them.
    pub fn thin(&mut self, stride: usize, limit: Option<usize>) {
        let moments = std::mem::take(&mut self.moments);
        let kept = moments.into_iter().step_by(stride.max(1)).take(limit.unwrap_or(usize::MAX));
        self.moments = kept.collect();
    }

    /// Reads a depth image as stored.
    /// Fails if the file is damaged or not of the sensor's size.
    pub fn depth(&self, moment: &Moment) -> Result<Frame> {
        read_depth(&moment.depth, self.sensor.camera.width, self.sensor.camera.height)
    }

    /// Reads the colour image of a moment, if there is one.
    /// Fails if the file is damaged or not of the depth image's size.
    pub fn colour(&self, moment: &Moment) -> Result<Option<ColourImage>> {
        let Some(path) = moment.colour.as_ref().map(|c| &c.path) else { return Ok(None) };
        let camera = &self.sensor.camera;
        ColourImage::read(path, [camera.width, camera.height]).map(Some)
    }
}

/// An interval longer than this many usual ones is a gap: frames are missing.
const GAP: f64 = 3.5;

fn gaps(moments: &[Moment]) -> Option<String> {
    let intervals: Vec<f64> = moments.windows(2).map(|w| w[1].stamp - w[0].stamp).collect();
    let usual = median(&mut intervals.clone());
    let found: Vec<usize> = (0..intervals.len()).filter(|&i| intervals[i] > GAP * usual).collect();
    let longest = found.iter().copied().max_by(|&a, &b| intervals[a].total_cmp(&intervals[b]))?;
    Some(format!(
        "{} in the depth stamps, the longest {:.2} s after {:.6} (usual interval {:.1} ms)",
        counted(found.len(), "gap"),
        intervals[longest],
        moments[longest].stamp,
        1e3 * usual
    ))
}

#[cfg(test)]
mod tests;
