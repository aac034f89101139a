//! The fit with its weights held fixed: working coordinates, residuals, Jacobian, one solver run.

use nalgebra::{DMatrix, DVector};

use super::forms::{MAX_PARAMETERS, SigmaForm, Walk};
use super::rows::Rows;
use crate::solve::{LeastSquares, trust_region};

/// The local problem: fixed weights, scaled working coordinates of the free parameters.
struct Local<'a> {
    rows: &'a Rows,
    spec: &'a dyn SigmaForm,
    base: &'a [f64],
    free: &'a [usize],
    /// Working coordinate = scale * (walked parameter): columns of J then have unit length.
    scale: Vec<f64>,
    target: DVector<f64>,
}

impl Local<'_> {
    fn walk(&self, i: usize) -> Walk {
        self.spec.parameters()[i].1
    }

    fn to_working(&self, p: &[f64]) -> DVector<f64> {
        DVector::from_iterator(
            self.free.len(),
            self.free.iter().zip(&self.scale).map(|(&i, s)| {
                s * match self.walk(i) {
                    Walk::Linear => p[i],
                    Walk::Log => p[i].max(f64::MIN_POSITIVE).ln(),
                    Walk::LogAboveTheta => (p[i] - self.rows.steepest()).max(1e-9).ln(),
                }
            }),
        )
    }

    fn parameters(&self, x: &DVector<f64>) -> Vec<f64> {
        let mut p = self.base.to_vec();
        for ((&i, s), x) in self.free.iter().zip(&self.scale).zip(x.iter()) {
            p[i] = match self.walk(i) {
                Walk::Linear => x / s,
                Walk::Log => (x / s).exp(),
                Walk::LogAboveTheta => self.rows.steepest() + (x / s).exp(),
            };
        }
        p
    }

    /// d(parameter)/d(working coordinate), without the scale.
    fn slope(&self, p: &[f64], i: usize) -> f64 {
        match self.walk(i) {
            Walk::Linear => 1.0,
            Walk::Log => p[i],
            Walk::LogAboveTheta => p[i] - self.rows.steepest(),
        }
    }

    fn residual(&self, p: &[f64]) -> DVector<f64> {
        let mut sigma: Vec<f64> =
            self.rows.iter().map(|r| self.spec.sigma(p, r.z_m, r.theta_rad)).collect();
        self.rows.whiten(&mut sigma);
        DVector::from_vec(sigma) - &self.target
    }

    fn jacobian(&self, p: &[f64]) -> DMatrix<f64> {
        let mut j = natural_jacobian(self.rows, self.spec, p, self.free);
        for (column, (&i, s)) in self.free.iter().zip(&self.scale).enumerate() {
            let factor = self.slope(p, i) / s;
            j.column_mut(column).scale_mut(factor);
        }
        j
    }
}

impl LeastSquares for Local<'_> {
    fn linearise(&self, x: &DVector<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let p = self.parameters(x);
        let r = self.residual(&p);
        r.iter().all(|v| v.is_finite()).then(|| (r, self.jacobian(&p)))
    }

    fn cost(&self, x: &DVector<f64>) -> f64 {
        0.5 * self.residual(&self.parameters(x)).norm_squared()
    }
}

/// Whitened derivatives of sigma by the free parameters, a row a measurement.
pub(super) fn natural_jacobian(
    rows: &Rows,
    spec: &dyn SigmaForm,
    p: &[f64],
    free: &[usize],
) -> DMatrix<f64> {
    let n = rows.len();
    let mut j = DMatrix::zeros(n, free.len());
    let mut gradient = [0.0; MAX_PARAMETERS];
    for (i, r) in rows.iter().enumerate() {
        spec.gradient(p, r.z_m, r.theta_rad, &mut gradient);
        for (column, &k) in free.iter().enumerate() {
            j[(i, column)] = gradient[k];
        }
    }
    for column in 0..free.len() {
        rows.whiten(&mut j.as_mut_slice()[column * n..(column + 1) * n]);
    }
    j
}

const TRUST_REGION_STEPS: u64 = 4;

pub(super) fn polish(rows: &Rows, spec: &dyn SigmaForm, p: &[f64], free: &[usize]) -> Vec<f64> {
    if free.is_empty() {
        return p.to_vec();
    }
    let target = rows.whitened_sigmas();
    let mut local = Local { rows, spec, base: p, free, scale: vec![1.0; free.len()], target };
    let columns = local.jacobian(p);
    local.scale = columns.column_iter().map(|c| c.norm().max(1e-12)).collect();
    let start = local.to_working(p);
    match trust_region(&local, start, TRUST_REGION_STEPS) {
        Some(end) => local.parameters(&end.x),
        None => p.to_vec(),
    }
}
