//! One view as the searches see it: its tiles and their weights.

use std::sync::Arc;

use nalgebra::Vector3;

use super::box_sums::{SMOOTH_PX, take_out_cubic};
use super::field::Field;
use super::samples::{ViewData, finite};
use super::tiles::Tile;
use crate::diagnose::noise::texture::{same_pixel, without_bias};
use crate::solve::plane_through;
use crate::stats::{Correlation, measure_correlation};
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

/// Inflation of the variance of a pixel's mean: its ratio to the model's, times the pixels per independent
/// sample; and the pixels' correlation. Measured after subtracting smooth errors and the known bias (px, by
/// pixel, or empty).
pub fn inflation(field: &Field, bias: &[f32]) -> (f64, Correlation) {
    let cut = field.cut_to_target();
    let rough = whitened_high_passed(&without_bias(&field.mean, bias), field, &cut);
    let (mut sum, mut n) = (0.0, 0.0);
    for r in rough.iter().filter(|r| r.is_finite()) {
        sum += f64::from(*r).powi(2);
        n += 1.0;
    }
    let mut correlation = measure_correlation(&rough, cut.width);
    let taken = restore_sum(&mut correlation);
    let ratio = sum / n / (1.0 - taken);
    let inflation = if n > 0.0 { (ratio * correlation.sum).max(1e-6) } else { f64::INFINITY };
    (inflation, correlation)
}

/// Restores the sum of the correlation from before the high-pass; returns the share of the variance that the
/// high-pass took. A box mean of B pixels, subtracted, lowers the covariance at all lags within the box by the
/// share t = C / B of the variance, where C is the sum of the correlation there: rho' = (rho - t) / (1 - t). A
/// correlation that does not die out is a smooth error rather than noise, and stays as measured.
fn restore_sum(correlation: &mut Correlation) -> f64 {
    /// Each shrinks the error by t: from a fifth to less than a hundredth.
    const ROUNDS: usize = 3;
    const REACH: usize = SMOOTH_PX / 2;
    /// Largest share, that of a window of 35 px.
    const MAX_TAKEN: f64 = 0.5;
    if correlation.persists {
        return 0.0;
    }
    let two_sided = |rho: &[f64]| 2.0 * rho.iter().sum::<f64>();
    let mut taken = 0.0;
    for _ in 0..ROUNDS {
        let [across, down] = [&correlation.along_u, &correlation.along_v].map(|rho| {
            let (near, far) = rho[1..].split_at(REACH.min(rho.len() - 1));
            let lags = 1.0 + 2.0 * near.len() as f64;
            let near = (1.0 - taken) * (1.0 + two_sided(near)) + taken * lags;
            [near, near + two_sided(far)]
        });
        correlation.sum = (across[1] * down[1]).max(1.0);
        taken = (across[0] * down[0] / (SMOOTH_PX * SMOOTH_PX) as f64).clamp(0.0, MAX_TAKEN);
    }
    taken
}

/// Whitened and high-passed residuals as an image of the target alone, `cut`.
fn whitened_high_passed(residuals: &[f32], field: &Field, cut: &Field) -> Vec<f32> {
    let mut whitened: Vec<f32> = residuals.iter().zip(&field.sigma).map(|(r, s)| r / s).collect();
    // On a target not much larger than the box, the high-pass leaves most of a bowl. It would count as
    // correlated noise: the stronger the bowl, the less of it would be detected.
    take_out_cubic(&mut whitened, &cut.pixels, cut.width);
    cut.high_passed(&whitened)
}

