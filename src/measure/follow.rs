//! Where the target is in each frame, beside where the first frames show it: a cut of the tails that stood still
//! would take a drifting target's noise on one side only.

use super::grouping::CUT_SIGMAS;
use crate::stats::median_in_place;

/// Among fewer frames than this nobody knows which one is wrong.
pub(super) const MAJORITY: usize = 3;
/// A cell that is off by less than this share of its cut, a quarter of a standard deviation, stays where it is:
/// the cut then takes 0.1 % off sigma.
pub(super) const NO_SHIFT: f32 = 0.07;
/// A drift of fewer standard deviations is not worth a note.
const NOTED_SIGMAS: f32 = 1.0;
/// Standard errors by which a drift is clear of frames that jitter: of eight frames t has two degrees of freedom, and
/// one in forty is beyond; a steady drift has 8.
const CLEARLY: f32 = 6.0;

/// What is known of where the cells were, m.
pub(super) struct Follow {
    /// Frames that the cuts come from.
    pub held: usize,
    /// Mean residual of each cell in them.
    pub usual: Vec<f32>,
    /// Offset of each cell in the frame last taken.
    pub last: Vec<f32>,
    /// Offset of the largest cell in each frame, as a share of its cut.
    pub path: Vec<f32>,
}

impl Follow {
    pub fn over(cells: usize, held: usize) -> Self {
        Follow { held, usual: vec![0.0; cells], last: vec![0.0; cells], path: Vec::new() }
    }

    /// Of a cell whose mean residual is `mean`. A target that drifts is near where it was in the frame before;
    /// what is near neither that nor its usual place is not followed.
    pub fn offset(&self, cell: usize, mean: f32, cut: f32) -> f32 {
        let offset = mean - self.usual[cell];
        let near = offset.abs().min((offset - self.last[cell]).abs()) < cut;
        if near { offset } else { 0.0 }
    }

    /// By how many standard deviations the last quarter of the frames lies off the first, if by more than frames
    /// that jitter do.
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
