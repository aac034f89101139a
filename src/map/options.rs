//! The mapper's settings; the paper's Table II where it gives one.

use crate::error::{Error, Result};
use crate::rng::Seed;

/// What a frame is aligned to, and how neighbours are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// The paper's: voxel grid, normals by principal components, exact nearest neighbours, each
    /// frame to the one before.
    Paper,
    /// Image blocks, neighbours by projection, each frame to the one before.
    Projective,
    /// Image blocks, neighbours by projection, each frame to the map so far.
    Model,
}

/// Where an alignment starts from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Init {
    /// Where the last frame was.
    None,
    /// As the last two frames moved.
    Motion,
    /// Where ORB features say.
    Orb,
}

/// What a correspondence weighs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Weights {
    /// All the same.
    None,
    /// The paper's: 1 / sigma(d_z, theta) of the target's point.
    Model,
    /// One over the joint standard deviation of both points along the normal, averaged as they are.
    Both,
}

/// How residuals far beyond the usual count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kernel {
    /// As any other.
    Square,
    /// With their size, not its square.
    Huber,
    /// Less and less, then not at all.
    Tukey,
}

/// All of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    pub method: Method,
    pub weights: Weights,
    pub kernel: Kernel,
    pub init: Init,
    /// Side of a voxel, m.
    pub voxel_m: f32,
    /// Side of an image block, px.
    pub block_px: usize,
    /// Neighbours farther than this are none, m.
    pub max_correspondence_m: f32,
    pub max_iterations: usize,
    /// ICP has converged when a step is below both: m and rad.
    pub min_shift_m: f64,
    pub min_turn_rad: f64,
    /// Surfaces that lean more to each other are not one: cosine between their normals.
    pub min_cosine: f64,
    /// Observations of a surfel that count at most.
    pub max_observations: f32,
    /// A frame of which a smaller share of points has a neighbour is lost.
    pub min_inlier_ratio: f64,
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
            // Not in the paper: what its peers are run with.
            max_correspondence_m: 0.1,
            max_iterations: 30,
            min_shift_m: 1e-8,
            min_turn_rad: 1e-5 * std::f64::consts::PI / 180.0,
            min_cosine: -1.0,
            max_observations: 30.0,
            min_inlier_ratio: 0.3,
            seed: Seed(1),
            colour: true,
        }
    }

    /// What was measured to be best.
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

    /// # Errors
    /// When a number is out of its range.
    pub fn check(&self) -> Result<()> {
        let wrong = |what: String, remedy| Err(Error::Argument { what, remedy });
        if !(0.002..=1.0).contains(&self.voxel_m) {
            return wrong(format!("--voxel {}", self.voxel_m), "give 0.002 to 1 m");
        }
        if !(1..=32).contains(&self.block_px) {
            return wrong(format!("--block {}", self.block_px), "give 1 to 32 px");
        }
        let reach = self.max_correspondence_m;
        if !(reach > 0.0 && reach <= 2.0) {
            return wrong(format!("--gate {reach}"), "give a distance up to 2 m");
        }
        if self.max_iterations == 0 {
            return wrong("--iterations 0".into(), "give 1 or more");
        }
        if self.max_observations.is_nan() || self.max_observations < 1.0 {
            return wrong(format!("--memory {}", self.max_observations), "give 1 or more");
        }
        Ok(())
    }
}
