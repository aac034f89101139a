//! Replication: whether two halves of the views, each alone, show the same.
//!
//! The views are split once, balanced in distance and tilt. A finding replicates where both halves have the
//! shape of the fit to all views with the same sign and with sizes that agree within their joint 95 %
//! interval, and where one half alone detects the shape that the other half gave.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use crate::diagnose::noise::view_mean::ViewMean;
use crate::diagnose::search::evidence::Evidence;
use crate::solve::Cholesky;
use crate::stats::student_quantile;

/// Standard errors from which a half detects something by itself.
const SEEN: f64 = 2.0;
/// Ridge on a half's own shape, as a share of the information of all views: a half tells nothing of what it
/// knows less well.
const MIN_KNOWN: f64 = 0.1;
/// Two-sided coverage.
const INTERVAL: f64 = 0.95;
/// Views per group of neighbouring distances; the group is split by tilt.
const NEIGHBOURS: usize = 4;

/// Half of each view, by its distance and tilt; `true` is the second.
pub fn halves(poses: &[(f64, f64)]) -> Vec<bool> {
    let mut order: Vec<usize> = (0..poses.len()).collect();
    order.sort_by(|&a, &b| poses[a].0.total_cmp(&poses[b].0));
    let mut second = vec![false; poses.len()];
    for (k, near) in order.chunks_mut(NEIGHBOURS).enumerate() {
        near.sort_by(|&a, &b| poses[a].1.total_cmp(&poses[b].1));
        for (place, &view) in near.iter().enumerate() {
            // The outer two of four against the inner two, in turn: tilts balance within the group.
            second[view] = matches!(place, 1 | 2) != (k % 2 == 1);
        }
    }
    second
}

impl ViewMean {
    fn z(&self) -> f64 {
        self.value / self.std_error
    }
}

/// Whether the signs are the same, and the sizes inside their joint interval.
fn alike(halves: &[ViewMean; 2]) -> bool {
    let [a, b] = halves;
    let freedom = (a.views.round() + b.views.round() - 2.0).max(1.0);
    let reach = student_quantile(INTERVAL, freedom);
    let apart = (a.value - b.value).abs();
    a.value * b.value > 0.0 && apart <= reach * a.std_error.hypot(b.std_error)
}

/// Whether two sizes of one statistic agree, one being significant. `None` where a half has too few views.
pub fn agree(halves: [Option<ViewMean>; 2]) -> Option<bool> {
    let [Some(a), Some(b)] = halves else { return None };
    Some(alike(&[a, b]) && a.z().abs().max(b.z().abs()) > SEEN)
}

/// All terms of a layer, fitted together in each half.
pub struct Halves {
    /// Information of all views.
    pub metric: DMatrix<f64>,
    pub whole: DVector<f64>,
    pub halves: [Half; 2],
    /// Columns of each chosen term.
    pub spans: Vec<Range<usize>>,
}

/// Column ranges of consecutive terms, given their numbers of columns.
pub fn spans(counts: &[usize]) -> Vec<Range<usize>> {
    let mut first = 0;
    let span = |&count: &usize| {
        first += count;
        first - count..first
    };
    counts.iter().map(span).collect()
}

/// Fit to one half.
pub struct Half {
    pub beta: DVector<f64>,
    /// Information plus the precision of the priors.
    pub precision: DMatrix<f64>,
    /// Cholesky factor.
    pub factor: Cholesky,
    /// Score of every view beyond that fit.
    pub beyond: Vec<DVector<f64>>,
}

impl Half {
    /// Solves for a `score` with this precision; `beyond` gives the views' scores beyond the fit.
    pub fn of(
        precision: DMatrix<f64>,
        score: &DVector<f64>,
        beyond: impl FnOnce(&DVector<f64>) -> Vec<DVector<f64>>,
    ) -> Option<Self> {
        let factor = Cholesky::of(precision.clone())?;
        let beta = factor.solve(score);
        Some(Half { beyond: beyond(&beta), beta, precision, factor })
    }

    /// Weighted sum of the coefficients. Its error is that of the views' scatter where this is larger.
    fn measured(&self, weights: &DVector<f64>) -> Option<ViewMean> {
        let n = self.beyond.len() as f64;
        let reach = self.factor.solve(weights);
        let scatter: f64 = self.beyond.iter().map(|s| reach.dot(s).powi(2)).sum();
        let variance = (scatter * n / (n - 1.0)).max(reach.dot(weights));
        let value = weights.dot(&self.beta);
        (n > 1.0).then_some(ViewMean::new(value, variance.sqrt(), n))
    }
}

impl Halves {
    /// Fits both halves to the views' evidence on all terms; `counts` are the terms' columns.
    pub fn of(views: &[Evidence], second: &[bool], prior: f64, counts: &[usize]) -> Option<Self> {
        let n = views.first()?.b.len();
        if views.len() != second.len() || !second.contains(&true) {
            return None;
        }
        let held = DMatrix::identity(n, n) * prior;
        let sum = |which: Option<bool>| {
            let mine = views.iter().zip(second).filter(|(_, s)| which.is_none_or(|w| w == **s));
            Evidence::sum(n, 0.0, mine.map(|(view, _)| view))
        };
        let fit = |which| {
            let Evidence { a, b } = sum(Some(which));
            let mine = views.iter().zip(second).filter(|(_, s)| **s == which);
            Half::of(a + &held, &b, |beta| mine.map(|(view, _)| &view.b - &view.a * beta).collect())
        };
        let Evidence { a: metric, b } = sum(None);
        let whole = Cholesky::of(&metric + &held)?.solve(&b);
        let halves = [fit(false)?, fit(true)?];
        Some(Halves { metric, whole, halves, spans: spans(counts) })
    }

