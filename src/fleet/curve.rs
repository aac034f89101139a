//! A unit's values at the places where units are compared, and the test whether several units share them.

use nalgebra::{DMatrix, DVector};

use crate::stats::f_upper;

/// Values at places that all units have in common, with the covariance of their errors.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    pub values: DVector<f64>,
    pub covariance: DMatrix<f64>,
    /// Degrees of freedom of the covariance, which is an estimate too.
    pub degrees_of_freedom: f64,
}

impl Curve {
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Variance of the error at a place.
    ///
    /// This is the variance of Student's t with the covariance's degrees of freedom n, n / (n - 2) times the
    /// estimate (JCGM 101:2008, 6.4.9).
    pub fn variance(&self, place: usize) -> f64 {
        let n = self.degrees_of_freedom;
        self.covariance[(place, place)] * n / (n - 2.0)
    }

    pub fn std_error(&self, place: usize) -> f64 {
        self.covariance[(place, place)].max(0.0).sqrt()
    }

    /// Difference from another unit's curve, whose errors are independent.
    pub fn minus(&self, other: &Curve) -> Curve {
        let parts = [self.covariance.trace(), other.covariance.trace()];
        Curve {
            values: &self.values - &other.values,
            covariance: &self.covariance + &other.covariance,
            degrees_of_freedom: satterthwaite([
                (parts[0], self.degrees_of_freedom),
                (parts[1], other.degrees_of_freedom),
            ]),
        }
    }

    /// Weighted mean of several curves; more certain ones weigh more. There is one weight per unit, so that
    /// the mean is a curve of the same kind.
    pub fn mean(curves: &[&Curve]) -> Option<Curve> {
        let unit = pooled(curves)?;
        let spread: Vec<f64> = curves.iter().map(|c| c.relative_variance(&unit)).collect();
        let total: f64 = spread.iter().map(|v| 1.0 / v).sum();
        let weights: Vec<f64> = spread.iter().map(|v| 1.0 / v / total).collect();
        let n = curves.first()?.len();
        let (mut values, mut covariance) = (DVector::zeros(n), DMatrix::zeros(n, n));
        for (curve, w) in curves.iter().zip(&weights) {
            values += &curve.values * *w;
            covariance += &curve.covariance * (w * w);
        }
        let parts = curves.iter().zip(&weights).zip(&spread);
        let parts = parts.map(|((c, w), v)| (w * w * v, c.degrees_of_freedom));
        Some(Curve { values, covariance, degrees_of_freedom: satterthwaite(parts) })
    }

    /// Mean over the places of the variance relative to the pooled one.
    fn relative_variance(&self, pooled: &[f64]) -> f64 {
        let n = self.len() as f64;
        let share = |(p, v): (usize, &f64)| self.covariance[(p, p)] / v;
        pooled.iter().enumerate().map(share).sum::<f64>() / n
    }
}

/// Degrees of freedom of a sum of estimated variances (Satterthwaite 1946).
fn satterthwaite(parts: impl IntoIterator<Item = (f64, f64)>) -> f64 {
    let (sum, squares) = parts
        .into_iter()
        .fold((0.0, 0.0), |(sum, squares), (v, dof)| (sum + v, squares + v * v / dof));
    sum * sum / squares
}

/// Mean variance of the units at each place; `None` if one is not positive.
fn pooled(curves: &[&Curve]) -> Option<Vec<f64>> {
    let n = curves.first()?.len();
    let k = curves.len() as f64;
    let at = |p: usize| curves.iter().map(|c| c.covariance[(p, p)]).sum::<f64>() / k;
    let all: Vec<f64> = (0..n).map(at).collect();
    all.iter().all(|v| v.is_finite() && *v > 0.0).then_some(all)
}

