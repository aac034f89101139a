//! How sure the joint posterior is: its covariance in a few factors.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rand_distr::{Distribution, StandardNormal};

use super::joint_fit::Joint;
use super::joint_terms::Settled;
use crate::rng::Seed;

/// Factors are taken until they hold this share of the variance, in units of what is usual. The rest
/// is each coefficient's own.
const HELD: f64 = 0.98;
const MAX_FACTORS: usize = 24;
/// Rounds of the subspace iteration; its start has so many directions to spare (Halko, Martinsson
/// and Tropp 2011).
const ROUNDS: usize = 4;
const SPARE: usize = 8;

impl Joint<'_> {
    /// The covariance of all columns' coefficients. `left` is what each view says beyond the fit:
    /// views scatter beyond their noise, and the posterior is as much wider.
    pub fn error(
        &self,
        s: &Settled,
        kept: &[usize],
        precision: &DVector<f64>,
        left: &[DVector<f64>],
    ) -> Option<Error> {
        let terms = self.columns.terms;
        let nodes = if s.penalty.is_some() { self.columns.nodes } else { 0 };
        let places: Vec<usize> = kept.iter().copied().chain(terms..terms + nodes).collect();
        let n = places.len();
        let information = DMatrix::from_fn(n, n, |i, j| self.all.a[(places[i], places[j])]);
        let mut held = information.clone();
        for (i, &k) in kept.iter().enumerate() {
            held[(i, i)] += precision[k];
        }
        if let Some(penalty) = &s.penalty {
            let mut block = held.view_mut((kept.len(), kept.len()), (nodes, nodes));
            block += penalty;
        }
        let factor = Cholesky::<f64, Dyn>::new(held)?;
        let inverse = factor.inverse();
        let mine = |e: &DVector<f64>| DVector::from_fn(n, |i, _| e[places[i]]);
        let scatter: f64 = left.iter().map(|e| mine(e).dot(&(&inverse * mine(e)))).sum();
        let free = inverse.component_mul(&information).sum();
        let dispersion = (scatter / free.max(1.0)).max(1.0);
        // In units of what is usual, px for the maps, so that no column counts for its unit's sake.
        let usual =
            DVector::from_fn(n, |i, _| kept.get(i).map_or(1.0, |&k| self.precision[k].powf(-0.5)));
        let scaled = DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] / (usual[i] * usual[j]));
        let spread = |of: &dyn Fn(usize) -> f64| {
            let mut all = DVector::zeros(self.all.b.len());
            places.iter().enumerate().for_each(|(i, &k)| all[k] = of(i));
            all
        };
        let factors = leading(&scaled);
        let own = |i: usize| {
            let told: f64 = factors.iter().map(|f| f[i] * f[i]).sum();
            dispersion * usual[i].powi(2) * (scaled[(i, i)] - told).max(0.0)
        };
        let variances = spread(&own);
        let of = |f: &DVector<f64>| spread(&|i| dispersion.sqrt() * usual[i] * f[i]);
        Some(Error { factors: factors.iter().map(of).collect(), variances })
    }
}

/// A covariance: the sum of the factors' outer products, and variances of each coefficient's own.
pub struct Error {
    pub factors: Vec<DVector<f64>>,
    pub variances: DVector<f64>,
}

/// The largest eigenvectors of a covariance, each times the root of its eigenvalue.
fn leading(covariance: &DMatrix<f64>) -> Vec<DVector<f64>> {
    let n = covariance.nrows();
    if n == 0 {
        return Vec::new();
    }
    let mut rng = Seed(1).stream("diagnose/joint/error");
    let start =
        DMatrix::from_fn(n, n.min(MAX_FACTORS + SPARE), |_, _| StandardNormal.sample(&mut rng));
    let mut basis = start.qr().q();
    for _ in 0..ROUNDS {
        basis = (covariance * basis).qr().q();
    }
    let small = (basis.transpose() * (covariance * &basis)).symmetric_eigen();
    let mut order: Vec<usize> = (0..small.eigenvalues.len()).collect();
    order.sort_by(|&a, &b| small.eigenvalues[b].total_cmp(&small.eigenvalues[a]));
    let mut rest = covariance.trace();
    let enough = (1.0 - HELD) * rest;
    let mut factors = Vec::new();
    for k in order.into_iter().take(MAX_FACTORS) {
        let value = small.eigenvalues[k];
        if rest <= enough || value <= 0.0 {
            break;
        }
        rest -= value;
        factors.push(&basis * small.eigenvectors.column(k) * value.sqrt());
    }
    factors
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A covariance of few directions comes back whole; of many, its largest part.
    #[test]
    fn factors_make_the_covariance_again() {
        let n = 90;
        let columns = DMatrix::from_fn(n, 5, |i, k| ((k + 1) as f64 * i as f64 * 0.21).sin());
        let few = &columns * columns.transpose();
        let made = leading(&few).iter().map(|f| f * f.transpose()).sum::<DMatrix<f64>>();
        assert!((&made - &few).norm() < 0.15 * few.norm(), "{}", (&made - &few).norm());
        assert!((made.trace() / few.trace() - 1.0).abs() < 1.0 - HELD + 1e-9);
        let none = leading(&DMatrix::identity(3, 3));
        assert_eq!(none.len(), 3);
    }
}
