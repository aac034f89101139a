//! RANSAC (Fischler and Bolles 1981).
//!
//! The split follows the roles that vary on their own: an [`Estimator`] knows the geometry, a sampler
//! says which points to try. The loop, which counts the data within a threshold, is written once.

use rand::Rng;

use crate::rng::Stream;

/// Geometry: a model from a minimal sample, and how far a datum is from it.
pub trait Estimator {
    type Model: Copy;
    /// Data needed for one hypothesis.
    const MINIMAL: usize;
    fn len(&self) -> usize;
    /// `None` when the sample is degenerate.
    fn hypothesis(&self, sample: &[usize]) -> Option<Self::Model>;
    /// Unsigned distance of datum `i` from the model.
    fn distance(&self, model: &Self::Model, i: usize) -> f64;
}

/// Data of the largest minimal sample there is: three points of a plane.
const MAX_MINIMAL: usize = 3;

/// Choice: uniform, without repetition.
pub struct UniformSampler<'r> {
    pub rng: &'r mut Stream,
}

impl UniformSampler<'_> {
    /// `count` different indices below `n`, in the first slots.
    fn draw(&mut self, count: usize, n: usize) -> [usize; MAX_MINIMAL] {
        let mut drawn = [0; MAX_MINIMAL];
        for slot in 0..count {
            loop {
                drawn[slot] = self.rng.random_range(0..n);
                if !drawn[..slot].contains(&drawn[slot]) {
                    break;
                }
            }
        }
        drawn
    }
}

/// When a search ends, and what lies on a plane.
#[derive(Debug, Clone, Copy)]
pub struct RansacOptions {
    /// Greatest distance of an inlier, in the data's unit; m for the paper's plane.
    pub threshold_m: f64,
    pub iterations: usize,
    pub confidence: f64,
}

/// The best of up to `iterations` hypotheses by its inliers among the `jury`; stops early once a
/// better one is less likely than `1 - confidence`.
pub fn ransac<E: Estimator>(
    data: &E,
    options: &RansacOptions,
    sampler: &mut UniformSampler<'_>,
    jury: &[usize],
) -> Option<E::Model> {
    debug_assert!(E::MINIMAL <= MAX_MINIMAL);
    if data.len() < E::MINIMAL || jury.is_empty() {
        return None;
    }
    let mut best: Option<(E::Model, usize)> = None;
    let mut needed = options.iterations;
    let mut tried = 0;
    while tried < needed.min(options.iterations) {
        tried += 1;
        let drawn = sampler.draw(E::MINIMAL, data.len());
        let Some(model) = data.hypothesis(&drawn[..E::MINIMAL]) else { continue };
        let inlier = |i: &&usize| data.distance(&model, **i) < options.threshold_m;
        let inliers = jury.iter().filter(inlier).count();
        if best.is_none_or(|(_, most)| inliers > most) {
            best = Some((model, inliers));
            let share = inliers as f64 / jury.len() as f64;
            needed = hypotheses_needed(share, E::MINIMAL, options.confidence);
        }
    }
    best.map(|(model, _)| model)
}

/// log(1 - p) / log(1 - w^m), Fischler and Bolles (1981).
fn hypotheses_needed(inlier_share: f64, minimal: usize, confidence: f64) -> usize {
    let good = inlier_share.clamp(0.0, 1.0).powi(minimal as i32);
    if good >= 1.0 {
        return 1;
    }
    if good <= 0.0 {
        return usize::MAX;
    }
    let n = (1.0 - confidence).ln() / (1.0 - good).ln();
    if n.is_finite() { (n.ceil() as usize).max(1) } else { usize::MAX }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_of_hypotheses_is_the_textbook_one() {
        assert_eq!(hypotheses_needed(0.5, 3, 0.99), 35);
        assert_eq!(hypotheses_needed(1.0, 3, 0.99), 1);
    }
}
