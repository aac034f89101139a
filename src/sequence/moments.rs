//! A film whose frames are not yet read, and what its stamps say of the recording.

use std::path::PathBuf;

use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::io::{ColourImage, read_depth};
use crate::stats::median;
use crate::trajectory::Pose;
use crate::view::Sensor;

/// One moment of a film.
#[derive(Debug, Clone, PartialEq)]
pub struct Moment {
    /// Of the depth image, s.
    pub stamp: f64,
    pub depth: PathBuf,
    /// The colour image of the same moment.
    pub colour: Option<PathBuf>,
}

/// A film, its frames not yet read.
#[derive(Debug, Clone, PartialEq)]
pub struct Sequence {
    pub root: PathBuf,
    pub sensor: Sensor,
    /// In time order; no two have the same stamp.
    pub moments: Vec<Moment>,
    /// True poses, in time order; empty where there are none.
    pub truth: Vec<Pose>,
    /// What was odd, in sentences.
    pub remarks: Vec<String>,
}

impl Sequence {
    /// Every `stride`-th moment, at most `limit` of them.
    pub fn thin(&mut self, stride: usize, limit: Option<usize>) {
        let moments = std::mem::take(&mut self.moments);
        let kept = moments.into_iter().step_by(stride.max(1)).take(limit.unwrap_or(usize::MAX));
        self.moments = kept.collect();
    }

    /// A depth image as stored.
    ///
    /// # Errors
    /// When the file is damaged or not of the sensor's size.
    pub fn depth(&self, moment: &Moment) -> Result<Frame> {
        read_depth(&moment.depth, self.sensor.camera.width, self.sensor.camera.height)
    }

    /// The colour of a moment, where there is any.
    ///
    /// # Errors
    /// When the file is damaged or not of the depth image's size: pixels would not correspond.
    pub fn colour(&self, moment: &Moment) -> Result<Option<ColourImage>> {
        let Some(path) = &moment.colour else { return Ok(None) };
        let image = ColourImage::read(path)?;
        let camera = &self.sensor.camera;
        if (image.width, image.height) != (camera.width, camera.height) {
            return Err(Error::image(
                path,
                format!(
                    "the colour image is {} x {} px, depth is {} x {}",
                    image.width, image.height, camera.width, camera.height
                ),
                "colour must be registered to depth, pixel by pixel",
            ));
        }
        Ok(Some(image))
    }
}

/// A frame this many usual intervals after the one before it: frames are missing between them.
const GAP: f64 = 3.5;

/// What the stamps say of frames that are missing.
pub(super) fn gaps(moments: &[Moment]) -> Option<String> {
    let intervals: Vec<f64> = moments.windows(2).map(|w| w[1].stamp - w[0].stamp).collect();
    let usual = median(&mut intervals.clone());
    let found: Vec<usize> = (0..intervals.len()).filter(|&i| intervals[i] > GAP * usual).collect();
    let longest = found.iter().copied().max_by(|&a, &b| intervals[a].total_cmp(&intervals[b]))?;
    Some(format!(
        "{} gaps in the depth stamps, the longest {:.2} s after {:.6} (usual interval {:.1} ms)",
        found.len(),
        intervals[longest],
        moments[longest].stamp,
        1e3 * usual
    ))
}
