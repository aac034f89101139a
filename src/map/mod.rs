//! The mapper: where the camera was and what it saw, from depth images and a noise model.
//!
//! ```text
//! Sequence -preprocess-> points with normals and sigmas -start-> -align-> pose -fuse-> map
//! ```
//! Three methods share the loop ([`icp`]): the paper's ([`Method::Paper`]), neighbours by projection
//! ([`Method::Projective`]), and alignment to the map so far ([`Method::Model`]).

mod blocks;
mod frame_report;
pub mod icp;
mod index_map;
mod map_points;
mod means;
mod nearest;
mod noise;
mod normal_equations;
mod options;
#[cfg_attr(not(feature = "opencv"), path = "no_orb.rs")]
mod orb;
mod point;
mod preprocess;
pub mod ransac;
mod sparse_grid;
mod surfels;
mod tracker;
mod voxel;

pub use frame_report::{Fate, FrameReport, Stages, frames_csv};
pub use icp::{Alignment, Termination};
pub use map_points::{MapPoint, ply};
pub use nearest::Nearest;
pub use normal_equations::Direction;
pub use options::{Init, Kernel, Method, Options, Weights};
pub use point::Point;

use preprocess::Preprocessor;
use tracker::Tracker;

use crate::Progress;
use crate::error::{Error, Result};
use crate::model::NoiseModel;
use crate::sequence::Sequence;
use crate::trajectory::Pose;

/// What came of a sequence.
#[derive(Debug, Clone, PartialEq)]
pub struct Mapped {
    /// One a depth image, in time order.
    pub frames: Vec<FrameReport>,
    pub map: Vec<MapPoint>,
    /// What was odd, in sentences.
    pub remarks: Vec<String>,
}

impl Mapped {
    /// The poses of all frames that have one; the first is the identity.
    pub fn trajectory(&self) -> Vec<Pose> {
        let pose = |f: &FrameReport| Some(Pose { stamp: f.stamp, world_from_camera: f.pose? });
        self.frames.iter().filter_map(pose).collect()
    }

    /// Frames without a pose.
    pub fn lost(&self) -> usize {
        self.frames.iter().filter(|f| f.pose.is_none()).count()
    }
}

/// Map a sequence.
///
/// # Errors
/// When the model is of another sensor, OpenCV fails, or not even two frames have a pose.
pub fn map(
    sequence: &Sequence,
    model: &NoiseModel,
    options: &Options,
    progress: Progress<'_>,
) -> Result<Mapped> {
    let preprocessor = Preprocessor::new(sequence, model, options)?;
    let mut tracker = Tracker::new(&preprocessor);
    let moments = &sequence.moments;
    let mut frames: Vec<FrameReport> = Vec::with_capacity(moments.len());
    let prepare = |k: usize| moments.get(k).map(|m| preprocessor.prepare(m));
    let mut next = prepare(0);
    for (k, moment) in moments.iter().enumerate() {
        let Some(frame) = next.take() else { break };
        // The next frame is read while this one is aligned.
        let (report, prepared) =
            rayon::join(|| tracker.track(moment.stamp, frame), || prepare(k + 1));
        frames.push(report?);
        next = prepared;
        progress(k + 1, moments.len());
    }
    let mut remarks = preprocessor.remarks().to_vec();
    remarks.extend(frames.iter().filter_map(|f| f.remark.clone()));
    remarks.extend(frame_report::remarks(&frames));
    let mapped = Mapped { frames, map: tracker.into_map(), remarks };
    if mapped.trajectory().len() < 2 {
        return Err(no_map(sequence, &mapped));
    }
    Ok(mapped)
}

fn no_map(sequence: &Sequence, mapped: &Mapped) -> Error {
    let why = mapped.frames.iter().find_map(|f| match &f.fate {
        Fate::Lost(why) => Some(format!(" ({why})")),
        _ => None,
    });
    Error::recording(
        &sequence.root,
        format!(
            "of {} depth images none follows another{}",
            mapped.frames.len(),
            why.unwrap_or_default()
        ),
        "a sequence to map needs two overlapping depth images or more",
    )
}

#[cfg(test)]
mod tests;
