//! The mapper: the trajectory of the camera and a map, from depth images and a noise model.
//!
//! ```text
//! Sequence -preprocess-> points with normals and sigmas -start-> -align-> pose -fuse-> map
//! ```
//! Three methods share the loop ([`icp`]): the paper's ([`Method::Paper`]), neighbours by projection
//! ([`Method::Projective`]), and alignment to the map so far ([`Method::Model`]).

mod batch;
mod blocks;
mod frame_report;
pub mod icp;
mod index_map;
mod map_points;
mod nearest;
mod normal_equations;
#[cfg_attr(not(feature = "opencv"), path = "no_orb.rs")]
mod orb;
mod point;
mod preprocess;
pub mod ransac;
mod rolling;
mod sparse_grid;
mod surfels;
mod tracker;
mod voxel;

pub use frame_report::{Fate, FrameReport, Stages, frames_csv};
pub use icp::{Alignment, Termination};
pub use map_points::{MapPoint, ply};
pub use nearest::Nearest;
pub use normal_equations::Direction;
pub use point::Point;

use preprocess::{Prepared, Preprocessor};
use rayon::prelude::*;
use tracker::Tracker;

use crate::Progress;
use crate::error::{Error, Result};
use crate::evaluate::{ClockOffset, clock_offset};
use crate::model::NoiseModel;
use crate::rng::Seed;
use crate::sequence::{Moment, Sequence};
use crate::trajectory::Pose;

#[derive(Debug, Clone, PartialEq)]
pub struct Mapped {
    /// One per depth image, in time order.
    pub frames: Vec<FrameReport>,
    pub map: Vec<MapPoint>,
    /// Remarks on oddities, in sentences.
    pub remarks: Vec<String>,
}

impl Mapped {
    /// The poses of all frames that have one; the first is the identity.
    pub fn trajectory(&self) -> Vec<Pose> {
        let pose = |f: &FrameReport| Some(Pose { stamp: f.stamp, world_from_camera: f.pose? });
        self.frames.iter().filter_map(pose).collect()
    }

    /// Offset to add to the colour images' stamps to match the depth images', from how each sees the camera
    /// turn. `None` without [`Init::Orb`], and where the camera turned too little.
    pub fn clock_offset(&self) -> Option<ClockOffset> {
        let by_colour: Vec<Pose> = self.frames.iter().filter_map(|f| f.by_colour).collect();
        // The map's trajectory is smooth enough to interpolate; that of the features is not.
        clock_offset(&self.trajectory(), &by_colour)
    }

    /// Frames without a pose.
    pub fn lost(&self) -> usize {
        self.frames.iter().filter(|f| f.pose.is_none()).count()
    }
}

/// Frames prepared in parallel, enough that no thread waits for long.
const AHEAD: usize = 4;

/// Maps a sequence. The caller checks whether the model fits this sensor:
/// [`NoiseModel::differences`] and [`outside`].
/// Fails when the model is of another sensor, OpenCV fails, or fewer than two frames have a pose.
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
    let prepare = |block: Option<&[Moment]>| -> Vec<Result<Prepared>> {
        block.into_par_iter().flatten().map(|m| preprocessor.prepare(m)).collect()
    };
    let mut blocks = moments.chunks(AHEAD).peekable();
    let mut ready = prepare(blocks.peek().copied());
    while let Some(block) = blocks.next() {
        let prepared = std::mem::take(&mut ready);
        // The next frames are read while these are aligned in order.
        let align = || -> Result<Vec<FrameReport>> {
            let each = |(moment, frame): (&Moment, _)| tracker.track(moment.stamp, frame);
            block.iter().zip(prepared).map(each).collect()
        };
        let (aligned, next) = rayon::join(align, || prepare(blocks.peek().copied()));
        frames.extend(aligned?);
        ready = next;
        progress.step(frames.len(), moments.len());
    }
    let mut remarks: Vec<String> = preprocessor.remark().into_iter().collect();
    remarks.extend(frames.iter().filter_map(|f| f.remark.clone()));
    remarks.extend(frame_report::remarks(&frames));
    let mut mapped = Mapped { frames, map: tracker.into_map(), remarks };
    let offset = mapped.clock_offset().filter(ClockOffset::is_significant);
    mapped.remarks.extend(offset.map(|o| frame_report::clocks(&o)));
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

/// What a frame is aligned to, and how neighbours are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// The paper's: voxel grid, exact nearest neighbours, each frame to the one before.
    Paper,
    /// Image blocks, neighbours by projection, each frame to the one before.
    Projective,
    /// Image blocks, neighbours by projection, each frame to the map so far.
    Model,
}