/// Effective number of independent frames: 1 / (rho^2 + (1 - rho^2) / F) for F frames whose noise has the
/// correlation rho.
pub fn independent_frames(field: &Field) -> f64 {
    let [first, second, ..] = field.first.as_slice() else { return 1.0 };
    let cut = field.cut_to_target();
    let [first, second] = [first, second].map(|f| whitened_high_passed(f, field, &cut));
    let rho = same_pixel(&first, &second);
    let rho = if rho.is_finite() { rho.clamp(0.0, 1.0) } else { 0.0 };
    let frames = field.frames.len() as f64;
    1.0 / (rho * rho + (1.0 - rho * rho) / frames)
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
mod tests {
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::diagnose::views::blocks::{BLOCK_TILES, blocks};
    use crate::diagnose::views::tiles::SIDE;
    use crate::plane::Plane;
    use crate::rng::Seed;
    use crate::simulate::kinect_v1;
    use crate::stats::noise_through_boxes;
    use crate::terms::{Basis, Coordinate, Modulation};

    /// White noise averaged over boxes: the variance of the mean over the whole target is `side`^2 times that of
    /// independent pixels, which the high-pass must not hide. The small correlations at the longest lags are lost.
    #[test]
    fn the_high_pass_takes_nothing_from_the_inflation() {
        const SIZE: [usize; 2] = [320, 240];
        for (side, least) in [(1, 0.98), (5, 0.95), (9, 0.92)] {
            let mut rng = Seed(side as u64).stream("inflation");
            let noise = noise_through_boxes(SIZE, side, &mut rng);
            let n = noise.len();
            let field = Field {
                sigma: vec![1.0; n],
                mean: noise.iter().map(|e| *e as f32).collect(),
                ..Field::unseen(Plane::tilted(1.0, 0.0, 0.0), 10.0, SIZE, (0..n as u32).collect())
            };
            let ratio = inflation(&field, &[]).0 / (side * side) as f64;
            assert!((least..1.06).contains(&ratio), "{side}: {ratio}");
        }
    }

    /// A tilted wall seen by a sensor of Eq. 1 whose noise is Gaussian in depth; the means are noise-free.
    fn view() -> SurveyedView {
        let sensor = kinect_v1(1);
        let (camera, scale) = (&sensor.camera, 43.5);
        let plane = Plane::tilted(3.5, 1.0, 0.7);
        let mut patches = Vec::new();
        for v in (SIDE / 2..camera.height).step_by(SIDE) {
            for u in (SIDE / 2..camera.width).step_by(SIDE) {
                let (u, v) = (u as f64, v as f64);
                let (x, y) = camera.ray(u, v);
                let z = plane.depth(x, y);
                if !(0.5..8.0).contains(&z) {
                    continue;
                }
                let (disparity, sigma_m) = (scale / z, 0.0015 + 0.00215 * (z - 0.483).powi(2));
                let variance = (sigma_m * disparity / z).powi(2);
                let (side, radius) = (SIDE as f64, x.hypot(y));
                let own = PixelContext {
                    u,
                    v,
                    x,
                    y,
                    z,
                    disparity,
                    variance,
                    side,
                    radius,
                    ..Default::default()
                };
                let mean = disparity * (sigma_m / z).powi(2);
                // Thirty frames.
                let noise = Tile::of_noise(variance, 30.0 * side * side);
                patches.push((own, Tile { mean, ..noise }));
            }
        }
        SurveyedView::white(patches, 30.0)
    }

    /// Halving sigma in a refit leaves a view's weight unchanged. An inflation raised threefold by an effect
    /// missing from the model does not lower it.
    #[test]
    fn a_view_keeps_its_weight_whatever_sigma_is() {
        let first = view();
        let near = Correlation { sum: 3.0, ..Correlation::white() };
        let weights = (first.whole_weight(), near.clone());
        let mut refitted = view();
        refitted.tiles_mut().for_each(|(_, tile)| tile.variance /= 4.0);
        refitted.inflation *= 4.0;
        refitted.weigh_more(weights.clone());
        assert_eq!(refitted.inflation, 4.0 * first.inflation);
        assert_eq!(refitted.correlation, Correlation::white());
        refitted.inflation *= 3.0;
        refitted.weigh_more(weights);
        assert_eq!(refitted.correlation, near);
        approx::assert_relative_eq!(
            refitted.whole_weight(),
            first.whole_weight(),
            max_relative = 1e-12
        );
    }

    /// Noise with another named cause changes the log variance that is left, not the weights of the means.
    #[test]
    fn what_the_noise_is_held_against_does_not_weigh_the_means() {
        let first = view();
        let mut held = view();
        held.tiles_mut().for_each(|(_, tile)| tile.noise_variance *= 2.0);
        assert_eq!(mean_data(&held).weight, mean_data(&first).weight);
        let [before, after] = [&first, &held].map(|v| blocks(v, BLOCK_TILES, false, None).response);
        assert!(!before.is_empty());
        for (before, after) in before.iter().zip(&after) {
            approx::assert_relative_eq!(before - after, 2f64.ln(), epsilon = 1e-12);
        }
    }

    /// Twice the model's variance in four frames, and a tile outside the model's domain.
    #[test]
    fn frames_tell_the_noise_where_the_model_says_something() {
        let mut view = SurveyedView { between_frame_factor: Some(4.0 / 3.0), ..view() };
        view.tiles_mut().for_each(|(_, t)| t.temporal = 0.75 * 2.0 * t.variance);
        view.tiles_mut().take(1).for_each(|(_, t)| t.temporal = f64::NAN);
        approx::assert_relative_eq!(view.noise_by_frames().expect("noise"), 2.0, epsilon = 1e-9);
        view.between_frame_factor = None;
        assert_eq!(view.noise_by_frames(), None);
    }

    /// With planes alone it looks like a bowl: a nat in each view, and views add up.
    #[test]
    fn noise_that_is_gaussian_in_the_depth_is_no_bowl() {
        let data = mean_data(&view());
        let bowl = Basis::powers(Coordinate::RadiusSquared, 2, Modulation::One);
        let nats = |data: &ViewData| {
            let rows = data.rows(&data.response).expect("nuisances that can be told apart");
            let seen = rows.evidence(&bowl, &data.places);
            0.5 * seen.b.dot(&(seen.a.try_inverse().expect("two columns") * &seen.b))
        };
        let planes = ViewData {
            nuisance: data.nuisance.chunks_exact(4).flat_map(|n| n[..3].to_vec()).collect(),
            precision: vec![0.0; 3],
            ..data.clone()
        };
        // The mean disparity of simulated Gaussian depths is too large by the same amount.
        let mut rng = Seed(1).stream("mean-off");
        let (z, sigma_m, mut sum) = (4.0, 0.2, 0.0);
        for _ in 0..200_000 {
            let normal: f64 = StandardNormal.sample(&mut rng);
            let both = [normal, -normal].map(|n| 43.5 / (z + sigma_m * n));
            sum += (both[0] + both[1]) / 400_000.0;
        }
        let (disparity, variance) = (43.5 / z, (43.5 * sigma_m / (z * z)).powi(2));
        let own = PixelContext { z, disparity, variance, ..Default::default() };
        approx::assert_relative_eq!(sum - disparity, mean_off(&own), max_relative = 0.03);
        let (with, without) = (nats(&data), nats(&planes));
        println!("{with:.3} nats, by planes alone {without:.1}");
        assert!(without > 1.0 && with < 0.01, "{with} {without}");
    }
}
