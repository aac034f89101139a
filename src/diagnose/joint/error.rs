//! Covariance of the joint posterior, in a few factors.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::fit::Joint;
use super::terms::{Settled, System};
use crate::camera::Camera;
use crate::diagnose::checks::replication::spans;
use crate::model::Covariance;
use crate::rng::Seed;
use crate::solve::Cholesky;
use crate::terms::Pixels;

/// Share of the variance, pixel by pixel, that the factors must hold. The rest is independent per node.
const HELD: f64 = 0.98;
const MAX_FACTORS: usize = 40;
/// Spacing of the pixels at which the variance is evaluated, at three distances.
const STRIDE: usize = 8;
/// Weight of the prior precision in the metric, for what no pixel shows.
const SLIGHT: f64 = 1e-6;
/// P-value above which a term loses its name. Of 111 right names of two trials the largest was .03, in
/// halves of a real Kinect's views .10; of two wrong ones, a bent target and a bowl beside larger
/// errors without a name, .35 and .89.
const DISAGREED: f64 = 0.2;
/// Rounds of the randomised subspace iteration, and its oversampling (Halko, Martinsson and Tropp
/// 2011).
const ROUNDS: usize = 4;
const SPARE: usize = 8;

impl Joint<'_> {
    /// Covariance of the coefficients of [`Joint::chosen`], approximated for frontal planes of these disparities, px, and depths, m.
    /// `left` are the scores that the fit leaves in each view: views scatter beyond their noise, and
    /// the posterior is as much wider.
    pub fn error(
        &self,
        s: &Settled,
        kept: &[usize],
        precision: &DVector<f64>,
        left: &[DVector<f64>],
        planes: (&Camera, [[f64; 2]; 3]),
    ) -> Option<Covariance> {
        let System { columns: places, held } = self.system(s, kept, precision);
        let n = places.len();
        let information = DMatrix::from_fn(n, n, |i, j| self.all.a[(places[i], places[j])]);
        let inverse = Cholesky::of(&information + held)?.inverse();
        let mine = |e: &DVector<f64>| DVector::from_fn(n, |i, _| e[places[i]]);
        let scatter: f64 = left.iter().map(|e| mine(e).dot(&(&inverse * mine(e)))).sum();
        let free = inverse.component_mul(&information).sum();
        let covariance = inverse * (scatter / free.max(1.0)).max(1.0);
        let seen = self.seen(&places, planes);
        // This metric weights every pixel alike, whatever its variance.
        let mut metric = DMatrix::zeros(n, n);
        for (row, variance) in seen.iter().zip(variances(&seen, &covariance)) {
            row.add_square(1.0 / variance, &mut metric);
        }
        for i in 0..n {
            let usual = kept.get(i).map_or(1.0, |&k| self.columns.precision[k]);
            metric[(i, i)] += SLIGHT * seen.len() as f64 * usual;
        }
        let root = Cholesky::of(metric)?.l();
        let back = root.transpose();
        let sizes = &back * &covariance * &root;
        let factors: Vec<DVector<f64>> = leading(&sizes)
            .into_iter()
            .map(|f| back.solve_upper_triangular(&f))
            .collect::<Option<_>>()?;
        let told = together(&factors, n);
        let own = rest(&seen, &(covariance - told), kept.len(), (n - kept.len()) / 2);
        let all = |of: &dyn Fn(usize) -> f64| {
            let mut all = DVector::zeros(self.all.b.len());
            places.iter().enumerate().for_each(|(i, &k)| all[k] = of(i));
            all
        };
        Some(Covariance {
            factors: factors.iter().map(|f| self.reported(s, &all(&|i| f[i]))).collect(),
            variances: self.laid_out(s, &all(&|i| own[i]), |_, _| [0.0; 3]),
            ..Covariance::default()
        })
    }

    /// Terms not significantly different from zero, given the scatter of the views.
    pub fn disagreed(&self, s: &Settled, beta: &DVector<f64>, errors: &DMatrix<f64>) -> Vec<usize> {
        let counts: Vec<usize> = s.terms.iter().map(|&t| self.columns.bases[t].count()).collect();
        let is_nothing = |(t, own): (usize, Range<usize>)| {
            let n = own.len();
            let errors = errors.view((own.start, own.start), (n, n)).into_owned();
            let mine = beta.rows(self.columns.span(t).start, n).into_owned();
            chance_of(&mine, errors).is_some_and(|p| p > DISAGREED).then_some(t)
        };
        s.terms.iter().copied().zip(spans(&counts)).filter_map(is_nothing).collect()
    }

    /// The columns at pixels of frontal planes.
    fn seen(&self, places: &[usize], (camera, planes): (&Camera, [[f64; 2]; 3])) -> Vec<DesignRow> {
        let rays = camera.rays();
        let pixels = Pixels::new(camera, &rays, 1.0);
        let lines = |plane| {
            let rows = (STRIDE / 2..camera.height).into_par_iter().step_by(STRIDE);
            rows.map(move |v| (plane, v))
        };
        let of_line = |([disparity, z], v): ([f64; 2], usize)| {
            let mut row = vec![0.0; self.all.b.len()];
            let mut seen = Vec::new();
            for u in (STRIDE / 2..camera.width).step_by(STRIDE) {
                let mut place = pixels.place(v * camera.width + u);
                (place.disparity, place.z, place.rho) = (disparity, z, z);
                self.columns.fill(&place, &mut row);
                let columns = places.iter().map(|&k| row[k]).enumerate();
                seen.push(DesignRow(columns.filter(|(_, g)| *g != 0.0).collect()));
            }
            seen
        };
        planes.into_par_iter().flat_map(lines).flat_map_iter(of_line).collect()
    }
}