/// Start of an alignment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Init {
    /// The pose of the last frame.
    None,
    /// Constant velocity: that between the last two frames with a pose.
    Motion,
    /// The motion by ORB features.
    Orb,
}

/// Weight of a correspondence.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Weights {
    /// All equal.
    None,
    /// The paper's: 1 / sigma(d_z, theta) of the target point.
    Model,
    /// One over the joint standard deviation of both (averaged) points along the normal.
    Both,
}

/// Robust kernel: how large residuals count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kernel {
    /// By their square, like all others.
    Square,
    /// By their size instead of its square.
    Huber,
    /// Less and less, and finally not at all.
    Tukey,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    pub method: Method,
    pub weights: Weights,
    pub kernel: Kernel,
    pub init: Init,
    pub voxel_m: f32,
    pub block_px: usize,
    /// Largest distance of a neighbour, m.
    pub max_correspondence_m: f32,
    pub max_iterations: usize,
    /// ICP has converged when a step is below both, m and rad.
    pub min_shift_m: f64,
    pub min_turn_rad: f64,
    /// Least cosine between the normals of a pair.
    pub min_cosine: f64,
    /// Observations of a surfel that count at most.
    pub max_observations: f32,
    /// A frame with a smaller share of points with a neighbour is lost.
    pub min_inlier_ratio: f64,
    /// Time from the first row of a depth image to the last, s; 0 for a global shutter. Not used by the
    /// paper's method.
    pub readout_s: f64,
    pub seed: Seed,
    /// Read colour for the map.
    pub colour: bool,
}

impl Options {
    /// The paper's Table II.
    pub fn paper(weights: Weights, init: Init) -> Self {
        Options {
            method: Method::Paper,
            weights,
            kernel: Kernel::Square,
            init,
            voxel_m: 0.03,
            block_px: 4,
            // Not in the paper; the value that its peers are run with.
            max_correspondence_m: 0.1,
            max_iterations: 30,
            min_shift_m: 1e-8,
            min_turn_rad: 1e-5 * std::f64::consts::PI / 180.0,
            min_cosine: -1.0,
            max_observations: 30.0,
            min_inlier_ratio: 0.3,
            readout_s: 0.0,
            seed: Seed(1),
            colour: true,
        }
    }

    /// The options measured to be best.
    pub fn best() -> Self {
        Options {
            method: Method::Model,
            kernel: Kernel::Huber,
            min_cosine: 0.7,
            min_shift_m: 1e-5,
            min_turn_rad: 1e-5,
            ..Options::paper(Weights::Both, Init::Motion)
        }
    }
}

/// Alignments of real films converge within 30 (the paper's limit); one that has not by now never does.
pub const MAX_ITERATIONS: usize = 1000;
/// A surfel is observed once per frame: an hour at 30 Hz.
pub const MAX_OBSERVATIONS: f32 = 108_000.0;
/// Accepted sides of a voxel, m: from a depth image's resolution to a few for a room.
pub const VOXEL_M: [f64; 2] = [0.002, 1.0];
/// Beyond this a block is the whole image of a small sensor.
pub const MAX_BLOCK_PX: usize = 32;
/// Accepted largest distances within a pair, m: from a depth image's resolution to those between objects.
pub const GATE_M: [f64; 2] = [0.001, 2.0];
/// Longest readout of any shutter, s.
pub const MAX_READOUT_S: f64 = 1.0;

/// Frames sampled from a film to find its depths.
const SAMPLED: usize = 8;

/// Share of the sequence's depths outside the distances at which `model` was measured, where its sigma is
/// held constant; from a few frames spread over the whole. `None` where those show no depth.
pub fn outside(sequence: &Sequence, model: &NoiseModel) -> Option<f64> {
    let table = sequence.sensor.code.table();
    let [near, far] = model.sigma.domain.z_m;
    let (mut seen, mut beyond) = (0usize, 0usize);
    let every = sequence.moments.len().div_ceil(SAMPLED).max(1);
    // A frame that cannot be read is reported when it is mapped.
    for frame in sequence.moments.iter().step_by(every).filter_map(|m| sequence.depth(m).ok()) {
        for z in frame.raw.iter().map(|&raw| f64::from(table.metres(raw))).filter(|z| z.is_finite())
        {
            seen += 1;
            beyond += usize::from(!(near..=far).contains(&z));
        }
    }
    (seen > 0).then(|| beyond as f64 / seen as f64)
}

#[cfg(test)]
mod tests;
