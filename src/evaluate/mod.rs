//! How far an estimated trajectory is from the true one, as the scripts of the TUM RGB-D benchmark
//! compute it (Sturm, Engelhard, Endres, Burgard, Cremers, "A benchmark for the evaluation of RGB-D
//! SLAM systems", IROS 2012).
//!
//! * ATE: positions of associated poses after the best rigid alignment ([`align`], no scale).
//! * RPE: the motion over a fixed interval, estimated against true, needs no alignment.

mod ate;
mod rpe;
mod spread;

pub use ate::{Ate, absolute, align};
pub use rpe::{Delta, Rpe, relative};
pub use spread::Spread;

use std::path::Path;

use crate::error::Result;
use crate::trajectory::{Pose, read_benchmark};

/// ATE and RPE of one estimate.
#[derive(Debug, Clone, PartialEq)]
pub struct Evaluation {
    pub ate: Ate,
    pub rpe: Rpe,
}

/// Of poses in time order.
///
/// # Errors
/// When too few of them belong to the same moments.
pub fn evaluate(truth: &[Pose], estimate: &[Pose], delta: Delta) -> Result<Evaluation> {
    Ok(Evaluation { ate: absolute(truth, estimate)?, rpe: relative(truth, estimate, delta)? })
}

/// Of two files.
///
/// # Errors
/// When a file cannot be read, or as [`evaluate`].
pub fn evaluate_files(truth: &Path, estimate: &Path, delta: Delta) -> Result<Evaluation> {
    evaluate(&read_benchmark(truth)?.poses, &read_benchmark(estimate)?.poses, delta)
}

#[cfg(test)]
mod tests;
