//! Refines a period between those that were tried.

use super::candidate::Candidate;
use super::outcome::Chosen;
use crate::solve::brent;
use crate::stats::range;
use crate::terms::Basis;

/// Tolerance, as a share of the step between tried periods: a fifth of the Cramer-Rao bound at 5,000
/// nats, which is a hundredth of the step that turns a sine by half a cycle over the image.
const TO_SHARE: f64 = 0.002;
/// Brent's method needs about ten.
const MAX_STEPS: u64 = 30;

/// Tunes the period of `next` between `low` and `high` to the largest gain. `total` is that of a basis
/// beside the chosen terms, nats.
pub fn tune([low, high]: [f64; 2], next: &mut Chosen, total: impl Fn(&Basis) -> f64) {
    let gain = |period: f64| total(&next.candidate.basis.with_period(period));
    // The tried periods are evenly spaced in cycles over the image.
    let cycles = [1.0 / high, 1.0 / low];
    let tolerance = TO_SHARE * 0.5 * (cycles[1] - cycles[0]);
    let Some(best) = brent(|cycles| -gain(1.0 / cycles), cycles, tolerance, MAX_STEPS) else {
        return;
    };
    let tried = next.candidate.basis.period().unwrap_or(1.0 / best);
    let better = gain(1.0 / best) - gain(tried);
    if better > 0.0 {
        next.candidate.basis = next.candidate.basis.with_period(1.0 / best);
        next.gain += better;
    }
}

/// Next smaller and next larger period among candidates of the same kind. `None` if there is only one,
/// and for a nameless curve, which has no formula to follow.
pub fn neighbours(candidates: &[Candidate], of: &Candidate) -> Option<[f64; 2]> {
    let period = of.family.and(of.basis.period())?;
    let is_like = |c: &&Candidate| {
        c.family == of.family && c.basis.axis() == of.basis.axis() && c.basis.period().is_some()
    };
    let like = candidates.iter().filter(is_like).filter_map(|c| c.basis.period());
    let nearest = |side: f64| {
        let beyond = like.clone().filter(move |p| side * (p - period) > 1e-9 * period);
        beyond.min_by(|a, b| (a - period).abs().total_cmp(&(b - period).abs()))
    };
    let [low, high] = range([nearest(-1.0), Some(period), nearest(1.0)].into_iter().flatten());
    (high > low).then_some([low, high])
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};
    use rand::Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::effects::{self, Fitted};
    use crate::rng::Seed;
    use crate::terms::{Coordinate, Extent, PixelContext};

    const COLUMNS: usize = 640;
    const NOISE_PX: f64 = 0.01;

    fn stripes(half_cycles: u32) -> Candidate {
        let period = 2.0 * COLUMNS as f64 / f64::from(half_cycles);
        Candidate::named("column-banding", Basis::waves(Coordinate::Column, period, 1))
    }

    /// Least-squares fit to the column means.
    fn fit(basis: &Basis, means: &DVector<f64>) -> (DVector<f64>, DMatrix<f64>) {
        let mut g = DMatrix::zeros(COLUMNS, 2);
        let mut row = [0.0; 2];
        for u in 0..COLUMNS {
            basis.fill(&PixelContext { u: u as f64, ..PixelContext::default() }, &mut row);
            g[(u, 0)] = row[0];
            g[(u, 1)] = row[1];
        }
        let covariance = g.tr_mul(&g).try_inverse().unwrap() * NOISE_PX.powi(2);
        (&covariance * g.tr_mul(means) / NOISE_PX.powi(2), covariance)
    }

    /// Sines between the tried periods: 90 % of 200 are 180; fewer than 167 have a chance of 1e-3
    /// (numpy).
    #[test]
    fn the_period_between_those_tried_is_found_and_its_error_holds() {
        let candidates: Vec<Candidate> = (6..=64).map(stripes).collect();
        let mut rng = Seed(3).stream("search/period");
        let mut held = 0;
        for _ in 0..200 {
            let half_cycles: f64 = rng.random_range(10.0..40.0);
            let truth = 2.0 * COLUMNS as f64 / half_cycles;
            let phase: f64 = rng.random_range(0.0..std::f64::consts::TAU);
            let mut noise = || -> f64 { StandardNormal.sample(&mut rng) };
            let means = DVector::from_fn(COLUMNS, |u, _| {
                0.005 * (std::f64::consts::TAU * u as f64 / truth + phase).sin()
                    + NOISE_PX * noise()
            });
            let total = |basis: &Basis| {
                let (beta, covariance) = fit(basis, &means);
                0.5 * beta.dot(&(covariance.try_inverse().unwrap() * &beta))
            };
            let candidate = stripes(half_cycles.round() as u32);
            let mut next = Chosen::of(candidate);
            let bracket = neighbours(&candidates, &next.candidate).expect("several periods");
            tune(bracket, &mut next, total);
            let (beta, covariance) = fit(&next.candidate.basis, &means);
            let reach = Extent { column: [0.0, COLUMNS as f64], ..Extent::default() };
            let fit = Fitted {
                shape: &next.candidate.basis,
                coefficients: beta.as_slice(),
                covariance: &covariance,
                reach: &reach,
            };
            let banding = effects::find("column-banding").unwrap();
            let estimates = banding.estimates(&fit);
            let period = estimates.iter().find(|e| e.parameter == "period_px").unwrap();
            held += usize::from((period.value - truth).abs() < 1.645 * period.std_error);
        }
        assert!((167..=196).contains(&held), "{held}");
    }

    #[test]
    fn the_only_period_of_its_kind_stays() {
        let locking =
            Candidate::named("pixel-locking", Basis::waves(Coordinate::Disparity, 1.0, 2));
        assert_eq!(neighbours(&[stripes(8), locking.clone()], &locking), None);
        let [low, high] = neighbours(&[stripes(8), stripes(9), stripes(12)], &stripes(9)).unwrap();
        approx::assert_relative_eq!(low, 1280.0 / 12.0);
        approx::assert_relative_eq!(high, 160.0);
    }
}
