//! A view prepared for candidates: the columns fitted alongside them, with samples that a candidate
//! cannot tell apart merged.

use std::borrow::Borrow;
use std::cell::RefCell;
use std::rc::Rc;

use rayon::prelude::*;

use super::evidence::Evidence;
use super::rows::Rows;
use crate::diagnose::views::samples::ViewData;
use crate::diagnose::views::tiles::SIDE;
use crate::terms::{Basis, Coordinate, PixelContext, Term};

/// Evidence of views on given terms together.
pub fn evidence_of_bases(data: &[ViewData], bases: &[&Basis]) -> Vec<Evidence> {
    data.par_iter().filter_map(|v| together(v, bases)).collect()
}

/// A layer's views, for joint fits of several terms.
pub struct Together<'a> {
    pub fine: &'a [ViewData],
    /// The same views in larger patches.
    pub coarse: &'a [ViewData],
    /// The last answer, which is often requested again.
    last: RefCell<Option<Answer>>,
}

/// Terms, and the views' evidence on them.
type Answer = (Vec<Basis>, Rc<Vec<Evidence>>);

impl<'a> Together<'a> {
    pub fn of(fine: &'a [ViewData], coarse: &'a [ViewData]) -> Self {
        Together { fine, coarse, last: RefCell::new(None) }
    }

    /// Evidence of the views on these terms, from fine patches if any term needs them.
    pub fn evidence(&self, terms: &[&Basis]) -> Rc<Vec<Evidence>> {
        let mut last = self.last.borrow_mut();
        if let Some((of, evidence)) = &*last
            && of.iter().eq(terms.iter().copied())
        {
            return Rc::clone(evidence);
        }
        let fine = terms.iter().any(|b| b.needs_tiles());
        let evidence = evidence_of_bases(if fine { self.fine } else { self.coarse }, terms);
        let evidence = Rc::new(evidence);
        let of = terms.iter().map(|b| (*b).clone()).collect();
        *last = Some((of, Rc::clone(&evidence)));
        evidence
    }
}

/// A view prepared for the candidates.
pub struct Prepared<'a> {
    /// Kept for fine candidates that do not depend on a single coordinate.
    fine: Option<(&'a [PixelContext], Rows<'a>)>,
    pub coarse: (&'a [PixelContext], Rows<'a>),
    /// The fine samples grouped by one coordinate.
    pub(super) groups: Vec<(&'a Grouping, Rows<'a>)>,
    /// Whether the coarse samples are the fine ones.
    pub(super) is_one_size: bool,
}

/// Side of a block of samples, in patches; few nodes of a curve or map lie within one.
const NEIGHBOURS: f64 = 8.0;

/// A view's normal equations on these terms together.
pub fn together(view: &ViewData, terms: &[&Basis]) -> Option<Evidence> {
    let rows = rows(view, &view.response, &[])?;
    let count = terms.iter().map(|b| b.count()).sum();
    let block = |i: usize| {
        const ACROSS: usize = 1 << 16;
        let place = &view.places[i];
        let side = NEIGHBOURS * place.side.max(1.0);
        (place.v / side) as usize * ACROSS + (place.u / side) as usize
    };
    let mut sum = Evidence::zeros(count);
    rows.add_by_blocks(&mut sum, block, |i, row| {
        visit_all(terms, &view.places[i], |k, g| row.push((k, g)));
    });
    sum.a.fill_upper_triangle_with_lower_triangle();
    Some(sum)
}

/// Fills the columns of several terms, one after the other.
pub fn fill_all(terms: &[impl Borrow<Basis>], place: &PixelContext, row: &mut [f64]) {
    row.fill(0.0);
    visit_all(terms, place, |k, g| row[k] += g);
}

/// Passes index and value of the columns of several terms that may be nonzero to `see`.
pub fn visit_all(
    terms: &[impl Borrow<Basis>],
    place: &PixelContext,
    mut see: impl FnMut(usize, f64),
) {
    let mut first = 0;
    for basis in terms.iter().map(Borrow::<Basis>::borrow) {
        basis.visit(place, |k, g| see(first + k, g));
        first += basis.count();
    }
}

/// A view's rows with its nuisances and the columns of the terms `beside`.
fn rows<'a>(view: &'a ViewData, response: &[f64], beside: &[&Basis]) -> Option<Rows<'a>> {
    let p = view.precision.len();
    if beside.is_empty() {
        return view.rows(response);
    }
    let width = p + beside.iter().map(|b| b.count()).sum::<usize>();
    let mut columns = vec![0.0; view.places.len() * width];
    for (i, row) in columns.chunks_exact_mut(width).enumerate() {
        row[..p].copy_from_slice(&view.nuisance[i * p..][..p]);
        fill_all(beside, &view.places[i], &mut row[p..]);
    }
    Rows::new(response, &view.weight, &columns, width, &view.precision)
}