    /// Whether both halves have these terms, taken as one shape. No formula is exact: each half may be off by
    /// `formula_error` of its size beside its own error. `None` where the terms have no columns of their own,
    /// or a half has too few views.
    pub fn replicate(&self, terms: &[usize], formula_error: f64) -> Option<bool> {
        Some(self.shown(terms)?.replicates(formula_error))
    }

    /// Same for nameless curves, which are what the other terms leave: those are held at the fit to all
    /// views.
    pub fn replicate_beside(&self, terms: &[usize]) -> Option<bool> {
        Some(self.shown_beside(terms)?.replicates(0.0))
    }

    /// Whether, with the other terms held, neither half shows what the other has or their signs are opposite.
    /// Sizes that differ are no contradiction: a twentieth of true ones lie outside their interval, and
    /// sensors warm up.
    pub fn contradict(&self, terms: &[usize]) -> bool {
        let opposite = |sizes: &[ViewMean; 2]| sizes[0].value * sizes[1].value <= 0.0;
        self.shown_beside(terms).is_some_and(|s| opposite(&s.sizes) || s.seen() <= SEEN)
    }

    /// Sizes in each half with all other terms held at the fit to all views. Otherwise the halves would split
    /// nearly collinear terms, and nodes that they hardly see, each in its own way. A half's own shape is
    /// shrunk to what it knows.
    fn shown_beside(&self, terms: &[usize]) -> Option<Shown> {
        let columns = self.columns(terms);
        let of = |v: &DVector<f64>| DVector::from_fn(columns.len(), |i, _| v[columns[i]]);
        let block = |m: &DMatrix<f64>| {
            DMatrix::from_fn(columns.len(), columns.len(), |i, k| m[(columns[i], columns[k])])
        };
        let hardly_known = MIN_KNOWN * block(&self.metric);
        let alone = |half: &Half| {
            let mut left = &half.beta - &self.whole;
            columns.iter().for_each(|&c| left[c] = half.beta[c]);
            let (score, precision) = (of(&(&half.precision * left)), block(&half.precision));
            let shape = (&precision + &hardly_known).cholesky()?.solve(&score);
            let beyond: Vec<DVector<f64>> = half.beyond.iter().map(of).collect();
            Some((score, precision, beyond, shape))
        };
        let halves = [alone(&self.halves[0])?, alone(&self.halves[1])?];
        let measured = |k: usize, shape: &DVector<f64>| {
            let (score, precision, beyond, _) = &halves[k];
            let (n, square) = (beyond.len() as f64, shape.dot(&(precision * shape)));
            let scatter: f64 = beyond.iter().map(|s| s.dot(shape).powi(2)).sum();
            let std_error = (scatter * n / (n - 1.0)).max(square).sqrt() / square;
            let value = score.dot(shape) / square;
            (n > 1.0 && square > 0.0).then_some(ViewMean::new(value, std_error, n))
        };
        let common = of(&self.whole);
        Some(Shown {
            sizes: [measured(0, &common)?, measured(1, &common)?],
            others: [measured(0, &halves[1].3)?, measured(1, &halves[0].3)?],
        })
    }

    fn columns(&self, terms: &[usize]) -> Vec<usize> {
        terms.iter().filter_map(|&t| self.spans.get(t).cloned()).flatten().collect()
    }

    fn shown(&self, terms: &[usize]) -> Option<Shown> {
        let columns = self.columns(terms);
        if columns.is_empty() {
            return None;
        }
        // Weights for the size of a fit along a shape, the shape itself being one.
        let along = |shape: &DVector<f64>| {
            let mut own = DVector::zeros(shape.len());
            columns.iter().for_each(|&c| own[c] = shape[c]);
            let weights = &self.metric * &own;
            let mut mine = DVector::zeros(shape.len());
            columns.iter().for_each(|&c| mine[c] = weights[c]);
            let square = mine.dot(&own);
            mine / square
        };
        let [first, second] = &self.halves;
        let common = along(&self.whole);
        Some(Shown {
            sizes: [first.measured(&common)?, second.measured(&common)?],
            others: [first.measured(&along(&second.beta))?, second.measured(&along(&first.beta))?],
        })
    }
}

/// Sizes of a shape in the two halves.
struct Shown {
    /// Each half's size of the common shape.
    sizes: [ViewMean; 2],
    /// Of the other half's shape.
    others: [ViewMean; 2],
}

impl Shown {
    /// Significance of the other half's shape in the half that shows it better, in standard errors.
    fn seen(&self) -> f64 {
        self.others[0].z().max(self.others[1].z())
    }

    fn replicates(mut self, formula_error: f64) -> bool {
        for size in &mut self.sizes {
            size.std_error = size.std_error.hypot(formula_error * size.value);
        }
        alike(&self.sizes) && self.seen() > SEEN
    }
}

#[cfg(test)]
#[path = "replication_tests.rs"]
mod tests;
