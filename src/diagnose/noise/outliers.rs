//! Fraction and scale of the far errors, from counts between a few distances.
//!
//! Near the middle far errors are hidden in the noise, so their unseen part depends on the form of their
//! distribution. A matcher that locks to a wrong place errs by a Gaussian; where near places win more often
//! than far ones, by a Laplace distribution; where all in its window are alike, by a uniform one. The
//! posterior is summed over the three.

use super::tail_counts::{TAIL_EDGES, TailCounts};
use crate::diagnose::search::posterior::Posterior;
use crate::stats::{even, normal_beyond};

/// Fraction and scale of the far errors, each with its standard error. The scale is their standard
/// deviation over that of the noise.
#[derive(Debug, Clone, Copy)]
pub struct Outliers {
    pub fraction: [f64; 2],
    pub scale: [f64; 2],
}

/// Share of errors of unit variance beyond `t` standard deviations.
const FORMS: [fn(f64) -> f64; 3] = [
    normal_beyond,
    |t| (-std::f64::consts::SQRT_2 * t).exp(),
    |t| (1.0 - t / 3f64.sqrt()).max(0.0),
];

/// Scales tried, evenly spaced in the logarithm.
const SCALES: usize = 240;
const REACH: [f64; 2] = [1.2, 30.0];
/// Relative error of the sigma in which distances are measured: a patch of 40 px a side has its own to 2 %,
/// and is uneven by about as much again. Both parameters, and the expected count of a bin, have it too.
const SIGMA: f64 = 0.05;

/// Fits the far errors to these counts. `scatter` is the relative standard error of their mean total, which
/// varies between views. `None` where there are no more than the noise's own.
pub fn outliers(counts: &TailCounts, scatter: f64) -> Option<Outliers> {
    let own = |t: f64| counts.n * FORMS[0](t);
    let chance: Vec<f64> = TAIL_EDGES.windows(2).map(|w| own(w[0]) - own(w[1])).collect();
    let more: f64 = counts.between.iter().sum::<f64>() - chance.iter().sum::<f64>();
    if more <= 0.0 || counts.n <= 0.0 {
        return None;
    }
    let mut nodes: Vec<[f64; 3]> = Vec::new();
    for form in FORMS {
        for scale in even(REACH.map(f64::ln), SCALES).map(f64::exp) {
            let beyond = |edge: f64| form(edge / scale);
            let inside = beyond(TAIL_EDGES[0]) - beyond(TAIL_EDGES[TAIL_EDGES.len() - 1]);
            if inside <= 0.0 {
                continue;
            }
            let fraction = more / inside / counts.n;
            // No more than all readings can be outliers.
            if fraction >= 1.0 {
                continue;
            }
            let bins = TAIL_EDGES.windows(2).zip(counts.between.iter().zip(&chance));
            let misfit = bins.map(|(w, (seen, chance))| {
                let expected = chance + more * (beyond(w[0]) - beyond(w[1])) / inside;
                // At least that of one count: a single stray where none is expected is no proof.
                let variance = (expected + (SIGMA * expected).powi(2)).max(1.0);
                // Gaussian likelihood of a count, including its variance's own term.
                0.5 * ((seen - expected).powi(2) / variance + variance.ln())
            });
            nodes.push([misfit.sum(), fraction, scale]);
        }
    }
    let posterior = Posterior::of(nodes, |n| (-n[0], 1.0))?;
    let of = |k: usize, scatter: f64| {
        let mean = posterior.mean(|n| n[k]);
        [mean, posterior.rms(|n| n[k] - mean).hypot(scatter.hypot(SIGMA) * mean)]
    };
    Some(Outliers { fraction: of(1, scatter), scale: of(2, 0.0) })
}

#[cfg(test)]
#[path = "outliers_tests.rs"]
mod tests;