/// A view's rows beside these terms, merged by the grouping over this coordinate.
pub fn merge_by<'a>(
    view: &'a ViewData,
    groupings: &'a [Grouping],
    over: Coordinate,
    beside: &[&Basis],
) -> Option<(&'a Grouping, Rows<'a>)> {
    let grouping = groupings.iter().find(|g| g.over == over)?;
    Some((grouping, grouping.merge(&rows(view, &view.response, beside)?)))
}

pub fn prepare<'a>(
    fine: &'a ViewData,
    coarse: &'a ViewData,
    groups: &'a [Grouping],
    keep_fine: bool,
    beside: &[&Basis],
    settled: &[Term],
) -> Option<Prepared<'a>> {
    let left = fine.without(settled);
    let left_coarse = if coarse.gathered.is_empty() {
        left.clone()
    } else {
        // Terms that vary within a patch are subtracted before averaging over it.
        let mut sums = vec![0.0; coarse.places.len()];
        for ((y, w), &k) in left.iter().zip(&fine.weight).zip(&coarse.gathered) {
            sums[k as usize] += w * y;
        }
        sums.iter().zip(&coarse.weight).map(|(s, w)| if *w > 0.0 { s / w } else { 0.0 }).collect()
    };
    let rows_fine = rows(fine, &left, beside)?;
    let groups = groups.iter().map(|g| (g, g.merge(&rows_fine))).collect();
    Some(Prepared {
        groups,
        is_one_size: coarse.gathered.is_empty(),
        fine: keep_fine.then_some((&fine.places[..], rows_fine)),
        coarse: (&coarse.places, rows(coarse, &left_coarse, beside)?),
    })
}

/// Width of a group of disparities, px: a thirtieth of the pixel-locking period.
const DISPARITY_GROUP_PX: f64 = 1.0 / 30.0;
const EDGE_GROUP_PX: f64 = 0.5;

/// A view's samples grouped in steps of one coordinate.
pub struct Grouping {
    over: Coordinate,
    /// Mean place of each group's samples.
    pub(super) places: Vec<PixelContext>,
    /// The group of each sample.
    pub(super) of: Vec<u32>,
}

impl Grouping {
    /// Groupings by each coordinate that a shape may depend on alone.
    pub fn all(view: &ViewData) -> Vec<Self> {
        let side = SIDE as f64;
        let steps = [
            (Coordinate::Column, side),
            (Coordinate::Row, side),
            (Coordinate::Disparity, DISPARITY_GROUP_PX),
            (Coordinate::Edge, EDGE_GROUP_PX),
        ];
        steps.map(|(over, step)| Grouping::by(&view.places, over, step)).into()
    }

    /// Merges each group's samples.
    fn merge<'a>(&self, rows: &Rows<'a>) -> Rows<'a> {
        rows.grouped(self.places.len(), |i| self.of[i] as usize)
    }

    fn by(places: &[PixelContext], over: Coordinate, step: f64) -> Self {
        let low = places.iter().map(|p| over.value(p)).fold(f64::INFINITY, f64::min);
        let of: Vec<u32> = places.iter().map(|p| ((over.value(p) - low) / step) as u32).collect();
        let count = of.iter().map(|&k| k as usize + 1).max().unwrap_or(0);
        let mut sums = vec![(PixelContext::default(), [0.0; 6], 0.0); count];
        for (p, &k) in places.iter().zip(&of) {
            let (first, sum, n) = &mut sums[k as usize];
            *first = *p;
            *n += 1.0;
            let values = [p.u, p.v, p.disparity, p.z, p.edge, p.radius];
            sum.iter_mut().zip(values).for_each(|(s, v)| *s += v);
        }
        let mean = |(place, sum, n): &(PixelContext, [f64; 6], f64)| {
            let [u, v, disparity, z, edge, radius] = sum.map(|s| s / f64::max(*n, 1.0));
            PixelContext { u, v, disparity, z, edge, radius, ..*place }
        };
        Grouping { over, places: sums.iter().map(mean).collect(), of }
    }
}

impl Prepared<'_> {
    /// Samples that a basis is tried on.
    pub(super) fn samples(&self, basis: &Basis) -> (&[PixelContext], &Rows<'_>) {
        let alone = basis.alone().and_then(|over| self.groups.iter().find(|g| g.0.over == over));
        if let Some((group, rows)) = alone {
            (&group.places, rows)
        } else if let Some((places, rows)) = self.fine.as_ref().filter(|_| basis.needs_tiles()) {
            (places, rows)
        } else {
            (self.coarse.0, &self.coarse.1)
        }
    }

    /// Evidence on the terms fitted alongside and the basis.
    pub fn evidence(&self, basis: &Basis) -> Evidence {
        let (places, rows) = self.samples(basis);
        rows.evidence(basis, places)
    }
}
