//! Size of the noise in blocks large enough for a variance.

use std::sync::Arc;

use super::box_sums::SMOOTH_PX;
use super::samples::{ViewData, in_patches};
use super::surveyed_view::SurveyedView;
use super::tiles::SIDE;
use crate::diagnose::steps::rounding::Rounding;
use crate::stats::median;
use crate::terms::DARKEST;

/// Widest side of a block, in tiles: 24 px, seven independent samples under a Kinect's window.
pub const BLOCK_TILES: usize = 6;
/// The least: narrower ones have hardly a pixel without the rim of a tile.
const MIN_TILES: usize = 2;
/// Least number of independent samples in half a block of the median view. Beyond -1/n, the mean of
/// log chi squared is then off by a five-hundredth of its standard deviation.
const WORTH: f64 = 24.0;
/// Picture width that [`BLOCK_TILES`] is meant for, px; blocks shrink with narrower pictures.
const WIDTH_PX: usize = 640;

/// Side of the blocks for these views of a picture `width` px wide, in tiles.
pub fn block_tiles(views: &[SurveyedView], width: usize) -> usize {
    let mut per_px: Vec<f64> =
        views.iter().map(|v| v.frames / v.correlation.sum_of_squares.max(1.0)).collect();
    let per_px = median(&mut per_px);
    let large = |tiles: &usize| {
        let pixels = ((tiles * SIDE) as f64).powi(2);
        tiles * WIDTH_PX >= BLOCK_TILES * width && MIN_FILLED * pixels * per_px >= WORTH
    };
    (MIN_TILES..BLOCK_TILES).find(large).unwrap_or(BLOCK_TILES)
}

/// Log ratio of the measured variance to the model's, block by block, with the view's own level as a free
/// nuisance. With `by_light`, blocks are split by light: the mean over light and dark parts would be the
/// noise of neither.
pub fn blocks(
    view: &SurveyedView,
    tiles: usize,
    by_light: bool,
    rounding: Option<&Rounding>,
) -> ViewData {
    let side = (tiles * SIDE) as f64;
    let first = view.places.first().map_or(1.0, |p| p.light);
    let lit = by_light && view.places.iter().any(|p| p.light != first);
    let min = if lit { MIN_LIT } else { MIN_FILLED } * side * side;
    // With frames to compare, only what changes is noise; the factor restores the part that frames share.
    let noise = |i: usize| match (&view.tiles[i], view.between_frame_factor) {
        (t, Some(factor)) => (t.temporal * factor, t.repeated),
        (t, None) => (t.temporal + t.rough_square, 1.0),
    };
    let octave =
        |i: usize| if lit { view.places[i].light.max(DARKEST).log2().floor() as i32 } else { 0 };
    let is_measured = |i: usize| view.tiles[i].pixels > 0.0 && noise(i).0.is_finite();
    let groups = in_patches(&view.places, side, |i| is_measured(i).then(|| octave(i)));
    // Share of the variance removed with the box mean.
    let taken = view.correlation.sum / (SMOOTH_PX * SMOOTH_PX) as f64;
    let between = view.between_frame_factor.is_some();
    let kept = if between { 1.0 } else { 1.0 - taken };
    let mut blocks = ViewData { precision: vec![0.0], ..ViewData::default() };
    blocks.precision.resize(1 + rounding.map_or(0, |_| Rounding::COLUMNS), 1.0);
    for group in groups {
        let sum = |of: &dyn Fn(usize) -> f64| -> f64 {
            group.iter().map(|&i| view.tiles[i].pixels * of(i)).sum()
        };
        let (n, repeated) = (sum(&|_| 1.0), sum(&|i| noise(i).1));
        let ratio = sum(&|i| noise(i).1 * noise(i).0 / view.tiles[i].noise_variance);
        if n < min || ratio <= 0.0 {
            continue;
        }
        let worth = repeated * view.frames / view.correlation.sum_of_squares;
        let within = repeated * view.frames / view.correlation.sum_of_squares_within(n.sqrt());
        let mut place = view.places[group[0]];
        place.average(&view.places, &|of| sum(of) / n);
        // Variances add up, and shot noise is proportional to 1 / light.
        place.light = n / sum(&|i| 1.0 / view.places[i].light);
        Arc::make_mut(&mut blocks.places).push(place);
        // The mean of log chi^2 / n is about -1 / n. Pixels correlate with others outside the block, which
        // lowers the information of all blocks together but not that of one.
        let rounded = rounding.map(|r| r.of_log_variance(&view.places, &|of| sum(of) / n, between));
        let (waves, level) = rounded.unzip();
        let level = level.unwrap_or(0.0) - 1.0 / within;
        blocks.response.push((ratio / repeated / kept.max(0.5)).ln() - level);
        blocks.weight.push(0.5 * worth / (1.0 + 1.0 / worth) / view.log_variance_inflation);
        blocks.nuisance.push(1.0);
        blocks.nuisance.extend(waves.iter().flatten());
    }
    blocks
}

/// Least share of a block that must be filled: a few pixels at the rim give no variance.
const MIN_FILLED: f64 = 0.5;
/// Same where blocks are split by light.
const MIN_LIT: f64 = 0.125;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::views::tiles::Tile;
    use crate::terms::PixelContext;

    /// Blocks cover the same share of the picture, but no fewer independent samples than a variance needs.
    #[test]
    fn blocks_are_as_small_as_the_picture_and_the_noise_allow() {
        let tiles = |width, frames, sum_of_squares| {
            let mut view = SurveyedView::white([], frames);
            view.correlation.sum_of_squares = sum_of_squares;
            block_tiles(&[view], width)
        };
        assert_eq!([1280, 640, 320, 160].map(|width| tiles(width, 4.0, 1.0)), [6, 6, 3, 2]);
        // Under a window of six pixels half a block of 8 x 8 px and 4 frames is worth 3.6 samples.
        assert_eq!([1.0, 4.0, 16.0].map(|frames| tiles(160, frames, 36.0)), [6, 6, 3]);
        assert_eq!(block_tiles(&[], 160), BLOCK_TILES);
    }

    /// A print of two greys in squares of half a block: shot noise is measured for each grey separately.
    #[test]
    fn what_is_light_and_what_is_dark_lie_apart() {
        const ACROSS: usize = 10 * BLOCK_TILES;
        let patch = |k: usize| {
            let (row, column) = (k / ACROSS, k % ACROSS);
            let square = (2 * row / BLOCK_TILES + 2 * column / BLOCK_TILES) % 2;
            let light = [0.25, 2.0][square];
            let [u, v] = [column, row].map(|place| ((place * SIDE) as f64) + 1.5);
            let noise = Tile::of_noise(1.0, (SIDE * SIDE) as f64);
            let tile = Tile { temporal: 1.0 / light, ..noise };
            (PixelContext { u, v, light, ..PixelContext::default() }, tile)
        };
        let view = SurveyedView::white((0..ACROSS * ACROSS).map(patch), 3.0);
        let data = blocks(&view, BLOCK_TILES, true, None);
        assert_eq!(data.places.len(), 200, "two parts of a hundred blocks");
        for (place, log_variance) in data.places.iter().zip(&data.response) {
            assert!([0.25, 2.0].iter().any(|grey| (place.light / grey - 1.0).abs() < 1e-9));
            // The correction of the mean of log chi^2 is one over the block's independent samples.
            assert!((log_variance + place.light.ln()).abs() < 2.0 / 400.0, "{log_variance}");
        }
        let whole = blocks(&view, BLOCK_TILES, false, None);
        assert_eq!(whole.places.len(), 100, "a simulation is compared block by block");
    }
}
