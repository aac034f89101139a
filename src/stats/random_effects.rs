//! Random effects: the common value of several units, and the scatter between them.

use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::{paule_mandel, student_quantile};

/// Level of all intervals here.
const LEVEL: f64 = 0.95;

/// A common value and the scatter of units about it, beyond their measurement errors.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RandomEffects {
    pub common: f64,
    /// 95 %.
    pub common_interval: [f64; 2],
    /// Standard deviation between units.
    pub scatter: f64,
    /// 95 %.
    pub scatter_interval: [f64; 2],
}

impl RandomEffects {
    /// Estimates both from (value, variance of its error) of each unit; `None` for fewer than two units, or
    /// where a variance is not positive.
    ///
    /// The scatter is Paule and Mandel's; its interval inverts the same chi-square (Viechtbauer
    /// 2007). The common value's interval is Knapp and Hartung's (2003), whose factor is one at Paule
    /// and Mandel's scatter, and is never let below one.
    pub fn of(units: &[(f64, f64)]) -> Option<Self> {
        let (common, std_error, scatter) = pooled(units)?;
        let dof = units.len() as f64 - 1.0;
        let chi_square = ChiSquared::new(dof).ok()?;
        let tails = [0.5 * (1.0 + LEVEL), 0.5 * (1.0 - LEVEL)];
        let scatter_interval = tails.map(|p| scatter2(units, chi_square.inverse_cdf(p)).sqrt());
        let reach = student_quantile(LEVEL, dof) * std_error;
        let common_interval = [common - reach, common + reach];
        Some(RandomEffects { common, common_interval, scatter, scatter_interval })
    }
}

/// The common value and its standard error, for Student's t with one degree of freedom less than there
/// are units.
pub fn common_value(units: &[(f64, f64)]) -> Option<[f64; 2]> {
    let (common, std_error, _) = pooled(units)?;
    Some([common, std_error])
}

/// The common value, its standard error, and the scatter between units.
fn pooled(units: &[(f64, f64)]) -> Option<(f64, f64, f64)> {
    let usable = |(y, v): &(f64, f64)| y.is_finite() && v.is_finite() && *v > 0.0;
    if units.len() < 2 || !units.iter().all(usable) {
        return None;
    }
    let tau2 = scatter2(units, units.len() as f64 - 1.0);
    let (common, information) = mean(units, tau2);
    Some((common, information.sqrt().recip(), tau2.sqrt()))
}

/// Variance between units at which Cochran's Q equals `expected`.
fn scatter2(units: &[(f64, f64)], expected: f64) -> f64 {
    paule_mandel(expected, |tau2| about_mean(units, tau2))
}

/// The weighted mean, and the sum of the weights.
fn mean(units: &[(f64, f64)], tau2: f64) -> (f64, f64) {
    let (sum, weights) = units.iter().fold((0.0, 0.0), |(sum, weights), (y, v)| {
        let weight = 1.0 / (v + tau2);
        (sum + weight * y, weights + weight)
    });
    (sum / weights, weights)
}

/// Cochran's Q at the variance `tau2` between units, and its derivative by it.
fn about_mean(units: &[(f64, f64)], tau2: f64) -> (f64, f64) {
    let (middle, _) = mean(units, tau2);
    units.iter().fold((0.0, 0.0), |(q, slope), (y, v)| {
        let (weight, square) = (1.0 / (v + tau2), (y - middle).powi(2));
        (q + weight * square, slope - weight * weight * square)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Seed;
    use crate::stats::{at_least, at_most};
    use rand::Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// Coverage of the intervals over 2,000 fleets of six units with unequal errors, tested by binomial
    /// tails at 1 in 1,000 on either side.
    #[test]
    fn intervals_cover_common_value_and_scatter() {
        const FLEETS: usize = 2000;
        for scatter in [0.0, 0.5, 3.0] {
            let mut held = [0usize; 2];
            for seed in 0..FLEETS {
                let mut rng = Seed(seed as u64).stream("random effects");
                let mut unit = || {
                    let error: f64 = rng.random_range(0.5..1.5);
                    let [a, b]: [f64; 2] = std::array::from_fn(|_| StandardNormal.sample(&mut rng));
                    (7.0 + scatter * a + error * b, error * error)
                };
                let units: Vec<_> = (0..6).map(|_| unit()).collect();
                let found = RandomEffects::of(&units).unwrap();
                let inside = |[low, high]: [f64; 2], truth| low <= truth && truth <= high;
                held[0] += usize::from(inside(found.common_interval, 7.0));
                held[1] += usize::from(inside(found.scatter_interval, scatter));
            }
            for (what, k) in ["common", "scatter"].iter().zip(held) {
                // No more misses than the level allows; Knapp and Hartung's floor and the
                // bound of the scatter at zero widen the intervals.
                assert!(at_most(k, FLEETS, LEVEL) > 1e-3, "{what} {scatter}: {k} of {FLEETS}");
                let exact = scatter == 3.0;
                assert!(!exact || at_least(k, FLEETS, LEVEL) > 1e-3, "{what}: {k} of {FLEETS}");
            }
        }
    }

    /// Equal errors: the closed form of DerSimonian and Laird's moments.
    #[test]
    fn equal_errors_give_the_textbook_scatter() {
        let units = [1.0, 2.0, 3.0, 6.0].map(|y| (y, 0.25));
        let found = RandomEffects::of(&units).unwrap();
        assert!((found.common - 3.0).abs() < 1e-12);
        // The sample variance of the values is 14/3.
        assert!((found.scatter.powi(2) - (14.0 / 3.0 - 0.25)).abs() < 1e-9);
    }

    #[test]
    fn what_cannot_be_weighed_is_refused() {
        for units in [vec![(1.0, 1.0)], vec![(1.0, 1.0), (2.0, 0.0)], vec![(f64::NAN, 1.0); 3]] {
            assert_eq!(RandomEffects::of(&units), None, "{units:?}");
        }
    }
}
