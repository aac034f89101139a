//! How sure the joint posterior is: its covariance in a few factors.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rand_distr::{Distribution, StandardNormal};

use super::joint_fit::Joint;
use super::joint_terms::Settled;
use crate::camera::Camera;
use crate::rng::Seed;

/// Factors are taken until they hold this share of the variance: of the maps' mean over the picture,
/// px^2, and of the terms' coefficients in units of what is usual.
const HELD: f64 = 0.98;
const MAX_FACTORS: usize = 48;
/// Rounds of the subspace iteration; its start has so many directions to spare (Halko, Martinsson
/// and Tropp 2011).
const ROUNDS: usize = 4;
const SPARE: usize = 8;

impl Joint<'_> {
    /// The covariance of all columns' coefficients, as the sum of the outer products of these. `left`
    /// is what each view says beyond the fit: views scatter beyond their noise, and the posterior is
    /// as much wider.
    pub fn error(
        &self,
        s: &Settled,
        kept: &[usize],
        precision: &DVector<f64>,
        left: &[DVector<f64>],
        camera: &Camera,
    ) -> Option<Vec<DVector<f64>>> {
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
        // With the root of this metric a covariance is one of sizes: a map's nodes are held against
        // what they make of the picture, for neighbours make up for each other.
        let mut root = DMatrix::zeros(n, n);
        for (i, &k) in kept.iter().enumerate() {
            root[(i, i)] = self.precision[k].sqrt();
        }
        if nodes > 0 {
            let one = Cholesky::<f64, Dyn>::new(self.columns.map_metric(camera))?.l();
            for first in [kept.len(), kept.len() + nodes / 2] {
                root.view_mut((first, first), one.shape()).copy_from(&one);
            }
        }
        let sizes = root.transpose() * &inverse * &root;
        let back = root.transpose();
        let spread = |f: DVector<f64>| {
            let mine = back.solve_upper_triangular(&f)?;
            let mut all = DVector::zeros(self.all.b.len());
            for (i, &k) in places.iter().enumerate() {
                all[k] = dispersion.sqrt() * mine[i];
            }
            Some(all)
        };
        leading(&sizes).into_iter().map(spread).collect()
    }
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