/// Nonzero columns at a pixel.
struct DesignRow(Vec<(usize, f64)>);

impl DesignRow {
    fn variance(&self, covariance: &DMatrix<f64>) -> f64 {
        let row = |&(i, g): &(usize, f64)| -> f64 {
            g * self.0.iter().map(|&(j, h)| h * covariance[(i, j)]).sum::<f64>()
        };
        self.0.iter().map(row).sum::<f64>().max(f64::MIN_POSITIVE)
    }

    fn add_square(&self, weight: f64, sum: &mut DMatrix<f64>) {
        for &(i, g) in &self.0 {
            self.0.iter().for_each(|&(j, h)| sum[(i, j)] += weight * g * h);
        }
    }
}

/// Variance of each row's value.
fn variances(rows: &[DesignRow], covariance: &DMatrix<f64>) -> Vec<f64> {
    rows.par_iter().map(|row| row.variance(covariance)).collect()
}

/// Variances of the first map's nodes that reproduce the variance left at each pixel, with neighbours
/// independent.
fn rest(seen: &[DesignRow], left: &DMatrix<f64>, first: usize, nodes: usize) -> Vec<f64> {
    let mut sums = vec![(0.0, 0.0); left.nrows()];
    for (place, variance) in seen.iter().zip(variances(seen, left)) {
        let mine = || place.0.iter().filter(|(i, _)| (first..first + nodes).contains(i));
        let squares: f64 = mine().map(|(_, g)| g * g).sum();
        let variance = variance / squares.max(f64::MIN_POSITIVE);
        for &(i, g) in mine() {
            sums[i] = (sums[i].0 + g * g * variance, sums[i].1 + g * g);
        }
    }
    sums.iter().map(|(sum, n)| if *n > 0.0 { sum / n } else { 0.0 }).collect()
}

/// Leading eigenvectors of a covariance, each times the root of its eigenvalue.
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

/// Covariance that factors of `n` coefficients represent.
fn together(factors: &[DVector<f64>], n: usize) -> DMatrix<f64> {
    factors.iter().fold(DMatrix::zeros(n, n), |sum, f| sum + f * f.transpose())
}

/// Covariance where the views' scores scatter `dispersion` times more than their information, enlarged to the
/// variances with the views as the sample, where these are larger (White 1980; Liang and Zeger 1986). `inverse`
/// is that of the information and the prior.
pub fn clustered(inverse: &DMatrix<f64>, dispersion: f64, beyond: &[DVector<f64>]) -> DMatrix<f64> {
    let n = beyond.len() as f64;
    let mut square = DMatrix::zeros(inverse.nrows(), inverse.nrows());
    for e in beyond {
        let moved = inverse * e;
        square.ger(n / (n - 1.0).max(1.0), &moved, &moved, 1.0);
    }
    let posterior = inverse * dispersion;
    let larger = |i: usize| (square[(i, i)] / posterior[(i, i)]).max(1.0).sqrt();
    DMatrix::from_fn(inverse.nrows(), inverse.nrows(), |i, j| {
        posterior[(i, j)] * larger(i) * larger(j)
    })
}

/// Chance of such coefficients where all are zero (Wald 1943).
fn chance_of(coefficients: &DVector<f64>, covariance: DMatrix<f64>) -> Option<f64> {
    let square = coefficients.dot(&covariance.cholesky()?.solve(coefficients));
    Some(ChiSquared::new(coefficients.len() as f64).ok()?.sf(square))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One in ten normal draws with the stated covariance has a chance below a tenth.
    #[test]
    fn the_chance_of_nothing_is_uniform() {
        let mut rng = Seed(9).stream("wald");
        let root = DMatrix::from_row_slice(3, 3, &[2.0, 0.0, 0.0, 0.7, 0.1, 0.0, -1.0, 0.3, 5.0]);
        let covariance = &root * root.transpose();
        let mut drawn = || &root * DVector::from_fn(3, |_, _| StandardNormal.sample(&mut rng));
        let below = (0..2000).filter(|_| chance_of(&drawn(), covariance.clone()).unwrap() < 0.1);
        let below = below.count();
        assert!((160..=240).contains(&below), "{below} of 2000");
        assert_eq!(chance_of(&DVector::zeros(3), DMatrix::zeros(3, 3)), None);
    }

    /// A covariance of few directions is recovered whole; one of many, its largest part.
    #[test]
    fn factors_make_the_covariance_again() {
        let n = 90;
        let columns = DMatrix::from_fn(n, 5, |i, k| ((k + 1) as f64 * i as f64 * 0.21).sin());
        let few = &columns * columns.transpose();
        let made = together(&leading(&few), n);
        assert!((&made - &few).norm() < 0.15 * few.norm(), "{}", (&made - &few).norm());
        assert!((made.trace() / few.trace() - 1.0).abs() < 1.0 - HELD + 1e-9);
        let none = leading(&DMatrix::identity(3, 3));
        assert_eq!(none.len(), 3);
        // No term is left.
        assert_eq!(together(&leading(&DMatrix::zeros(0, 0)), 0).shape(), (0, 0));
    }
}
