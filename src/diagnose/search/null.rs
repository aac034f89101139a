//! Null distribution of a candidate's gain.

use nalgebra::{DMatrix, DVector};
use rand_distr::{Distribution, StandardNormal};

use super::beside::Beside;
use super::evidence::Evidence;
use super::noise_gains::REPLICATES;
use super::rules::Rules;
use crate::rng::Stream;

/// Distribution of a candidate's gain under noise alone: b ~ N(0, A) in every view.
///
/// Gains are computed in the eigenvectors of the summed A, where each view's A is taken as diagonal: exact
/// if the views' A are multiples of one another, and a thousand times faster.
pub struct Null {
    /// Eigenvectors of the summed A.
    axes: DMatrix<f64>,
    /// For each eigenvector, the information of each view and the total.
    vectors: Vec<(Vec<f64>, f64)>,
    prior: f64,
    /// Dispersion of the views' fits over their noise, at least 1: about the common fit, or about zero
    /// where only a few views have the term.
    pub dispersion: f64,
    /// Dispersion about the common fit.
    pub about_fit: f64,
}

impl Null {
    /// Null of the columns from `chosen` on, given the columns before them.
    pub fn of(views: &[Evidence], chosen: usize, prior: f64) -> Option<Self> {
        Null::of_candidate(&Beside::of(views, chosen, prior)?.alone(views), prior)
    }

    /// Null of evidence that [`Beside::alone`] has reduced.
    pub fn of_candidate(alone: &[Evidence], prior: f64) -> Option<Self> {
        let k = alone.first()?.b.len();
        let u = Evidence::sum(k, 0.0, alone).a.symmetric_eigen().eigenvectors;
        let information = |a: &DMatrix<f64>| -> Vec<f64> {
            let au = a * &u;
            (0..k).map(|j| u.column(j).dot(&au.column(j)).max(0.0)).collect()
        };
        let by_view: Vec<Vec<f64>> = alone.iter().map(|e| information(&e.a)).collect();
        let total: Vec<f64> = (0..k).map(|j| by_view.iter().map(|a| a[j]).sum()).collect();
        let known = informed(&by_view, &total);
        // Squared score along an eigenvector, relative to noise.
        let square = |&(j, v): &(usize, usize), score: &DVector<f64>| {
            u.column(j).dot(score).powi(2) / by_view[v][j]
        };
        let about_fit = left_scores(alone, prior).map_or(1.0, |left| {
            let squares = known.iter().map(|at| square(at, &left[at.1])).sum();
            dispersion(squares, known.iter().map(|&(j, v)| 1.0 - by_view[v][j] / total[j]).sum())
        });
        let usual = usual_square(known.iter().map(|at| square(at, &alone[at.1].b)).collect());
        let dispersion = about_fit.min(usual);
        let of_vector =
            |(j, &total): (usize, &f64)| (by_view.iter().map(|a| a[j]).collect(), total);
        let vectors = total.iter().enumerate().map(of_vector).collect();
        Some(Null { axes: u, vectors, prior, dispersion, about_fit })
    }

    /// Calibrates a gain over so many views by `rules`, for comparison with the null distribution,
    /// nats: views that scatter more than their noise count for less. Against a model learnt from other
    /// views, this scatter is the noise. It is estimated from few views, so the Gaussian becomes a
    /// Student's t.
    pub fn calibrated_gain(&self, gain: f64, views: usize, rules: &Rules) -> f64 {
        let nats = gain / self.excess(views, rules);
        let judged_by_t = rules.learnt_from.is_some() && nats > 0.0;
        if judged_by_t { student(nats, freedom(views)) } else { nats }
    }

    /// Gain for so many calibrated nats: the inverse of [`Null::calibrated_gain`].
    pub fn gain_for(&self, calibrated_gain: f64, views: usize, rules: &Rules) -> f64 {
        let nats = if rules.learnt_from.is_some() {
            gaussian(calibrated_gain, freedom(views))
        } else {
            calibrated_gain
        };
        nats * self.excess(views, rules)
    }

    /// Variance of the errors of so many views over that of their noise.
    fn excess(&self, views: usize, rules: &Rules) -> f64 {
        self.scatter(rules) * rules.learnt_from.map_or(1.0, |model| model.excess(views as f64))
    }

    /// Dispersion of the views that applies under `rules`.
    pub fn scatter(&self, rules: &Rules) -> f64 {
        if rules.learnt_from.is_some() { self.about_fit } else { self.dispersion }
    }

