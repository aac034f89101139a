//! How much better the held-out views are predicted with a candidate term than without.
//!
//! A view's evidence is quadratic in the coefficients: with its nuisances (the plane, or the
//! view's own level) profiled out, log p(view | beta) = beta' b - beta' A beta / 2 + const. The
//! search then needs only A and b of every view.

use std::borrow::Borrow;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::solve::Cholesky;

/// A view's normal equations on the columns under test, in nats: first the terms already chosen,
/// then the candidate.
#[derive(Debug, Clone)]
pub struct Evidence {
    pub a: DMatrix<f64>,
    pub b: DVector<f64>,
}

impl Evidence {
    /// Zero evidence on `n` columns.
    pub fn zeros(n: usize) -> Self {
        Evidence { a: DMatrix::zeros(n, n), b: DVector::zeros(n) }
    }

    /// Evidence on the first `n` columns only.
    pub fn first(&self, n: usize) -> Self {
        Evidence { a: self.a.view((0, 0), (n, n)).into_owned(), b: self.b.rows(0, n).into_owned() }
    }

    /// Keeps the first `n` columns only.
    pub fn truncate(&mut self, n: usize) {
        if n < self.b.len() {
            *self = self.first(n);
        }
    }

    /// Sum over these views, on `n` columns of prior precision `prior`.
    pub fn sum<E: Borrow<Self>>(n: usize, prior: f64, views: impl IntoIterator<Item = E>) -> Self {
        let held = Evidence { a: DMatrix::identity(n, n) * prior, b: DVector::zeros(n) };
        views.into_iter().fold(held, |mut sum, view| {
            sum.a += &view.borrow().a;
            sum.b += &view.borrow().b;
            sum
        })
    }
}

/// Gain of a set of terms on views they were not fitted to.
#[derive(Debug, Clone)]
pub struct Gain {
    /// Nats, all views.
    pub total: f64,
    /// Nats, view by view.
    pub by_view: Vec<f64>,
    /// Coefficients of the fit to all views.
    pub beta: DVector<f64>,
    /// Covariance of `beta`.
    pub covariance: DMatrix<f64>,
}

impl Gain {
    /// Subtracts the gain that `base`, a subset of the terms, brings on the same views.
    pub fn over(mut self, base: &Gain) -> Self {
        self.total -= base.total;
        self.by_view.iter_mut().zip(&base.by_view).for_each(|(g, b)| *g -= b);
        self
    }
}

/// Coefficients of a fit to all views.
pub fn fit(views: &[Evidence], prior: f64) -> Option<DVector<f64>> {
    let Evidence { a, b } = Evidence::sum(views.first()?.b.len(), prior, views);
    Some(Cholesky::of(a)?.solve(&b))
}

/// Square root R of `a`, R Rᵀ = `a`: R times white noise is distributed as a score of information `a`.
pub fn root(a: &DMatrix<f64>) -> DMatrix<f64> {
    let eigen = a.clone().symmetric_eigen();
    let roots = eigen.eigenvalues.map(|v| v.max(0.0).sqrt());
    &eigen.eigenvectors * DMatrix::from_diagonal(&roots)
}

/// Minimum views per parallel task; small systems are not worth more threads.
const VIEWS_AT_ONCE: usize = 4;

/// Gain over no term at all, each view predicted from a fit to the others. `prior` is the prior
/// precision of a coefficient.
pub fn gain(views: &[Evidence], prior: f64) -> Option<Gain> {
    let Evidence { a, b } = Evidence::sum(views.first()?.b.len(), prior, views);
    let by_view: Vec<f64> = views
        .par_iter()
        .with_min_len(VIEWS_AT_ONCE)
        .map(|v| {
            let beta = Cholesky::of(&a - &v.a)?.solve(&(&b - &v.b));
            Some(score(v, &beta))
        })
        .collect::<Option<_>>()?;
    let whole = Cholesky::of(a)?;
    let covariance = whole.inverse();
    Some(Gain { total: by_view.iter().sum(), by_view, beta: whole.solve(&b), covariance })
}

/// Log-likelihood of a view with the coefficients `beta` less that without any, nats.
pub fn score(view: &Evidence, beta: &DVector<f64>) -> f64 {
    beta.dot(&view.b) - 0.5 * beta.dot(&(&view.a * beta))
}

#[cfg(test)]
#[path = "evidence_tests.rs"]
pub mod tests;
