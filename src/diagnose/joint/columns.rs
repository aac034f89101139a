//! Columns of the joint fit: terms, then two smooth maps over the image. Also a view's evidence on
//! them, with its plane profiled out.

use nalgebra::{DMatrix, DVector};

use crate::camera::Camera;
use crate::diagnose::search::evidence::Evidence;
use crate::diagnose::search::outcome::Chosen;
use crate::diagnose::search::prepared::{fill_all, visit_all};
use crate::diagnose::search::touched::Entries;
use crate::diagnose::views::samples::ViewData;
use crate::terms::{Basis, Gauge, Modulation, PixelContext, Pixels};

/// Ridge precision of the nodes, relative to that of their second differences (`SMOOTHNESS`).
const RIDGE: f64 = 0.1;
/// Precision that holds a map's affine part to zero, over the mean information on a node.
const HELD: f64 = 1e4;
/// Pixels per map node.
const NODE_PX: usize = 32;

/// Columns of the fit: the terms', then the maps' nodes.
pub struct Columns {
    pub bases: Vec<Basis>,
    /// Prior precision of the terms' coefficients.
    pub precision: DVector<f64>,
    pub gauges: Vec<Option<Gauge>>,
    pub maps: [Basis; 2],
    /// The part of the second map that planes absorb.
    pub far_gauge: Option<Gauge>,
    /// Modulations of the affine parts that are subtracted, each once.
    absorbed_times: Vec<Modulation>,
    /// Amounts of 1, x and y times each of these that are subtracted, one column per column of the fit.
    absorbed: DMatrix<f64>,
    /// Number of columns of the terms, and of both maps.
    pub terms: usize,
    pub nodes: usize,
}

impl Columns {
    /// Columns of terms chosen where the samples have a total weight of `weight`, 1/px^2.
    pub fn of(chosen: &[Chosen], camera: &Camera, weight: f64) -> Self {
        let rays = camera.rays();
        let pixels = Pixels::new(camera, &rays, 1.0);
        let bases: Vec<Basis> = chosen.iter().map(|c| c.candidate.basis.clone()).collect();
        let [across, down] = [(camera.width, 6, 20), (camera.height, 5, 15)]
            .map(|(length, low, high)| (length / NODE_PX).clamp(low, high));
        let [width, height] = [camera.width, camera.height].map(|n| n as f64);
        let map = |times| Basis::Spline { width, height, across, down, times };
        let maps = [map(Modulation::One), map(Modulation::DisparitySquared)];
        // A nameless curve that completes a named shape over the same axis.
        let is_rest = |c: &Chosen| {
            let axis = c.candidate.basis.axis();
            let mut named = chosen.iter().filter(|other| other.candidate.family.is_some());
            c.candidate.family.is_none() && named.any(|other| other.candidate.basis.axis() == axis)
        };
        let precision = |c: &Chosen| -> Vec<f64> {
            let n = c.candidate.basis.count();
            if is_rest(c) && c.gain > 0.0 {
                // No node may carry more than the curve's whole gain over the terms before it.
                return vec![weight / (2.0 * c.gain * n as f64); n];
            }
            (0..n).map(|k| c.candidate.usual(k).powi(-2)).collect()
        };
        let gauges: Vec<Option<Gauge>> = bases.iter().map(|b| Gauge::of(b, &pixels)).collect();
        let (terms, nodes) = (bases.iter().map(Basis::count).sum(), 2 * across * down);
        let (absorbed_times, absorbed) = absorbed(&bases, &gauges, terms + nodes);
        Columns {
            gauges,
            absorbed_times,
            absorbed,
            terms,
            nodes,
            precision: DVector::from_vec(chosen.iter().flat_map(precision).collect()),
            bases,
            far_gauge: Gauge::of(&maps[1], &pixels),
            maps,
        }
    }

