//! One view's samples, and the evidence on columns that they reduce to.

use std::borrow::Cow;

use nalgebra::{DMatrix, DVector};

use super::evidence::Evidence;
use super::touched::{Entries, TouchedColumns};
use crate::terms::{Basis, PixelContext};

/// One view's data with the columns fitted alongside every candidate: its nuisances and the terms
/// already chosen.
pub struct Rows<'a> {
    /// Inverse variance, in independent samples.
    pub(super) weight: Cow<'a, [f64]>,
    /// One row per sample: nuisances, then the chosen terms' columns, then the response.
    samples: Vec<f64>,
    /// Prior precision of each nuisance about zero; 0 for a free one.
    pub(super) precision: Vec<f64>,
    /// Number of nuisance and chosen-term columns.
    pub(super) width: usize,
    /// Normal equations of these columns, before the nuisances are profiled out.
    pub(super) own: DMatrix<f64>,
    seen: DVector<f64>,
    /// Inverse of the nuisances' own block.
    pub(super) inverse: DMatrix<f64>,
}

impl<'a> Rows<'a> {
    /// `beside` is row-major with `width` columns. The first are the nuisances, one for each entry of
    /// `precision`, their prior precision about zero (0: free). `None` if the nuisances are collinear.
    pub fn new(
        response: &[f64],
        weight: impl Into<Cow<'a, [f64]>>,
        beside: &[f64],
        width: usize,
        precision: &[f64],
    ) -> Option<Self> {
        let weight = weight.into();
        let mut samples = Vec::with_capacity(response.len() * (width + 1));
        for (row, y) in beside.chunks_exact(width).zip(response) {
            samples.extend_from_slice(row);
            samples.push(*y);
        }
        let squares = squares(&samples, &weight, width + 1);
        let mut own = squares.view((0, 0), (width, width)).into_owned();
        let seen = squares.view((0, width), (width, 1)).column(0).into_owned();
        let p = precision.len();
        for (q, precision) in precision.iter().enumerate() {
            own[(q, q)] += precision;
        }
        let inverse = own.view((0, 0), (p, p)).into_owned().try_inverse()?;
        let precision = precision.to_vec();
        Some(Rows { weight, samples, precision, width, own, seen, inverse })
    }

