//! RANSAC (Fischler and Bolles 1981) for models determined by three data.

use rand::Rng;

use crate::rng::Stream;

/// Inlier threshold and stopping criteria.
#[derive(Debug, Clone, Copy)]
pub struct RansacOptions {
    /// Largest distance of an inlier, in the data's unit; m for the paper's plane.
    pub threshold_m: f64,
    pub iterations: usize,
    pub confidence: f64,
}

/// Returns the best of up to `iterations` hypotheses, each through three of `n` data, by its inliers among
/// the `jury`. Stops early once a better one is less likely than `1 - confidence`. `hypothesis` is `None` for
/// a degenerate sample; `distance` is the unsigned distance of a datum from a model.
pub fn ransac<M: Copy>(
    n: usize,
    options: &RansacOptions,
    rng: &mut Stream,
    jury: &[usize],
    hypothesis: impl Fn([usize; 3]) -> Option<M>,
    distance: impl Fn(&M, usize) -> f64,
) -> Option<M> {
    if n < 3 || jury.is_empty() {
        return None;
    }
    let mut best: Option<(M, usize)> = None;
    let mut needed = options.iterations;
    let mut tried = 0;
    while tried < needed.min(options.iterations) {
        tried += 1;
        let Some(model) = hypothesis(three_below(n, rng)) else { continue };
        let inlier = |i: &&usize| distance(&model, **i) < options.threshold_m;
        let inliers = jury.iter().filter(inlier).count();
        if best.is_none_or(|(_, most)| inliers > most) {
            best = Some((model, inliers));
            needed = hypotheses_needed(inliers as f64 / jury.len() as f64, options.confidence);
        }
    }
    best.map(|(model, _)| model)
}

/// Three different indices below `n`, drawn uniformly.
fn three_below(n: usize, rng: &mut Stream) -> [usize; 3] {
    let mut drawn = [0; 3];
    for slot in 0..3 {
        drawn[slot] = rng.random_range(0..n);
        while drawn[..slot].contains(&drawn[slot]) {
            drawn[slot] = rng.random_range(0..n);
        }
    }
    drawn
}

/// log(1 - p) / log(1 - w^3), Fischler and Bolles (1981).
fn hypotheses_needed(inlier_share: f64, confidence: f64) -> usize {
    let good = inlier_share.clamp(0.0, 1.0).powi(3);
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
        assert_eq!(hypotheses_needed(0.5, 0.99), 35);
        assert_eq!(hypotheses_needed(1.0, 0.99), 1);
    }
}