    /// Draws the gain of one recording of pure noise, nats.
    pub fn draw(&self, rng: &mut Stream) -> f64 {
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        let mut b = Vec::new();
        let mut gain = 0.0;
        for (views, total) in &self.vectors {
            b.clear();
            b.extend(views.iter().map(|a| a.sqrt() * normal()));
            gain += self.gain_along(views, *total, &b);
        }
        gain
    }

    /// Draws the gains of as many recordings as a null is simulated by.
    pub fn draws(&self, rng: &mut Stream) -> Vec<f64> {
        (0..REPLICATES).map(|_| self.draw(rng)).collect()
    }

    /// Gains of recordings with these scores, nats: one matrix a view, one column a recording.
    pub fn gains(&self, scores: &[DMatrix<f64>]) -> Vec<f64> {
        let turned: Vec<DMatrix<f64>> = scores.iter().map(|b| self.axes.tr_mul(b)).collect();
        let recordings = turned.first().map_or(0, DMatrix::ncols);
        let of = |r: usize| {
            let along = |(j, (views, total)): (usize, &(Vec<f64>, f64))| {
                let b: Vec<f64> = turned.iter().map(|b| b[(j, r)]).collect();
                self.gain_along(views, *total, &b)
            };
            self.vectors.iter().enumerate().map(along).sum()
        };
        (0..recordings).map(of).collect()
    }

    /// Gain along one eigenvector, each view predicted from the others' scores `b`.
    fn gain_along(&self, views: &[f64], total: f64, b: &[f64]) -> f64 {
        let sum: f64 = b.iter().sum();
        let of = |(b, a): (&f64, &f64)| {
            let beta = (sum - b) / (total - a + self.prior);
            beta * (b - 0.5 * beta * a)
        };
        b.iter().zip(views).map(of).sum()
    }
}

/// Degrees of freedom of a scatter about a mean.
fn freedom(views: usize) -> f64 {
    (views as f64 - 1.0).max(1.0)
}

/// Converts Gaussian nats to those of Student's t, for an error estimated with `freedom` degrees of
/// freedom.
pub fn student(nats: f64, freedom: f64) -> f64 {
    0.5 * freedom * (2.0 * nats / freedom).ln_1p()
}

/// Inverse of [`student`].
fn gaussian(nats: f64, freedom: f64) -> f64 {
    0.5 * freedom * (2.0 * nats / freedom).exp_m1()
}

/// Eigenvectors and views, by index, with enough information on them: almost none would divide by almost zero.
fn informed(by_view: &[Vec<f64>], total: &[f64]) -> Vec<(usize, usize)> {
    let most = total.iter().copied().fold(0.0, f64::max);
    let vectors = total.iter().enumerate().filter(|(_, total)| **total >= 1e-6 * most);
    let views = |(j, total): (usize, &f64)| {
        let least = 1e-3 * total;
        (0..by_view.len()).filter(move |&v| by_view[v][j] > least).map(move |v| (j, v))
    };
    vectors.flat_map(views).collect()
}

/// Scores that the common fit leaves of each view.
fn left_scores(alone: &[Evidence], prior: f64) -> Option<Vec<DVector<f64>>> {
    let whole = Evidence::sum(alone[0].b.len(), prior, alone);
    let beta = whole.a.cholesky()?.solve(&whole.b);
    Some(alone.iter().map(|e| &e.b - &e.a * &beta).collect())
}

/// Dispersion of the views' scores about the common fit, from the sum of their `squares` relative to noise,
/// with so many degrees of freedom.
fn dispersion(squares: f64, freedom: f64) -> f64 {
    if freedom < 1.0 {
        return 1.0;
    }
    // Less one standard error of the estimate.
    (squares / freedom - (2.0 / freedom).sqrt()).max(1.0)
}

/// Median of the views' squared scores, relative to noise: near 1 where most views do not have the
/// term, whatever the others show.
fn usual_square(mut squares: Vec<f64>) -> f64 {
    if squares.is_empty() {
        return 1.0;
    }
    let (half, n) = (squares.len() / 2, squares.len() as f64);
    let middle = *squares.select_nth_unstable_by(half, f64::total_cmp).1;
    // Enlarged by one standard error of the median, for safety.
    (middle / CHI2_MEDIAN * (1.0 + MEDIAN_ERROR / n.sqrt())).max(1.0)
}

/// Median of the square of a standard normal number.
const CHI2_MEDIAN: f64 = 0.4549;
/// Relative standard error of the median of n such squares, times the root of n: 1 / (2 f m) with
/// their density f at the median m.
const MEDIAN_ERROR: f64 = 2.33;

#[cfg(test)]
#[path = "null_tests.rs"]
mod tests;
