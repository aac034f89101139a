//! RANSAC (Fischler and Bolles 1981).
//!
//! The split follows the roles that vary on their own: an [`Estimator`] knows the geometry, a
//! [`Consensus`] says how good a hypothesis is, a sampler says which points to try. The loop is
//! written once.

use rand::Rng;

use crate::rng::Stream;

/// Geometry: a model from a minimal sample, and how far a datum is from it.
pub trait Estimator {
    type Model: Copy;
    /// Data needed for one hypothesis.
    const MINIMAL: usize;
    /// Number of data.
    fn len(&self) -> usize;
    /// `None` when the sample is degenerate.
    fn hypothesis(&self, sample: &[usize]) -> Option<Self::Model>;
    /// Unsigned distance of datum `i` from the model.
    fn distance(&self, model: &Self::Model, i: usize) -> f64;
}

/// Judgement: greater is better.
pub trait Consensus {
    fn score(&self, distance: f64) -> f64;
}

/// The count of data within a threshold, as in Fischler and Bolles (1981).
#[derive(Debug, Clone, Copy)]
pub struct InlierCount {
    pub threshold: f64,
}

impl Consensus for InlierCount {
    fn score(&self, distance: f64) -> f64 {
        f64::from(u8::from(distance < self.threshold))
    }
}

/// Data of the largest minimal sample there is: three points of a plane.
const MAX_MINIMAL: usize = 3;

/// Choice: uniform, without repetition.
#[derive(Debug)]
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

/// The best of up to `iterations` hypotheses, judged on `jury`; stops early once a better one is
/// less likely than `1 - confidence`.
pub fn ransac<E, C>(
    data: &E,
    consensus: &C,
    sampler: &mut UniformSampler<'_>,
    jury: &[usize],
    iterations: usize,
    confidence: f64,
) -> Option<(E::Model, f64)>
where
    E: Estimator,
    C: Consensus,
{
    debug_assert!(E::MINIMAL <= MAX_MINIMAL);
    if data.len() < E::MINIMAL || jury.is_empty() {
        return None;
    }
    let mut best: Option<(E::Model, f64)> = None;
    let mut needed = iterations;
    let mut tried = 0;
    while tried < needed.min(iterations) {
        tried += 1;
        let drawn = sampler.draw(E::MINIMAL, data.len());
        let Some(model) = data.hypothesis(&drawn[..E::MINIMAL]) else { continue };
        let score: f64 = jury.iter().map(|&i| consensus.score(data.distance(&model, i))).sum();
        if best.is_none_or(|(_, b)| score > b) {
            best = Some((model, score));
            needed = hypotheses_needed(score / jury.len() as f64, E::MINIMAL, confidence);
        }
    }
    best
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