/// p-value of the hypothesis that all curves are the same; `None` where an error is unknown.
///
/// The statistic is the sum of the squared deviations from the unweighted mean, each relative to the pooled
/// error at its place. Its numerator is matched by its first two moments (Box 1954), and its denominator has
/// Satterthwaite's degrees of freedom. This is Brown and Forsythe's (1974) comparison of means under unequal
/// variances with Mehrotra's (1997) numerator, over several places at once. It needs no inverse of a
/// covariance, which has hardly as many free parameters as there are places.
pub fn same(curves: &[&Curve]) -> Option<f64> {
    let k = curves.len() as f64;
    if curves.len() < 2 {
        return None;
    }
    let scale = DVector::from_vec(pooled(curves)?.into_iter().map(|v| 1.0 / v.sqrt()).collect());
    let mean = curves.iter().map(|c| &c.values).sum::<DVector<f64>>() / k;
    let off = |c: &&Curve| (&c.values - &mean).component_mul(&scale).norm_squared();
    let found: f64 = curves.iter().map(off).sum();
    let whitened: Vec<DMatrix<f64>> = curves
        .iter()
        .map(|c| {
            DMatrix::from_fn(c.len(), c.len(), |i, j| c.covariance[(i, j)] * scale[i] * scale[j])
        })
        .collect();
    let own = 1.0 - 1.0 / k;
    let parts: Vec<f64> = whitened.iter().map(|v| own * v.trace()).collect();
    let expected: f64 = parts.iter().sum();
    let mut variance = 0.0;
    for (i, a) in whitened.iter().enumerate() {
        for (j, b) in whitened.iter().enumerate() {
            let centring = if i == j { own } else { -1.0 / k };
            // tr(A B) of symmetric matrices.
            variance += 2.0 * centring * centring * a.dot(b);
        }
    }
    let above = 2.0 * expected * expected / variance;
    let below =
        satterthwaite(parts.iter().zip(curves).map(|(part, c)| (*part, c.degrees_of_freedom)));
    let p = f_upper(found / expected, above, below);
    p.is_finite().then_some(p)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Seed;
    use crate::stats::{at_least, at_most};
    use nalgebra::Cholesky;
    use rand_distr::{ChiSquared, Distribution, StandardNormal};

    const PLACES: usize = 6;

    /// Strongly correlated, as for a form with few parameters.
    fn covariance() -> DMatrix<f64> {
        DMatrix::from_fn(PLACES, PLACES, |i, j| {
            let apart = i.abs_diff(j) as f64;
            (1.0 + i as f64) * (1.0 + j as f64) * (-0.2 * apart * apart).exp()
        }) + DMatrix::identity(PLACES, PLACES) * 1e-6
    }

    fn draw(units: usize, dof: f64, seed: u64) -> Vec<Curve> {
        let root = Cholesky::new(covariance()).expect("positive").l();
        let mut rng = Seed(seed).stream("curves");
        let chi_square = ChiSquared::new(dof).expect("positive");
        let mut one = || {
            let white = DVector::from_fn(PLACES, |_, _| StandardNormal.sample(&mut rng));
            let scale = chi_square.sample(&mut rng) / dof;
            let covariance = covariance() * scale;
            Curve { values: &root * white, covariance, degrees_of_freedom: dof }
        };
        (0..units).map(|_| one()).collect()
    }

    /// Number of runs in which curves of the same unit are called different at 1 %.
    fn alarms(units: usize, dof: f64, runs: usize) -> usize {
        let alarm = |seed: &usize| {
            let curves = draw(units, dof, *seed as u64);
            same(&curves.iter().collect::<Vec<_>>()).expect("comparable") < 0.01
        };
        (0..runs).filter(alarm).count()
    }

    /// False alarms at 1 % over 4,000 draws, from few degrees of freedom to exact errors. The moment matching
    /// is good to a factor of two in this tail, in both directions: the bounds are a binomial's at half and
    /// twice the level, with 1 in 1,000 on each side.
    #[test]
    fn unchanged_curves_raise_false_alarms_at_their_level() {
        for (units, dof) in [(2, 6.0), (2, 30.0), (5, 12.0), (10, 1e6)] {
            let k = alarms(units, dof, 4000);
            assert!(at_least(k, 4000, 0.02) > 1e-3, "{units} units, {dof}: {k} of 4000");
            assert!(at_most(k, 4000, 0.005) > 1e-3, "{units} units, {dof}: {k} of 4000");
        }
    }

    /// One place and many degrees of freedom: the square of the normal test.
    #[test]
    fn a_single_place_is_the_textbook_test() {
        let at = |value| Curve {
            values: DVector::from_element(1, value),
            covariance: DMatrix::from_element(1, 1, 2.0),
            degrees_of_freedom: 1e9,
        };
        let p = same(&[&at(0.0), &at(2.0 * 2.575_829)]).expect("comparable");
        assert!((p / 0.01 - 1.0).abs() < 1e-3, "{p}");
    }

    #[test]
    fn the_mean_leans_on_the_surer() {
        let mut curves = draw(2, 30.0, 1);
        curves[0].covariance = covariance();
        curves[1].covariance = covariance() * 3.0;
        let mean = Curve::mean(&[&curves[0], &curves[1]]).expect("a mean");
        let expected = &curves[0].values * 0.75 + &curves[1].values * 0.25;
        assert!((mean.values - expected).amax() < 1e-12);
        assert!((mean.covariance - covariance() * 0.75).amax() < 1e-9);
        assert!((30.0..=60.0).contains(&mean.degrees_of_freedom));
    }

    #[test]
    fn errors_that_are_not_known_give_no_probability() {
        let mut curves = draw(2, 30.0, 1);
        curves.iter_mut().for_each(|c| c.covariance[(2, 2)] = 0.0);
        assert_eq!(same(&[&curves[0], &curves[1]]), None);
        assert_eq!(same(&[&curves[0]]), None);
    }
}
