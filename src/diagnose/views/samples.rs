//! The samples a search works on.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::Vector3;

use super::tiles::SIDE;
use crate::diagnose::search::rows::Rows;
use crate::solve::plane_through;
use crate::terms::{PixelContext, Term};

/// One view's samples.
#[derive(Clone, Default)]
pub struct ViewData {
    /// Shared by all data at the same places.
    pub places: Arc<Vec<PixelContext>>,
    pub response: Vec<f64>,
    pub weight: Vec<f64>,
    /// Row-major, as many columns as `precision` has entries.
    pub nuisance: Vec<f64>,
    /// Prior precision of each nuisance about zero; 0 leaves it free.
    pub precision: Vec<f64>,
    /// For larger patches: index of the patch that each finer sample went to.
    pub gathered: Vec<u32>,
}

impl ViewData {
    /// Weighted rows of a `response` at these places, with the view's nuisances.
    pub fn rows(&self, response: &[f64]) -> Option<Rows<'_>> {
        Rows::new(response, &self.weight, &self.nuisance, self.precision.len(), &self.precision)
    }

    /// The plane 1, x, y through `values` at these places.
    pub fn plane_of(&self, values: &[f64]) -> Option<Vector3<f64>> {
        let points = self.places.iter().zip(values).zip(&self.weight);
        plane_through(points.map(|((p, y), w)| ([p.x, p.y], *y, *w)))
    }

    /// Weighted mean of the response, and the total weight.
    pub fn level(&self) -> Option<(f64, f64)> {
        let weight: f64 = self.weight.iter().sum();
        let sum: f64 = self.response.iter().zip(&self.weight).map(|(y, w)| w * y).sum();
        (weight > 0.0).then(|| (sum / weight, weight))
    }

    /// Response with these terms subtracted.
    pub fn without(&self, terms: &[Term]) -> Vec<f64> {
        let samples = self.response.iter().zip(self.places.iter());
        samples.map(|(y, place)| y - Term::sum(terms, place)).collect()
    }

    /// Adds these terms to the view's nuisances, each with a standard normal amplitude.
    pub fn beside(self, terms: &[Term]) -> Self {
        self.beside_columns(terms.len(), |place| terms.iter().map(|t| t.value(place)).collect())
    }

    /// Same for `count` columns, by place.
    pub fn beside_columns(
        mut self,
        count: usize,
        columns: impl Fn(&PixelContext) -> Vec<f64>,
    ) -> Self {
        if count == 0 {
            return self;
        }
        let own = self.nuisance.chunks_exact(self.precision.len()).zip(self.places.iter());
        let with = |(own, place): (&[f64], &PixelContext)| {
            own.iter().copied().chain(columns(place).into_iter().map(finite)).collect::<Vec<f64>>()
        };
        self.nuisance = own.flat_map(with).collect();
        self.precision.resize(self.precision.len() + count, 1.0);
        self
    }
}

pub fn finite(v: f64) -> f64 {
    if v.is_finite() { v } else { 0.0 }
}

/// Side of a larger patch, px: two tiles.
pub const COARSE_PX: f64 = (2 * SIDE) as f64;

/// Number of patches across the picture when searching smooth shapes. In the proof's pictures, 320 px wide, a
/// patch is then two tiles wide.
const PATCHES_ACROSS: usize = 40;

/// Side of these patches in a picture `width` px wide: whole tiles, px.
pub fn smooth_px(width: usize) -> f64 {
    ((width / PATCHES_ACROSS / SIDE * SIDE) as f64).max(COARSE_PX)
}

/// Indices of the places in each patch of this side (px), row by row. Places with different keys `apart` go
/// to separate patches; those without a key go to none.
pub fn in_patches<K: Ord>(
    places: &[PixelContext],
    side: f64,
    apart: impl Fn(usize) -> Option<K>,
) -> Vec<Vec<usize>> {
    let mut patches: BTreeMap<(u32, u32, K), Vec<usize>> = BTreeMap::new();
    for (i, place) in places.iter().enumerate() {
        let Some(own) = apart(i) else { continue };
        let key = ((place.v / side) as u32, (place.u / side) as u32, own);
        patches.entry(key).or_default().push(i);
    }
    patches.into_values().collect()
}

/// Averages tiles over patches of this side, px.
pub fn coarser(fine: &ViewData, side: f64) -> ViewData {
    let p = fine.precision.len();
    let groups = in_patches(&fine.places, side, |_| Some(()));
    let mut coarse = ViewData {
        places: Arc::default(),
        response: Vec::with_capacity(groups.len()),
        weight: Vec::with_capacity(groups.len()),
        nuisance: Vec::with_capacity(groups.len() * p),
        precision: fine.precision.clone(),
        gathered: vec![0; fine.places.len()],
    };
    let mut places = Vec::with_capacity(groups.len());
    for (k, members) in groups.iter().enumerate() {
        members.iter().for_each(|&i| coarse.gathered[i] = k as u32);
        let weight: f64 = members.iter().map(|&i| fine.weight[i]).sum();
        let mean = |of: &dyn Fn(usize) -> f64| {
            if weight > 0.0 {
                members.iter().map(|&i| fine.weight[i] * of(i)).sum::<f64>() / weight
            } else {
                of(members[0])
            }
        };
        let mut place = fine.places[members[0]];
        place.average(&fine.places, &mean);
        place.side = side;
        places.push(place);
        coarse.response.push(mean(&|i| fine.response[i]));
        coarse.weight.push(weight);
        coarse.nuisance.extend((0..p).map(|q| mean(&|i| fine.nuisance[i * p + q])));
    }
    coarse.places = Arc::new(places);
    coarse
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_of_smooth_shapes_grow_with_the_picture_in_whole_tiles() {
        let widths = [160, 320, 512, 640, 1280];
        assert_eq!(widths.map(smooth_px), [8.0, 8.0, 12.0, 16.0, 32.0]);
    }
}
