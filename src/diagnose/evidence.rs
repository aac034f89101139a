//! How much better the held-out views are predicted with a candidate term than without.
//!
//! A view's evidence is quadratic in the coefficients: with its nuisances (the plane, or the
//! view's own level) profiled out, log p(view | beta) = beta' b - beta' A beta / 2 + const. The
//! search then needs only A and b of every view, and so does the simulation of its null.

use std::borrow::Cow;

use nalgebra::{DMatrix, DVector};
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

use crate::rng::Stream;
use crate::solve::Cholesky;

/// A view's normal equations on the columns under test, in nats: first the terms already chosen,
/// then the candidate.
#[derive(Debug, Clone)]
pub struct Evidence {
    pub a: DMatrix<f64>,
    pub b: DVector<f64>,
}

/// What a set of terms brings on views they were not fitted to.
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

/// One view's data with what is fitted beside every candidate: its own nuisances, and the terms
/// already chosen.
pub struct Rows<'a> {
    /// Inverse variance, in independent samples.
    weight: Cow<'a, [f64]>,
    /// A row a sample: nuisances, then the chosen terms' columns, then the response.
    samples: Vec<f64>,
    nuisances: usize,
    /// Columns beside the candidate's.
    width: usize,
    /// Normal equations of what is beside, before anything is profiled out.
    own: DMatrix<f64>,
    seen: DVector<f64>,
    /// Inverse of the nuisances' own block.
    inverse: DMatrix<f64>,
}

impl<'a> Rows<'a> {
    /// `beside` is row-major with `width` columns, of which the first are the nuisances, one for
    /// each entry of `precision`, which holds them to zero (0: free). `None` when the nuisances
    /// cannot be told apart.
    pub fn new(
        response: &[f64],
        weight: &'a [f64],
        beside: &[f64],
        width: usize,
        precision: &[f64],
    ) -> Option<Self> {
        let mut samples = Vec::with_capacity(response.len() * (width + 1));
        for (row, y) in beside.chunks_exact(width).zip(response) {
            samples.extend_from_slice(row);
            samples.push(*y);
        }
        let squares = squares(&samples, weight, width + 1);
        let mut own = squares.view((0, 0), (width, width)).into_owned();
        let seen = squares.view((0, width), (width, 1)).column(0).into_owned();
        let p = precision.len();
        for (q, precision) in precision.iter().enumerate() {
            own[(q, q)] += precision;
        }
        let inverse = own.view((0, 0), (p, p)).into_owned().try_inverse()?;
        let weight = Cow::Borrowed(weight);
        Some(Rows { weight, samples, nuisances: p, width, own, seen, inverse })
    }

    /// Samples that share a key made one: exact for columns that depend on the key alone.
    pub fn grouped(&self, keys: usize, key: impl Fn(usize) -> usize) -> Self {
        let n = self.width + 1;
        let mut weight = vec![0.0; keys];
        let mut samples = vec![0.0; keys * n];
        for (i, (row, &w)) in self.samples.chunks_exact(n).zip(&*self.weight).enumerate() {
            let k = key(i);
            weight[k] += w;
            samples[k * n..][..n].iter_mut().zip(row).for_each(|(sum, x)| *sum += w * x);
        }
        for (row, w) in samples.chunks_exact_mut(n).zip(&weight) {
            let w = w.max(f64::MIN_POSITIVE);
            row.iter_mut().for_each(|x| *x /= w);
        }
        let (own, seen, inverse) = (self.own.clone(), self.seen.clone(), self.inverse.clone());
        let weight = Cow::Owned(weight);
        Rows { weight, samples, nuisances: self.nuisances, width: self.width, own, seen, inverse }
    }

    /// Weighted square that the nuisances (and chosen terms) explain.
    pub fn explained(&self) -> f64 {
        let p = self.nuisances;
        let seen = self.seen.rows(0, p);
        (&self.inverse * seen).dot(&seen)
    }

    /// Sample number `i`: what is beside, and the response.
    fn sample(&self, i: usize) -> &[f64] {
        let n = self.width + 1;
        &self.samples[i * n..][..n]
    }

    /// Numbers of the samples that weigh anything.
    fn used(&self) -> impl Iterator<Item = usize> {
        (0..self.weight.len()).filter(|&i| self.weight[i] > 0.0)
    }

