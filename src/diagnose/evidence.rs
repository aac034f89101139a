//! How much better the held-out views are predicted with a candidate term than without.
//!
//! A view's evidence is quadratic in the coefficients: with its nuisances (the plane, or the
//! view's own level) profiled out, log p(view | beta) = beta' b - beta' A beta / 2 + const. The
//! search then needs only A and b of every view, and so does the simulation of its null.

use nalgebra::{DMatrix, DVector};
use rand_distr::{Distribution, StandardNormal};

use crate::rng::Stream;

/// A view's normal equations on a candidate's columns, in nats.
#[derive(Debug, Clone)]
pub struct Evidence {
    pub a: DMatrix<f64>,
    pub b: DVector<f64>,
}

/// What a candidate brings on views it was not fitted to.
#[derive(Debug, Clone)]
pub struct Gain {
    /// Nats, all views.
    pub total: f64,
    /// Nats, view by view.
    pub by_view: Vec<f64>,
    /// Fit to all views.
    pub beta: DVector<f64>,
    /// Covariance of `beta`.
    pub covariance: DMatrix<f64>,
}

/// Weighted rows of one view, to be reduced to an [`Evidence`].
pub struct Rows<'a> {
    /// Nuisance columns, row by row.
    pub nuisance: &'a [Vec<f64>],
    /// Response and weight (inverse variance, in independent samples).
    pub response: &'a [f64],
    pub weight: &'a [f64],
}

impl Rows<'_> {
    /// Profile the nuisances out and reduce. `columns` fills one row of the candidate's columns.
    pub fn reduce(&self, count: usize, mut columns: impl FnMut(usize, &mut [f64])) -> Evidence {
        let p = self.nuisance.first().map_or(0, Vec::len);
        let mut g = vec![0.0; count];
        let mut a = DMatrix::<f64>::zeros(count, count);
        let mut b = DVector::<f64>::zeros(count);
        let mut cross = DMatrix::<f64>::zeros(p, count);
        let mut own = DMatrix::<f64>::zeros(p, p);
        let mut seen = DVector::<f64>::zeros(p);
        for (i, (&y, &w)) in self.response.iter().zip(self.weight).enumerate() {
            if w <= 0.0 {
                continue;
            }
            columns(i, &mut g);
            let x = &self.nuisance[i];
            for j in 0..count {
                let wg = w * g[j];
                b[j] += wg * y;
                for k in 0..=j {
                    a[(j, k)] += wg * g[k];
                }
                for (q, &xq) in x.iter().enumerate() {
                    cross[(q, j)] += wg * xq;
                }
            }
            for q in 0..p {
                seen[q] += w * x[q] * y;
                for r in 0..=q {
                    own[(q, r)] += w * x[q] * x[r];
                }
            }
        }
        own.fill_upper_triangle_with_lower_triangle();
        a.fill_upper_triangle_with_lower_triangle();
        if let Some(inverse) = own.try_inverse() {
            let project = cross.transpose() * inverse;
            a -= &project * &cross;
            b -= &project * &seen;
        }
        Evidence { a, b }
    }
}

/// Gain of a candidate over none, each view predicted from a fit to the others. `prior` is the
/// precision that holds a coefficient nothing is known about.
pub fn gain(views: &[Evidence], prior: f64) -> Option<Gain> {
    let k = views.first()?.b.len();
    let ridge = DMatrix::identity(k, k) * prior;
    let mut a = ridge.clone();
    let mut b = DVector::zeros(k);
    for v in views {
        a += &v.a;
        b += &v.b;
    }
    let by_view: Vec<f64> = views
        .iter()
        .map(|v| {
            let beta = (&a - &v.a).cholesky()?.solve(&(&b - &v.b));
            Some(beta.dot(&v.b) - 0.5 * beta.dot(&(&v.a * &beta)))
        })
        .collect::<Option<_>>()?;
    let whole = a.cholesky()?;
    Some(Gain {
        total: by_view.iter().sum(),
        by_view,
        beta: whole.solve(&b),
        covariance: whole.inverse(),
    })
}

/// The same views with nothing in them but noise: b ~ N(0, A).
pub fn null(views: &[Evidence], rng: &mut Stream) -> Vec<Evidence> {
    views
        .iter()
        .map(|v| {
            let k = v.b.len();
            let draw = DVector::from_fn(k, |_, _| StandardNormal.sample(rng));
            let eigen = v.a.clone().symmetric_eigen();
            let root = eigen.eigenvalues.map(|e| e.max(0.0).sqrt());
            let b = &eigen.eigenvectors * draw.component_mul(&root);
            Evidence { a: v.a.clone(), b }
        })
        .collect()
}
