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

/// One view's data with its nuisances: what candidates are reduced against.
pub struct Rows {
    response: Vec<f64>,
    /// Inverse variance, in independent samples.
    weight: Vec<f64>,
    nuisance: DMatrix<f64>,
    /// Inverse of the nuisances' own normal equations, and their right-hand side.
    inverse: DMatrix<f64>,
    seen: DVector<f64>,
}

impl Rows {
    /// `nuisance` has a row a sample, and a precision that holds each of its coefficients to
    /// zero (0: free). `None` when the nuisances cannot be told apart.
    pub fn new(
        response: Vec<f64>,
        weight: Vec<f64>,
        nuisance: DMatrix<f64>,
        precision: &[f64],
    ) -> Option<Self> {
        let p = nuisance.ncols();
        let mut own = DMatrix::<f64>::from_diagonal(&DVector::from_column_slice(precision));
        let mut seen = DVector::<f64>::zeros(p);
        for (i, (&y, &w)) in response.iter().zip(&weight).enumerate() {
            for q in 0..p {
                let wx = w * nuisance[(i, q)];
                seen[q] += wx * y;
                for r in 0..=q {
                    own[(q, r)] += wx * nuisance[(i, r)];
                }
            }
        }
        own.fill_upper_triangle_with_lower_triangle();
        Some(Rows { response, weight, nuisance, inverse: own.try_inverse()?, seen })
    }

    /// The nuisances' own least squares fit.
    pub fn nuisances(&self) -> [f64; 3] {
        let beta = &self.inverse * &self.seen;
        std::array::from_fn(|q| beta.get(q).copied().unwrap_or(0.0))
    }

    /// Profile the nuisances out. `columns` fills one row of the candidate's columns.
    pub fn reduce(&self, count: usize, mut columns: impl FnMut(usize, &mut [f64])) -> Evidence {
        let p = self.seen.len();
        let mut g = vec![0.0; count];
        let mut a = DMatrix::<f64>::zeros(count, count);
        let mut b = DVector::<f64>::zeros(count);
        let mut cross = DMatrix::<f64>::zeros(p, count);
        for (i, (&y, &w)) in self.response.iter().zip(&self.weight).enumerate() {
            if w <= 0.0 {
                continue;
            }
            columns(i, &mut g);
            for j in 0..count {
                // Curves touch two of their many columns.
                if g[j] == 0.0 {
                    continue;
                }
                let wg = w * g[j];
                b[j] += wg * y;
                for k in 0..=j {
                    a[(j, k)] += wg * g[k];
                }
                for q in 0..p {
                    cross[(q, j)] += wg * self.nuisance[(i, q)];
                }
            }
        }
        a.fill_upper_triangle_with_lower_triangle();
        let project = cross.transpose() * &self.inverse;
        a -= &project * &cross;
        b -= &project * &self.seen;
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

/// What noise alone may bring for a candidate: b ~ N(0, A) in every view.
///
/// Worked in the eigenvectors of the summed A, in which the views' own A are taken as diagonal:
/// exact when the views' A are multiples of one another, and a thousand times quicker.
pub struct Null {
    /// Information of each view on each eigenvector.
    by_view: Vec<Vec<f64>>,
    total: Vec<f64>,
    prior: f64,
}

impl Null {
    pub fn of(views: &[Evidence], prior: f64) -> Option<Self> {
        let k = views.first()?.b.len();
        let sum = views.iter().fold(DMatrix::zeros(k, k), |sum, v| sum + &v.a);
        let u = sum.symmetric_eigen().eigenvectors;
        let by_view: Vec<Vec<f64>> = views
            .iter()
            .map(|v| {
                let au = &v.a * &u;
                (0..k).map(|j| u.column(j).dot(&au.column(j)).max(0.0)).collect()
            })
            .collect();
        let total = (0..k).map(|j| by_view.iter().map(|a| a[j]).sum()).collect();
        Some(Null { by_view, total, prior })
    }

    /// The gain of one recording of nothing but noise, nats.
    pub fn draw(&self, rng: &mut Stream) -> f64 {
        let mut gain = 0.0;
        let mut b = vec![0.0; self.by_view.len()];
        for (j, &total) in self.total.iter().enumerate() {
            let mut sum = 0.0;
            for (b, a) in b.iter_mut().zip(&self.by_view) {
                let draw: f64 = StandardNormal.sample(rng);
                *b = a[j].sqrt() * draw;
                sum += *b;
            }
            for (b, a) in b.iter().zip(&self.by_view) {
                let beta = (sum - b) / (total - a[j] + self.prior);
                gain += beta * (b - 0.5 * beta * a[j]);
            }
        }
        gain
    }
}