    /// Evidence on the chosen terms and a candidate, the nuisances profiled out. `columns` fills
    /// one row of the candidate's columns.
    pub fn reduce(&self, count: usize, mut columns: impl FnMut(usize, &mut [f64])) -> Evidence {
        let n = self.width + 1;
        let mut g = vec![0.0; count];
        let mut touched = Vec::with_capacity(count);
        // Row-major, the lower triangle alone.
        let mut a = vec![0.0; count * count];
        let mut cross = vec![0.0; count * n];
        for i in self.used().take_while(|_| count > 0) {
            columns(i, &mut g);
            let (w, sample) = (self.weight[i], self.sample(i));
            // Curves touch two of their many columns.
            touched.clear();
            touched.extend((0..count).filter(|&j| g[j] != 0.0));
            for (t, &j) in touched.iter().enumerate() {
                let wg = w * g[j];
                let into = &mut a[j * count..][..count];
                if touched.len() == count {
                    into[..=j].iter_mut().zip(&g).for_each(|(sum, x)| *sum += wg * x);
                } else {
                    touched[..=t].iter().for_each(|&k| into[k] += wg * g[k]);
                }
                let into = &mut cross[j * n..][..n];
                into.iter_mut().zip(sample).for_each(|(sum, x)| *sum += wg * x);
            }
        }
        let mut a = DMatrix::from_row_slice(count, count, &a);
        a.fill_upper_triangle_with_lower_triangle();
        self.profiled(&a, &DMatrix::from_vec(n, count, cross))
    }

    /// The same for many columns, of which samples near each other touch the same few: `block` is
    /// the number of a sample's neighbourhood, and `columns` fills a whole row.
    pub fn reduce_by_blocks(
        &self,
        count: usize,
        block: impl Fn(usize) -> usize,
        mut columns: impl FnMut(usize, &mut [f64]),
    ) -> Evidence {
        let n = self.width + 1;
        let mut a = DMatrix::<f64>::zeros(count, count);
        let mut cross = DMatrix::<f64>::zeros(n, count);
        let mut order: Vec<(usize, usize)> = self.used().map(|i| (block(i), i)).collect();
        order.sort_unstable();
        let mut rows = Vec::new();
        for members in order.chunk_by(|a, b| a.0 == b.0) {
            rows.resize(members.len() * count, 0.0);
            for (&(_, i), row) in members.iter().zip(rows.chunks_exact_mut(count.max(1))) {
                columns(i, row);
            }
            let touched = touched(&rows, count);
            let weighted = self.weighted(members, &rows, &touched);
            let squares = &weighted * weighted.transpose();
            for (c, &j) in touched.iter().enumerate() {
                let column = squares.column(c);
                let (own, beside) = column.as_slice().split_at(touched.len());
                touched.iter().zip(own).for_each(|(&i, s)| a[(i, j)] += s);
                cross.column_mut(j).iter_mut().zip(beside).for_each(|(sum, s)| *sum += s);
            }
        }
        self.profiled(&a, &cross)
    }

    /// A column a sample: its touched columns, what is beside, and the response, times the root of
    /// its weight.
    fn weighted(
        &self,
        members: &[(usize, usize)],
        rows: &[f64],
        touched: &[usize],
    ) -> DMatrix<f64> {
        let count = rows.len() / members.len();
        let height = touched.len() + self.width + 1;
        let mut all = Vec::with_capacity(members.len() * height);
        for (n, &(_, i)) in members.iter().enumerate() {
            let root = self.weight[i].sqrt();
            let row = &rows[n * count..][..count];
            all.extend(touched.iter().map(|&j| root * row[j]));
            all.extend(self.sample(i).iter().map(|x| root * x));
        }
        DMatrix::from_vec(height, members.len(), all)
    }

    /// Score of columns alone, the nuisances profiled out: no other term may stand beside.
    pub fn score(&self, count: usize, mut columns: impl FnMut(usize, &mut [f64])) -> DVector<f64> {
        let own = &self.inverse * &self.seen;
        let mut sum = DVector::zeros(count);
        let mut g = vec![0.0; count];
        for i in self.used() {
            columns(i, &mut g);
            let (row, y) = self.sample(i).split_at(self.width);
            let fitted: f64 = row.iter().zip(own.iter()).map(|(x, b)| x * b).sum();
            let left = self.weight[i] * (y[0] - fitted);
            sum.iter_mut().zip(&g).for_each(|(s, g)| *s += left * g);
        }
        sum
    }

