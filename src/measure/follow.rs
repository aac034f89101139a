//! Follows the target's offset in each frame from its position in the first frames: with a fixed cut, a
//! drifting target would lose noise on one side only.

use super::grouping::CUT_SIGMAS;
use crate::stats::median_in_place;

/// Fewest frames among which the wrong one can be told.
pub(super) const MAJORITY: usize = 3;
/// Offsets below this share of the cut, a quarter of a standard deviation, are ignored: they change sigma by
/// 0.1 %.
pub(super) const NO_SHIFT: f32 = 0.07;
/// Least drift that is noted, standard deviations.
const NOTED_SIGMAS: f32 = 1.0;
/// Standard errors that tell a drift from jitter. With eight frames t has two degrees of freedom and exceeds
/// this once in forty; a steady drift has t = 8.
const CLEARLY: f32 = 6.0;

/// Offsets of the cells over the frames, m.
pub(super) struct Follow {
    /// Frames from which the cuts were found.
    pub held: usize,
    /// Mean residual of each cell in them.
    pub usual: Vec<f32>,
    /// Offset of each cell in the last accepted frame.
    pub last: Vec<f32>,
    /// Offset of the largest cell in each frame, as a share of its cut.
    pub path: Vec<f32>,
}

impl Follow {
    pub fn over(cells: usize, held: usize) -> Self {
        Follow { held, usual: vec![0.0; cells], last: vec![0.0; cells], path: Vec::new() }
    }

    /// Offset of a cell whose mean residual is `mean`. A drifting target is near its position in the frame
    /// before; an offset near neither that nor the usual position is not followed.
    pub fn offset(&self, cell: usize, mean: f32, cut: f32) -> f32 {
        let offset = mean - self.usual[cell];
        let near = offset.abs().min((offset - self.last[cell]).abs()) < cut;
        if near { offset } else { 0.0 }
    }

    /// Drift from the first to the last quarter of the frames, in standard deviations, if it exceeds jitter.
    pub fn drift_sigmas(&self) -> Option<f32> {
        let quarter = self.path.len() / 4;
        if quarter < 2 {
            return None;
        }
        let (first, last) = (&self.path[..quarter], &self.path[self.path.len() - quarter..]);
        let mean = |part: &[f32]| part.iter().sum::<f32>() / quarter as f32;
        let squares = |part: &[f32]| part.iter().map(|x| (x - mean(part)).powi(2)).sum::<f32>();
        let scatter = (squares(first) + squares(last)) / (2 * quarter - 2) as f32;
        let drift = mean(last) - mean(first);
        let sigmas = CUT_SIGMAS as f32 * drift;
        let clear = drift.abs() > CLEARLY * (2.0 * scatter / quarter as f32).sqrt();
        (clear && sigmas.abs() > NOTED_SIGMAS).then_some(sigmas)
    }
}

/// Mean of the residuals within `cut` of their median.
pub(super) fn centre(residuals: &mut [f32], cut: f32) -> f32 {
    let median = median_in_place(residuals);
    let (sum, n) = residuals
        .iter()
        .filter(|e| (*e - median).abs() < cut)
        .fold((0.0, 0.0), |(sum, n), &e| (sum + f64::from(e), n + 1.0));
    (sum / n) as f32
}
