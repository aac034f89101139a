//! Evidence of single views, for candidates that only some of the views may show.

use rayon::prelude::*;

use super::evidence::{self, Evidence};
use super::prepared::{Grouping, Prepared, prepare};
use super::view_levels::scatter_of_most;
use super::view_worth::{doubted, left_over};
use crate::diagnose::finding::scene::Scene;
use crate::diagnose::views::samples::{COARSE_PX, ViewData, coarser};
use crate::diagnose::views::tiles::SIDE;
use crate::terms::{Basis, PixelContext, Statistic, Term};

/// Distance from the edge, px, within which background may be taken for the target's rim; in a single
/// view no other outvotes it.
const RIM_PX: f64 = SIDE as f64;
/// Factor on a weight that keeps a sample but makes it negligible.
const NEXT_TO_NONE: f64 = 1e-9;

/// A layer's views with the terms that all of them share subtracted.
pub struct EachView {
    fine: Vec<ViewData>,
    coarse: Vec<ViewData>,
    groups: Vec<Vec<Grouping>>,
    doubted: Vec<f64>,
}

/// The same views, prepared for the candidates.
pub struct Views<'a> {
    of: &'a EachView,
    /// `None` for a view without information.
    prepared: Vec<Option<Prepared<'a>>>,
    prior: f64,
}

impl EachView {
    /// `excess` is the factor by which each view's variance exceeds what its samples imply, where lines
    /// or views err alike.
    pub fn of(scene: &Scene<'_>, fine: &[ViewData], shared: &[Term], excess: &[f64]) -> Self {
        let of_mean = scene.statistic == Statistic::Bias;
        let doubted = if of_mean { doubted(scene.survey) } else { vec![1.0; fine.len()] };
        let alone = |(n, v): (usize, &ViewData)| {
            let share = |p: &PixelContext| if p.edge < RIM_PX { NEXT_TO_NONE } else { 1.0 };
            let sure = doubted[n] / excess.get(n).unwrap_or(&1.0);
            let weight =
                v.places.iter().map(share).zip(&v.weight).map(|(s, w)| s * w * sure).collect();
            ViewData { response: v.without(shared), weight, ..v.clone() }
        };
        let mut fine: Vec<ViewData> = fine.iter().enumerate().map(alone).collect();
        if !of_mean && let Some(whole) = fine.first().and_then(|v| v.precision.first()) {
            let precision = 1.0 / scatter_of_most(&fine, 1.0 / whole);
            fine.iter_mut().for_each(|v| v.precision[0] = precision);
        }
        let coarse: Vec<ViewData> = if of_mean {
            fine.par_iter().map(|v| coarser(v, COARSE_PX)).collect()
        } else {
            fine.clone()
        };
        EachView::grouped(fine, coarse, doubted)
    }

    fn grouped(fine: Vec<ViewData>, coarse: Vec<ViewData>, doubted: Vec<f64>) -> Self {
        let groups = fine.par_iter().map(Grouping::all).collect();
        EachView { fine, coarse, groups, doubted }
    }

    pub fn prepared(&self, prior: f64) -> Views<'_> {
        let EachView { fine, coarse, groups, .. } = self;
        let prepared = |v: usize| prepare(&fine[v], &coarse[v], &groups[v], true, &[], &[]);
        let prepared = (0..fine.len()).into_par_iter().map(prepared).collect();
        Views { of: self, prepared, prior }
    }
}

impl Views<'_> {
    /// Evidence of each view; a doubted view counts for less the more these columns leave.
    pub fn evidence(&self, basis: &Basis) -> Option<Vec<Evidence>> {
        let nothing = || Evidence::zeros(basis.count());
        let of = |p: &Option<Prepared<'_>>| p.as_ref().map_or_else(nothing, |p| p.evidence(basis));
        let mut all: Vec<Evidence> = self.prepared.iter().map(of).collect();
        let EachView { fine, coarse, doubted, .. } = self.of;
        let data = if basis.needs_tiles() { fine } else { coarse };
        let views = all.iter_mut().zip(data).zip(doubted);
        for ((e, view), doubt) in views.filter(|(_, d)| **d > 1.0) {
            let beta = evidence::fit(std::slice::from_ref(e), self.prior)?;
            let left = left_over(view, basis, beta.as_slice()).clamp(1.0, *doubt);
            e.a /= left;
            e.b /= left;
        }
        Some(all)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::terms::{Coordinate, Modulation};

    /// A view without data takes no part and does not affect the others.
    #[test]
    fn a_view_that_says_nothing_leaves_the_others_alone() {
        let place = |k: usize| PixelContext { u: k as f64, side: 4.0, ..Default::default() };
        let view = |weight: f64| ViewData {
            places: Arc::new((0..9).map(place).collect()),
            response: (0..9).map(f64::from).collect(),
            weight: vec![weight; 9],
            nuisance: vec![1.0; 9],
            precision: vec![0.0],
            ..ViewData::default()
        };
        let slope = Basis::powers(Coordinate::Column, 1, Modulation::One);
        let data = vec![view(1.0), view(0.0)];
        let each = EachView::grouped(data.clone(), data, vec![1.0; 2]);
        let all = each.prepared(1.0).evidence(&slope).unwrap();
        assert!(all[0].a.trace() > 1.0 && all[1].a.trace() == 0.0, "{all:?}");
    }
}