    /// Information and score of the chosen terms and a candidate together, `cross` being the
    /// candidate's against all that is beside it and the response, with the nuisances profiled out.
    fn profiled(&self, a: &DMatrix<f64>, cross: &DMatrix<f64>) -> Evidence {
        let (p, count) = (self.nuisances, a.ncols());
        let m = self.width - p;
        let n = m + count;
        let mut all = DMatrix::<f64>::zeros(n, n);
        let mut right = DVector::<f64>::zeros(n);
        all.view_mut((0, 0), (m, m)).copy_from(&self.own.view((p, p), (m, m)));
        all.view_mut((m, m), (count, count)).copy_from(a);
        all.view_mut((0, m), (m, count)).copy_from(&cross.view((p, 0), (m, count)));
        all.view_mut((m, 0), (count, m)).copy_from(&cross.view((p, 0), (m, count)).transpose());
        right.rows_mut(0, m).copy_from(&self.seen.rows(p, m));
        right.rows_mut(m, count).copy_from(&cross.row(self.width).transpose());
        // The nuisances against all of it.
        let mut shared = DMatrix::<f64>::zeros(p, n);
        shared.view_mut((0, 0), (p, m)).copy_from(&self.own.view((0, p), (p, m)));
        shared.view_mut((0, m), (p, count)).copy_from(&cross.view((0, 0), (p, count)));
        let project = shared.transpose() * &self.inverse;
        all -= &project * &shared;
        right -= &project * self.seen.rows(0, p);
        Evidence { a: all, b: right }
    }
}

/// Samples multiplied at once.
const AT_ONCE: usize = 512;

/// Weighted sums of products of the `n` columns of row-major samples.
fn squares(samples: &[f64], weight: &[f64], n: usize) -> DMatrix<f64> {
    let mut sum = DMatrix::zeros(n, n);
    for (samples, weight) in samples.chunks(AT_ONCE * n).zip(weight.chunks(AT_ONCE)) {
        let mut rooted = DMatrix::from_column_slice(n, weight.len(), samples);
        for (mut sample, w) in rooted.column_iter_mut().zip(weight) {
            sample *= w.max(0.0).sqrt();
        }
        sum.gemm(1.0, &rooted, &rooted.transpose(), 1.0);
    }
    sum
}

/// The columns of a block of rows that are not zero everywhere.
fn touched(rows: &[f64], count: usize) -> Vec<usize> {
    let mut any = vec![false; count];
    for row in rows.chunks_exact(count.max(1)) {
        any.iter_mut().zip(row).for_each(|(any, g)| *any |= *g != 0.0);
    }
    (0..count).filter(|&j| any[j]).collect()
}

/// Coefficients of a fit to all views.
pub fn fit(views: &[Evidence], prior: f64) -> Option<DVector<f64>> {
    let k = views.first()?.b.len();
    let mut a = DMatrix::identity(k, k) * prior;
    let mut b = DVector::zeros(k);
    for v in views {
        a += &v.a;
        b += &v.b;
    }
    Some(Cholesky::of(a)?.solve(&b))
}

/// Few unknowns are not worth more threads.
const VIEWS_AT_ONCE: usize = 4;