    /// Merges samples that share a key; exact for columns that depend on the key alone.
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
        let (weight, precision) = (Cow::Owned(weight), self.precision.clone());
        Rows { weight, samples, precision, width: self.width, own, seen, inverse }
    }

    /// Number of nuisances.
    pub(super) fn nuisances(&self) -> usize {
        self.precision.len()
    }

    /// Weighted sum of squares that the nuisances explain.
    pub fn explained(&self) -> f64 {
        let p = self.nuisances();
        let seen = self.seen.rows(0, p);
        (&self.inverse * seen).dot(&seen)
    }

    /// Row of sample `i`: nuisances, chosen terms and response.
    pub(super) fn sample(&self, i: usize) -> &[f64] {
        let n = self.width + 1;
        &self.samples[i * n..][..n]
    }

    /// Indices of the samples with positive weight.
    pub(super) fn used(&self) -> impl Iterator<Item = usize> {
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
            // Curves have only two nonzero columns per sample.
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
        let m = self.width - self.nuisances();
        let mut sum = Evidence::zeros(m + count);
        sum.a
            .view_mut((m, m), (count, count))
            .copy_from(&DMatrix::from_row_slice(count, count, &a));
        self.profile(&mut sum, &DMatrix::from_vec(n, count, cross));
        sum.a.fill_upper_triangle_with_lower_triangle();
        sum
    }

    /// Evidence on the chosen terms and a basis; a sample's place is the one of its index.
    pub fn evidence(&self, basis: &Basis, places: &[PixelContext]) -> Evidence {
        self.reduce(basis.count(), |i, row| basis.fill(&places[i], row))
    }

    /// Adds what [`Rows::reduce`] gives to `sum`, for many columns of which neighbouring samples touch the
    /// same few: `block` gives a sample's neighbourhood, `columns` appends the index and value of its columns
    /// that may be nonzero. Lower triangle only; the upper one is to be filled after the last view.
    pub fn add_by_blocks(
        &self,
        sum: &mut Evidence,
        block: impl Fn(usize) -> usize,
        columns: impl Fn(usize, &mut Entries),
    ) {
        let m = self.width - self.nuisances();
        let mut cross = DMatrix::<f64>::zeros(self.width + 1, sum.b.len() - m);
        let mut order: Vec<(usize, usize)> = self.used().map(|i| (block(i), i)).collect();
        order.sort_unstable();
        let mut few = TouchedColumns::of(cross.ncols());
        for members in order.chunk_by(|a, b| a.0 == b.0) {
            few.fill(members.iter().map(|(_, i)| *i), &columns);
            let touched = &few.touched;
            let weighted = self.weighted(members, &few.rows, touched.len());
            let across = weighted.transpose();
            // The lower triangle alone, in strips.
            let strips = (touched.len() / STRIP).max(1);
            for strip in 0..strips {
                let first = strip * STRIP;
                let last = if strip + 1 == strips { touched.len() } else { first + STRIP };
                let products = weighted.rows_range(first..) * across.columns_range(first..last);
                for (c, column) in products.column_iter().enumerate() {
                    let j = touched[first + c];
                    let (own, beside) = column.as_slice().split_at(touched.len() - first);
                    let below = touched[first..].iter().zip(own).skip(c);
                    below.for_each(|(&i, s)| sum.a[(m + i, m + j)] += s);
                    cross.column_mut(j).iter_mut().zip(beside).for_each(|(sum, s)| *sum += s);
                }
            }
        }
        self.profile(sum, &cross);
    }

    /// Scores on `count` columns, the nuisances profiled out. `columns` is that of [`Rows::add_by_blocks`].
    pub fn scores_on(&self, count: usize, columns: impl Fn(usize, &mut Entries)) -> DVector<f64> {
        let mut cross = DMatrix::<f64>::zeros(self.width + 1, count);
        let mut entries = Entries::new();
        for i in self.used() {
            entries.clear();
            columns(i, &mut entries);
            let (w, sample) = (self.weight[i], self.sample(i));
            for &(j, g) in &entries {
                let into = cross.column_mut(j).into_iter();
                into.zip(sample).for_each(|(sum, x)| *sum += w * g * x);
            }
        }
        let p = self.nuisances();
        let nuisances = &self.inverse * self.seen.rows(0, p);
        cross.row(self.width).transpose() - cross.rows(0, p).tr_mul(&nuisances)
    }

    /// One column per sample: its `count` candidate columns, nuisances, chosen terms and response,
    /// times the root of its weight.
    fn weighted(&self, members: &[(usize, usize)], rows: &[f64], count: usize) -> DMatrix<f64> {
        let height = count + self.width + 1;
        let mut all = Vec::with_capacity(members.len() * height);
        for (n, &(_, i)) in members.iter().enumerate() {
            let root = self.weight[i].sqrt();
            all.extend(rows[n * count..][..count].iter().map(|x| root * x));
            all.extend(self.sample(i).iter().map(|x| root * x));
        }
        DMatrix::from_vec(height, members.len(), all)
    }

    /// Adds the chosen terms' normal equations and their products with the candidate's columns,
    /// `cross`, and profiles out the nuisances. Only the lower triangle is kept.
    fn profile(&self, sum: &mut Evidence, cross: &DMatrix<f64>) {
        let (p, count) = (self.nuisances(), cross.ncols());
        let m = self.width - p;
        let n = m + count;
        let chosen = self.own.view((p, p), (m, m));
        sum.a.view_mut((0, 0), (m, m)).zip_apply(&chosen, |sum, a| *sum += a);
        let beside = cross.view((p, 0), (m, count)).transpose();
        sum.a.view_mut((m, 0), (count, m)).zip_apply(&beside, |sum, a| *sum += a);
        // Products of the nuisances with all columns.
        let mut shared = DMatrix::<f64>::zeros(p, n);
        shared.view_mut((0, 0), (p, m)).copy_from(&self.own.view((0, p), (p, m)));
        shared.view_mut((0, m), (p, count)).copy_from(&cross.view((0, 0), (p, count)));
        let project = &self.inverse * &shared;
        for (j, mine) in project.column_iter().enumerate() {
            for (i, theirs) in shared.column_iter().enumerate().skip(j) {
                sum.a[(i, j)] -= mine.dot(&theirs);
            }
        }
        let response = self.seen.rows(p, m).into_owned();
        let of_response = cross.row(self.width).transpose();
        let explained = project.transpose() * self.seen.rows(0, p);
        let right = response.iter().chain(of_response.iter()).zip(&explained);
        sum.b.iter_mut().zip(right).for_each(|(sum, (seen, explained))| *sum += seen - explained);
    }
}

/// Columns of a block multiplied at once with all that follow; the last strip also takes the remainder.
/// Twice the width of the matrix product's kernel, and small against a block of two maps, which has 32
/// columns plus the terms'.
const STRIP: usize = 16;
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

#[cfg(test)]
#[path = "rows_tests.rs"]
mod tests;
