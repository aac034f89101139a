//! What the scripts print of a list of errors, or why they cannot.

use crate::error::Error;
use crate::stats::median;
use crate::trajectory::Pose;

/// A list of errors in figures, in their unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    pub rmse: f64,
    pub mean: f64,
    pub median: f64,
    /// Of the population: divided by n.
    pub std: f64,
    pub min: f64,
    pub max: f64,
    /// How many errors.
    pub pairs: usize,
}

impl Spread {
    /// `None` of nothing.
    pub fn of(errors: &[f64]) -> Option<Self> {
        if errors.is_empty() {
            return None;
        }
        let n = errors.len() as f64;
        let mean = errors.iter().sum::<f64>() / n;
        let square = errors.iter().map(|e| e * e).sum::<f64>() / n;
        let variance = errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / n;
        Some(Spread {
            rmse: square.sqrt(),
            mean,
            median: median(&mut errors.to_vec()),
            std: variance.sqrt(),
            min: errors.iter().copied().fold(f64::INFINITY, f64::min),
            max: errors.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            pairs: errors.len(),
        })
    }

    /// Each times `factor`.
    pub fn scaled(&self, factor: f64) -> Self {
        Spread {
            rmse: self.rmse * factor,
            mean: self.mean * factor,
            median: self.median * factor,
            std: self.std * factor,
            min: self.min * factor,
            max: self.max * factor,
            pairs: self.pairs,
        }
    }
}

/// The two trajectories share too few moments.
pub(super) fn too_few(truth: &[Pose], estimate: &[Pose], pairs: usize) -> Error {
    let span = |poses: &[Pose]| match (poses.first(), poses.last()) {
        (Some(a), Some(b)) => format!("{:.2} to {:.2} s", a.stamp, b.stamp),
        _ => "nothing".into(),
    };
    Error::NotEnough {
        what: format!(
            "{pairs} poses of the estimate ({}) have a true one ({}) at their time",
            span(estimate),
            span(truth)
        ),
        remedy: "give the ground truth of this very sequence, in the same clock".into(),
    }
}