/// Gain over no term at all, each view predicted from a fit to the others. `prior` is the
/// precision that holds a coefficient nothing is known about.
pub fn gain(views: &[Evidence], prior: f64) -> Option<Gain> {
    let k = views.first()?.b.len();
    let mut a = DMatrix::identity(k, k) * prior;
    let mut b = DVector::zeros(k);
    for v in views {
        a += &v.a;
        b += &v.b;
    }
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

/// Log likelihood of a view with the coefficients `beta` over that without any, nats.
pub fn score(view: &Evidence, beta: &DVector<f64>) -> f64 {
    beta.dot(&view.b) - 0.5 * beta.dot(&(&view.a * beta))
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
    /// How much more the views' own fits scatter than their noise explains, at least 1: about the
    /// common fit, or about nothing at all where a few views have what the others have not.
    pub dispersion: f64,
}

impl Null {
    /// For the columns from number `chosen` on, given the columns before them.
    pub fn of(views: &[Evidence], chosen: usize, prior: f64) -> Option<Self> {
        let k = views.first()?.b.len() - chosen;
        let (alone, left) = beside_chosen(views, chosen, prior)?;
        let sum = alone.iter().fold(DMatrix::zeros(k, k), |sum, a| sum + a);
        let u = sum.symmetric_eigen().eigenvectors;
        let information = |a: &DMatrix<f64>| -> Vec<f64> {
            let au = a * &u;
            (0..k).map(|j| u.column(j).dot(&au.column(j)).max(0.0)).collect()
        };
        let by_view: Vec<Vec<f64>> = alone.iter().map(information).collect();
        let total: Vec<f64> = (0..k).map(|j| by_view.iter().map(|a| a[j]).sum()).collect();
        let about_fit = dispersion(&alone, &by_view, &total, &u, &left, prior);
        let dispersion = about_fit.min(usual_square(&by_view, &total, &u, &left));
        Some(Null { by_view, total, prior, dispersion })
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

/// Information and score of each view.
type PerView = (Vec<DMatrix<f64>>, Vec<DVector<f64>>);

/// The candidate's evidence once the chosen terms are fitted with it: its information in each
/// view, and its score there.
fn beside_chosen(views: &[Evidence], chosen: usize, prior: f64) -> Option<PerView> {
    let n = views.first()?.b.len();
    let k = n - chosen;
    if chosen == 0 {
        let split = views.iter().map(|v| (v.a.clone(), v.b.clone()));
        return Some(split.unzip());
    }
    let mut mm = DMatrix::identity(chosen, chosen) * prior;
    let mut mk = DMatrix::zeros(chosen, k);
    let mut bm = DVector::zeros(chosen);
    for v in views {
        mm += v.a.view((0, 0), (chosen, chosen));
        mk += v.a.view((0, chosen), (chosen, k));
        bm += v.b.rows(0, chosen);
    }
    let factor = mm.cholesky()?;
    let (t, beta) = (factor.solve(&mk), factor.solve(&bm));
    let split = views.iter().map(|v| {
        let vmm = v.a.view((0, 0), (chosen, chosen));
        let vmk = v.a.view((0, chosen), (chosen, k));
        let vkk = v.a.view((chosen, chosen), (k, k));
        let tm = t.transpose() * vmk;
        let a = vkk - &tm - tm.transpose() + t.transpose() * vmm * &t;
        let left_m = v.b.rows(0, chosen) - vmm * &beta;
        let left_k = v.b.rows(chosen, k) - vmk.transpose() * &beta;
        (a, left_k - t.transpose() * left_m)
    });
    Some(split.unzip())
}

/// Scatter of the views' scores about the common fit, over what noise gives them.
fn dispersion(
    alone: &[DMatrix<f64>],
    by_view: &[Vec<f64>],
    total: &[f64],
    u: &DMatrix<f64>,
    scores: &[DVector<f64>],
    prior: f64,
) -> f64 {
    let most = total.iter().copied().fold(0.0, f64::max);
    let k = u.nrows();
    let whole = alone.iter().fold(DMatrix::identity(k, k) * prior, |sum, a| sum + a);
    let seen = scores.iter().fold(DVector::zeros(k), |sum, b| sum + b);
    let Some(factor) = whole.cholesky() else { return 1.0 };
    let beta = factor.solve(&seen);
    // What each view says beyond the common fit.
    let left: Vec<DVector<f64>> = scores.iter().zip(alone).map(|(b, a)| b - a * &beta).collect();
    let (mut sum, mut n) = (0.0, 0.0);
    for (j, &total) in total.iter().enumerate() {
        if total < 1e-6 * most {
            continue;
        }
        for (left, a) in left.iter().zip(by_view) {
            // A view that says next to nothing would divide by next to nothing.
            if a[j] > 1e-3 * total {
                sum += u.column(j).dot(left).powi(2) / a[j];
                n += 1.0 - a[j] / total;
            }
        }
    }
    if n < 1.0 {
        return 1.0;
    }
    // Chance alone scatters the estimate by the root of 2 / n.
    (sum / n - f64::sqrt(2.0 / n)).max(1.0)
}

/// Median of the views' squared scores, over what noise gives them: near 1 where most views have
/// nothing of the candidate, whatever the others have.
fn usual_square(
    by_view: &[Vec<f64>],
    total: &[f64],
    u: &DMatrix<f64>,
    scores: &[DVector<f64>],
) -> f64 {
    let most = total.iter().copied().fold(0.0, f64::max);
    let mut squares = Vec::new();
    for (j, &total) in total.iter().enumerate().filter(|(_, t)| **t >= 1e-6 * most) {
        let seen = scores.iter().zip(by_view).filter(|(_, a)| a[j] > 1e-3 * total);
        squares.extend(seen.map(|(b, a)| u.column(j).dot(b).powi(2) / a[j]));
    }
    if squares.is_empty() {
        return 1.0;
    }
    let (half, n) = (squares.len() / 2, squares.len() as f64);
    let middle = *squares.select_nth_unstable_by(half, f64::total_cmp).1;
    // By one standard error of the median more, for safety.
    (middle / CHI2_MEDIAN * (1.0 + MEDIAN_ERROR / n.sqrt())).max(1.0)
}

/// Median of the square of a standard normal number.
const CHI2_MEDIAN: f64 = 0.4549;
/// Relative standard error of the median of n such squares, times the root of n: 1 / (2 f m) with
/// their density f at the median m.
const MEDIAN_ERROR: f64 = 2.33;

#[cfg(test)]
#[path = "evidence_tests.rs"]
mod tests;
