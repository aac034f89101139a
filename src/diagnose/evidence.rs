//! How much better the held-out views are predicted with a candidate term than without.
//!
//! A view's evidence is quadratic in the coefficients: with its nuisances (the plane, or the
//! view's own level) profiled out, log p(view | beta) = beta' b - beta' A beta / 2 + const. The
//! search then needs only A and b of every view, and so does the simulation of its null.

use nalgebra::{DMatrix, DVector};
use rand_distr::{Distribution, StandardNormal};

use crate::rng::Stream;

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
pub struct Rows {
    response: Vec<f64>,
    /// Inverse variance, in independent samples.
    weight: Vec<f64>,
    /// A row a sample: nuisances, then the chosen terms' columns.
    beside: Vec<f64>,
    nuisances: usize,
    width: usize,
    /// Normal equations of `beside`, before anything is profiled out.
    own: DMatrix<f64>,
    seen: DVector<f64>,
    /// Inverse of the nuisances' own block.
    inverse: DMatrix<f64>,
}

impl Rows {
    /// `beside` is row-major with `width` columns, of which the first are the nuisances, one for
    /// each entry of `precision`, which holds them to zero (0: free). `None` when the nuisances
    /// cannot be told apart.
    pub fn new(
        response: Vec<f64>,
        weight: Vec<f64>,
        beside: Vec<f64>,
        width: usize,
        precision: &[f64],
    ) -> Option<Self> {
        let root = |i: usize| weight[i].max(0.0).sqrt();
        let weighted =
            DMatrix::from_fn(width, response.len(), |q, i| root(i) * beside[i * width + q]);
        let mut own = &weighted * weighted.transpose();
        let seen = &weighted * DVector::from_fn(response.len(), |i, _| root(i) * response[i]);
        let p = precision.len();
        for (q, precision) in precision.iter().enumerate() {
            own[(q, q)] += precision;
        }
        let inverse = own.view((0, 0), (p, p)).into_owned().try_inverse()?;
        Some(Rows { response, weight, beside, nuisances: p, width, own, seen, inverse })
    }

    /// Samples that share a key made one: exact for columns that depend on the key alone.
    pub fn grouped(&self, keys: usize, key: impl Fn(usize) -> usize) -> Self {
        let mut response = vec![0.0; keys];
        let mut weight = vec![0.0; keys];
        let mut beside = vec![0.0; keys * self.width];
        for (i, (&y, &w)) in self.response.iter().zip(&self.weight).enumerate() {
            let k = key(i);
            weight[k] += w;
            response[k] += w * y;
            let row = &self.beside[i * self.width..][..self.width];
            for (sum, x) in beside[k * self.width..][..self.width].iter_mut().zip(row) {
                *sum += w * x;
            }
        }
        for k in 0..keys {
            let w = weight[k].max(f64::MIN_POSITIVE);
            response[k] /= w;
            beside[k * self.width..][..self.width].iter_mut().for_each(|x| *x /= w);
        }
        Rows {
            response,
            weight,
            beside,
            nuisances: self.nuisances,
            width: self.width,
            own: self.own.clone(),
            seen: self.seen.clone(),
            inverse: self.inverse.clone(),
        }
    }

    /// Weighted square that the nuisances (and chosen terms) explain.
    pub fn explained(&self) -> f64 {
        let p = self.nuisances;
        let seen = self.seen.rows(0, p);
        (&self.inverse * seen).dot(&seen)
    }

    /// Evidence on the chosen terms and a candidate, the nuisances profiled out. `columns` fills
    /// one row of the candidate's columns.
    pub fn reduce(&self, count: usize, mut columns: impl FnMut(usize, &mut [f64])) -> Evidence {
        let width = self.width;
        let mut g = vec![0.0; count];
        let mut touched = Vec::with_capacity(count);
        let mut a = DMatrix::<f64>::zeros(count, count);
        let mut b = DVector::<f64>::zeros(count);
        let mut cross = DMatrix::<f64>::zeros(width, count);
        for (i, (&y, &w)) in self.response.iter().zip(&self.weight).enumerate() {
            if w <= 0.0 || count == 0 {
                continue;
            }
            columns(i, &mut g);
            // Curves touch two of their many columns.
            touched.clear();
            touched.extend((0..count).filter(|&j| g[j] != 0.0));
            let row = &self.beside[i * width..][..width];
            for (n, &j) in touched.iter().enumerate() {
                let wg = w * g[j];
                b[j] += wg * y;
                for &k in &touched[..=n] {
                    a[(j, k)] += wg * g[k];
                }
                let mut into = cross.column_mut(j);
                for (sum, x) in into.iter_mut().zip(row) {
                    *sum += wg * x;
                }
            }
        }
        a.fill_upper_triangle_with_lower_triangle();
        self.profiled(&a, &b, &cross)
    }

