//! The mapper: where the camera was and what it saw, from depth images and a noise model.
//!
//! ```text
//! Sequence -prepare-> points with normals and sigmas -start-> -align-> pose -fuse-> map
//! ```
//! Three methods share the loop ([`icp`]): the paper's ([`Method::Paper`]), neighbours by projection
//! ([`Method::Projective`]), and alignment to the map so far ([`Method::Model`]).

mod blocks;
mod cells;
mod direction;
#[cfg_attr(feature = "opencv", path = "orb.rs")]
#[cfg_attr(not(feature = "opencv"), path = "no_orb.rs")]
mod features;
mod grid_map;
pub mod icp;
mod means;
mod motion;
mod nearest;
mod noise;
mod normals;
mod options;
mod ply;
mod point;
mod prepare;
mod projective;
pub mod rigid;
mod stages;
mod sums;
mod surfels;
mod tell;
mod tracker;
mod voxel;

pub use direction::Direction;
pub use grid_map::MapPoint;
pub use icp::{Alignment, Criteria, Ending, Kernel, Weights};
pub use nearest::Nearest;
pub use options::{Init, Method, Options};
pub use ply::ply;
pub use point::Point;
pub use stages::Stages;
pub use tell::{frames_csv, remarks};
pub use tracker::{Fate, FrameReport};

use prepare::Kitchen;
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
    /// What was odd, in words.
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
    let kitchen = Kitchen::new(sequence, model, options)?;
    let mut tracker = Tracker::new(&kitchen);
    let mut remarks = kitchen.remarks();
    let mut frames: Vec<FrameReport> = Vec::with_capacity(sequence.moments.len());
    let total = sequence.moments.len();
    let mut next = sequence.moments.first().map(|m| kitchen.prepare(m));
    for (k, moment) in sequence.moments.iter().enumerate() {
        let Some(frame) = next.take() else { break };
        // The next frame is read while this one is aligned.
        let take = || match frame {
            Ok(mut frame) => {
                let remark = frame.remark.take();
                tracker.take(moment.stamp, frame).map(|report| (report, remark))
            }
            Err(e @ Error::Argument { .. }) => Err(e),
            Err(e) => Ok((FrameReport::unread(moment.stamp, e.to_string()), None)),
        };
        let following = || sequence.moments.get(k + 1).map(|m| kitchen.prepare(m));
        let (taken, prepared) = rayon::join(take, following);
        let (report, remark) = taken?;
        remarks.extend(remark);
        frames.push(report);
        next = prepared;
        progress(k + 1, total);
    }
    remarks.extend(tell::remarks(&frames));
    let mapped = Mapped { frames, map: tracker.into_map(), remarks };
    if mapped.trajectory().len() < 2 {
        return Err(nothing(sequence, &mapped));
    }
    Ok(mapped)
}

fn nothing(sequence: &Sequence, mapped: &Mapped) -> Error {
    let why = mapped.frames.iter().find_map(|f| match &f.fate {
        Fate::Lost(why) => Some(why.clone()),
        _ => None,
    });
    Error::recording(
        &sequence.root,
        format!(
            "of {} depth images none follows another{}",
            mapped.frames.len(),
            why.map(|w| format!(" ({w})")).unwrap_or_default()
        ),
        "a sequence to map needs two overlapping depth images or more",
    )
}

#[cfg(test)]
mod tests;
