//! One view as the searches see it: its tiles and their weights.

use std::sync::Arc;

use nalgebra::Vector3;

use super::samples::{ViewData, finite};
use super::tiles::Tile;
use crate::solve::plane_through;
use crate::stats::Correlation;
use crate::terms::PixelContext;

/// A view reduced to tiles.
#[derive(Clone)]
pub struct SurveyedView {
    pub name: String,
    /// Shared, like the tiles, by surveys of a subset of the views and by all samples.
    pub places: Arc<Vec<PixelContext>>,
    /// One per place.
    pub tiles: Arc<Vec<Tile>>,
    /// Variance of a pixel's mean in units of the model's, times pixels per independent sample.
    pub inflation: f64,
    pub correlation: Correlation,
    /// Effective number of independent frames for the view's variance.
    pub frames: f64,
    /// Further inflation of the variance of its log variance.
    pub log_variance_inflation: f64,
    /// Further inflation of the mean's variance by errors common to whole rows.
    pub row_inflation: f64,
    /// Sum of the correlation due to these row errors alone.
    pub row_correlation: f64,
    /// Factor from the variance between frames to the full noise variance; `None` with a single frame, or
    /// where frames share nearly all of their noise.
    pub between_frame_factor: Option<f64>,
    /// Whether it is in the second of the halves that a finding must replicate in.
    pub in_second_half: bool,
}

/// Bias of the mean disparity where the noise is Gaussian in depth, px: the mean of an inverse, to second
/// order. Relative to the noise it is noise over distance, a hundredth at 4 m, and it is curved across a
/// tilted target.
fn mean_off(p: &PixelContext) -> f64 {
    p.variance / p.disparity
}

/// Nuisances of a view's mean: a plane, and a [`mean_off`].
pub fn mean_nuisance(p: &PixelContext) -> [f64; 4] {
    [1.0, p.x, p.y, finite(mean_off(p))]
}

/// Prior precision of each of these. Whether the noise is Gaussian in depth is not known, so the last prior
/// is wide: twenty views that are all off by one cost a nat together.
pub const MEAN_PRECISION: [f64; 4] = [0.0, 0.0, 0.0, 0.1];

/// Mean residuals, about a plane of the view's own.
pub fn mean_data(view: &SurveyedView) -> ViewData {
    let tiles = &view.tiles;
    ViewData {
        places: Arc::clone(&view.places),
        response: tiles.iter().map(|t| finite(t.mean)).collect(),
        weight: tiles.iter().map(|t| view.weight(t)).collect(),
        nuisance: view.places.iter().flat_map(mean_nuisance).collect(),
        precision: MEAN_PRECISION.to_vec(),
        gathered: Vec::new(),
    }
}

impl SurveyedView {
    /// Inverse variance of a tile's mean, 1/px^2.
    pub fn weight(&self, tile: &Tile) -> f64 {
        finite(tile.pixels / tile.variance / self.inflation / self.row_inflation)
    }

    /// Weight of all tiles together.
    pub fn whole_weight(&self) -> f64 {
        self.tiles.iter().map(|t| self.weight(t)).sum()
    }

    /// Ratio of a pixel's noise variance, measured between frames, to the model's; `None` without frames to
    /// compare. Tiles of which the model says nothing are ignored.
    pub fn noise_by_frames(&self) -> Option<f64> {
        let told = || self.tiles.iter().filter(|t| t.temporal.is_finite());
        let sum = |of: fn(&Tile) -> f64| told().map(|t| t.pixels * of(t)).sum::<f64>();
        let ratio = self.between_frame_factor? * sum(|t| t.temporal) / sum(|t| t.variance);
        (ratio > 0.0).then_some(ratio)
    }

    /// Raises the total weight to this one if that is more, and takes over its correlation. The inflations of
    /// two runs are not comparable: each is relative to its own sigma.
    pub fn weigh_more(&mut self, (weight, correlation): (f64, Correlation)) {
        let own = self.whole_weight();
        if weight > own && own > 0.0 {
            self.inflation *= own / weight;
            self.correlation = correlation;
        }
    }

    /// Each tile with its place.
    pub fn patches(&self) -> impl Iterator<Item = (&PixelContext, &Tile)> {
        self.places.iter().zip(self.tiles.iter())
    }

    /// Same with mutable tiles; the places stay shared.
    pub fn tiles_mut(&mut self) -> impl Iterator<Item = (&PixelContext, &mut Tile)> {
        self.places.iter().zip(Arc::make_mut(&mut self.tiles))
    }

    /// Same with mutable places and tiles.
    pub fn patches_mut(&mut self) -> impl Iterator<Item = (&mut PixelContext, &mut Tile)> {
        Arc::make_mut(&mut self.places).iter_mut().zip(Arc::make_mut(&mut self.tiles))
    }

    /// Plane through one value a patch, over the patches that have a mean, weighted by their pixels.
    pub fn plane_through(&self, values: impl Iterator<Item = f64>) -> Option<Vector3<f64>> {
        let measured = self.patches().zip(values).filter(|((_, t), _)| t.mean.is_finite());
        plane_through(measured.map(|((p, t), value)| ([p.x, p.y], value, t.pixels)))
    }
}

#[cfg(test)]
impl SurveyedView {
    /// View of white noise with unit inflations.
    pub fn white(patches: impl IntoIterator<Item = (PixelContext, Tile)>, frames: f64) -> Self {
        let (places, tiles): (Vec<_>, Vec<_>) = patches.into_iter().unzip();
        SurveyedView {
            name: "0".into(),
            places: Arc::new(places),
            tiles: Arc::new(tiles),
            inflation: 1.0,
            correlation: Correlation::white(),
            frames,
            log_variance_inflation: 1.0,
            row_inflation: 1.0,
            row_correlation: 1.0,
            between_frame_factor: Some(1.0),
            in_second_half: false,
        }
    }
}

#[cfg(test)]
#[path = "surveyed_view_tests.rs"]
mod tests;