    /// Normal equations of these views together, their planes profiled out.
    pub fn evidence<'a>(&self, views: impl Iterator<Item = &'a ViewData>) -> Evidence {
        let mut sum = Evidence::zeros(self.width());
        views.for_each(|view| self.add(view, &mut sum));
        let Evidence { mut a, b } = sum;
        a.fill_upper_triangle_with_lower_triangle();
        // Equations of G - F c, with c = `absorbed`, columns G and affine columns F.
        let (c, n, m) = (&self.absorbed, self.absorbed.ncols(), self.absorbed.nrows());
        let crossed = a.view((0, n), (n, m)) * c;
        let twice = c.transpose() * (a.view((n, n), (m, m)) * c);
        Evidence {
            a: a.view((0, 0), (n, n)) - &crossed - crossed.transpose() + twice,
            b: b.rows(0, n) - c.transpose() * b.rows(n, m),
        }
    }

    /// Adds a view's equations for the columns, affine parts included, and for the affine columns. Most
    /// are zero at any one sample.
    fn add(&self, view: &ViewData, sum: &mut Evidence) {
        let Some(rows) = view.rows(&view.response) else { return };
        let cell = |i: usize| {
            let mut first = usize::MAX;
            self.maps[0].visit(&view.places[i], |node, _| first = first.min(node));
            first
        };
        rows.add_by_blocks(sum, cell, |i, row| self.append(&view.places[i], row));
    }

    /// Score that a fit leaves in a view, its plane profiled out: b - A beta of its normal equations,
    /// without forming them.
    pub fn left(&self, view: &ViewData, beta: &DVector<f64>) -> Option<DVector<f64>> {
        let affine = -(&self.absorbed * beta);
        let beta: Vec<f64> = beta.iter().chain(&affine).copied().collect();
        let mut row = Entries::new();
        let mut residual = |(place, y): (&PixelContext, &f64)| {
            row.clear();
            self.append(place, &mut row);
            y - row.iter().map(|&(k, g)| g * beta[k]).sum::<f64>()
        };
        let residuals: Vec<f64> =
            view.places.iter().zip(&view.response).map(&mut residual).collect();
        let rows = view.rows(&residuals)?;
        let left = rows.scores_on(beta.len(), |i, row| self.append(&view.places[i], row));
        let (n, m) = (self.absorbed.ncols(), self.absorbed.nrows());
        Some(left.rows(0, n) - self.absorbed.transpose() * left.rows(n, m))
    }

    /// Number of columns, including the affine ones that are subtracted.
    fn width(&self) -> usize {
        self.absorbed.ncols() + self.absorbed.nrows()
    }

    /// Appends the columns that may be nonzero at a place, affine parts included.
    fn append(&self, place: &PixelContext, row: &mut Entries) {
        visit_all(&self.bases, place, |k, g| row.push((k, g)));
        visit_all(&self.maps, place, |k, g| row.push((self.terms + k, g)));
        for (n, &times) in self.absorbed_times.iter().enumerate() {
            let first = self.absorbed.ncols() + 3 * n;
            Basis::Affine { times }.visit(place, |k, g| row.push((first + k, g)));
        }
    }

    /// Fills all columns at a place, the terms without what planes absorb of them.
    pub fn fill(&self, place: &PixelContext, row: &mut [f64]) {
        let (terms, nodes) = row.split_at_mut(self.terms);
        fill_all(&self.bases, place, terms);
        for (term, gauge) in self.gauges.iter().enumerate() {
            let mine = &mut terms[self.span(term)];
            gauge.iter().for_each(|gauge| gauge.take_out(place, mine));
        }
        let (first, second) = nodes.split_at_mut(self.nodes / 2);
        self.maps[0].fill(place, first);
        self.maps[1].fill(place, second);
    }

    pub fn span(&self, term: usize) -> std::ops::Range<usize> {
        let first: usize = self.bases[..term].iter().map(Basis::count).sum();
        first..first + self.bases[term].count()
    }

    /// The maps, and the affine part that planes absorb of the second.
    pub fn rest(&self) -> impl Iterator<Item = Basis> + '_ {
        let absorbed = self.far_gauge.iter().map(|gauge| gauge.term(&[]).0);
        self.maps.iter().cloned().chain(absorbed)
    }

    /// Penalty on the nodes, for a mean information of one on each: smooth, small, and without what
    /// planes absorb.
    pub fn penalty(&self, smoothness: f64) -> DMatrix<f64> {
        let Basis::Spline { across, down, .. } = self.maps[0] else {
            return DMatrix::zeros(0, 0);
        };
        let bend = |n: usize| {
            let d = DMatrix::from_fn(n - 2, n, |i, j| match j.wrapping_sub(i) {
                0 | 2 => 1.0,
                1 => -2.0,
                _ => 0.0,
            });
            d.transpose() * d
        };
        let (id, unit) = (DMatrix::identity(across, across), DMatrix::identity(down, down));
        let rough: DMatrix<f64> = unit.kronecker(&bend(across)) + bend(down).kronecker(&id);
        let n = across * down;
        let mut both = DMatrix::zeros(2 * n, 2 * n);
        let one = (rough + DMatrix::identity(n, n) * RIDGE) * smoothness;
        both.view_mut((0, 0), (n, n)).copy_from(&one);
        both.view_mut((n, n), (n, n)).copy_from(&one);
        if let Some(gauge) = &self.far_gauge {
            // A slope that grows with the disparity's square bends tilted planes. Held to zero it would
            // be taken for another shape, so it is fitted but not reported.
            for (map, absorbed) in [(0, 0..3), (n, 0..1)] {
                for k in absorbed {
                    let affine = DVector::from_iterator(n, gauge.affine.iter().map(|a| a[k]));
                    let c = affine.normalize();
                    both.view_mut((map, map), (n, n)).ger(HELD, &c, &c, 1.0);
                }
            }
        }
        both
    }
}

/// Modulations of the columns' affine parts, and the amounts of 1, x and y times each to subtract from
/// each column. A part that is a plane stays in: each view's own plane absorbs it.
fn absorbed(
    bases: &[Basis],
    gauges: &[Option<Gauge>],
    columns: usize,
) -> (Vec<Modulation>, DMatrix<f64>) {
    let mut all: Vec<Modulation> = Vec::new();
    let mut taken: Vec<(usize, usize, [f64; 3])> = Vec::new();
    let mut first = 0;
    for (basis, gauge) in bases.iter().zip(gauges) {
        for gauge in gauge.iter().filter(|gauge| !gauge.is_plane()) {
            let known = all.iter().position(|times| *times == gauge.times);
            let row = known.unwrap_or_else(|| {
                all.push(gauge.times);
                all.len() - 1
            });
            let columns = gauge.affine.iter().enumerate();
            taken.extend(columns.map(|(k, affine)| (3 * row, first + k, *affine)));
        }
        first += basis.count();
    }
    let mut absorbed = DMatrix::zeros(3 * all.len(), columns);
    for (row, column, affine) in taken {
        absorbed.view_mut((row, column), (3, 1)).copy_from_slice(&affine);
    }
    (all, absorbed)
}