    /// The same for many columns, of which samples near each other touch the same few: `block` is
    /// the number of a sample's neighbourhood.
    pub fn reduce_by_blocks(
        &self,
        count: usize,
        block: impl Fn(usize) -> usize,
        mut columns: impl FnMut(usize, &mut [f64]),
    ) -> Evidence {
        let mut a = DMatrix::<f64>::zeros(count, count);
        let mut b = DVector::<f64>::zeros(count);
        let mut cross = DMatrix::<f64>::zeros(self.width, count);
        let mut order: Vec<usize> =
            (0..self.response.len()).filter(|&i| self.weight[i] > 0.0).collect();
        order.sort_by_key(|&i| block(i));
        let mut rows = Vec::new();
        for members in order.chunk_by(|&i, &j| block(i) == block(j)) {
            rows.clear();
            rows.resize(members.len() * count, 0.0);
            for (&i, row) in members.iter().zip(rows.chunks_exact_mut(count)) {
                columns(i, row);
            }
            let touched: Vec<usize> = (0..count)
                .filter(|&j| (0..members.len()).any(|r| rows[r * count + j] != 0.0))
                .collect();
            let k = touched.len();
            let weighted = DMatrix::from_fn(members.len(), k + self.width + 1, |r, c| {
                let i = members[r];
                let value = match c {
                    c if c < k => rows[r * count + touched[c]],
                    c if c < k + self.width => self.beside[i * self.width + c - k],
                    _ => self.response[i],
                };
                self.weight[i].sqrt() * value
            });
            let squares = weighted.transpose() * &weighted;
            for (c, &j) in touched.iter().enumerate() {
                b[j] += squares[(k + self.width, c)];
                touched.iter().enumerate().for_each(|(r, &i)| a[(i, j)] += squares[(r, c)]);
                (0..self.width).for_each(|q| cross[(q, j)] += squares[(k + q, c)]);
            }
        }
        self.profiled(&a, &b, &cross)
    }

    /// Score of columns alone, the nuisances profiled out: no other term may stand beside.
    pub fn score(&self, count: usize, mut columns: impl FnMut(usize, &mut [f64])) -> DVector<f64> {
        let own = &self.inverse * &self.seen;
        let mut sum = DVector::zeros(count);
        let mut g = vec![0.0; count];
        for (i, (&y, &w)) in self.response.iter().zip(&self.weight).enumerate() {
            if w <= 0.0 {
                continue;
            }
            columns(i, &mut g);
            let row = &self.beside[i * self.width..][..self.width];
            let left = w * (y - row.iter().zip(own.iter()).map(|(x, b)| x * b).sum::<f64>());
            sum.iter_mut().zip(&g).for_each(|(s, g)| *s += left * g);
        }
        sum
    }

    /// Information and score of the chosen terms and a candidate together, `cross` being the
    /// candidate's against all that is beside it, with the nuisances profiled out.
    fn profiled(&self, a: &DMatrix<f64>, b: &DVector<f64>, cross: &DMatrix<f64>) -> Evidence {
        let (p, count) = (self.nuisances, b.len());
        let m = self.width - p;
        let n = m + count;
        let mut all = DMatrix::<f64>::zeros(n, n);
        let mut right = DVector::<f64>::zeros(n);
        all.view_mut((0, 0), (m, m)).copy_from(&self.own.view((p, p), (m, m)));
        all.view_mut((m, m), (count, count)).copy_from(a);
        all.view_mut((0, m), (m, count)).copy_from(&cross.view((p, 0), (m, count)));
        all.view_mut((m, 0), (count, m)).copy_from(&cross.view((p, 0), (m, count)).transpose());
        right.rows_mut(0, m).copy_from(&self.seen.rows(p, m));
        right.rows_mut(m, count).copy_from(b);
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
        .iter()
        .map(|v| {
            let beta = (&a - &v.a).cholesky()?.solve(&(&b - &v.b));
            Some(score(v, &beta))
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
    /// The same about the common fit alone.
    pub about_fit: f64,
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
        Some(Null { by_view, total, prior, dispersion, about_fit })
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
