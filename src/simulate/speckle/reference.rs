//! What the matcher compares with: the pattern on a plane, recorded at the factory.

use super::correlation::{LANES, WindowedImage};
use super::image::Picture;

/// Distance of the factory's plane, m. The real one is not published; at 2 m the picture moves by
/// +22 px at 1 m and by -11 px at 4 m.
pub const REFERENCE_M: f64 = 2.0;
/// The matcher looks for surfaces between these depths, m (near mode begins at 0.4 m; beyond 8 m
/// one step is 0.2 m).
const NEAREST_M: f64 = 0.4;
const FARTHEST_M: f64 = 8.0;

/// Shifts against the reference that are tried, px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidates {
    pub first: i64,
    pub count: usize,
}

impl Candidates {
    /// All from the farthest to the nearest depth for this fx * baseline, px m.
    pub fn of(disparity_px_m: f64) -> Self {
        let shift = |z: f64| disparity_px_m * (1.0 / z - 1.0 / REFERENCE_M);
        // One more on either side, for the parabola.
        let first = shift(FARTHEST_M).floor() as i64 - 1;
        let count = (shift(NEAREST_M).ceil() as i64 + 1 - first) as usize + 1;
        Candidates { first, count: count.next_multiple_of(LANES) }
    }

    pub fn last(&self) -> i64 {
        self.first + self.count as i64 - 1
    }

    /// Of the first column of a reference that answers to all columns of a picture, and how many.
    pub fn reference_columns(&self, width: usize) -> (i64, usize) {
        (-self.last(), width + self.count - 1)
    }
}

/// The stored reference in 8 bits, its rows mirrored (see [`super::correlation::RowPair`]).
pub struct Reference {
    pub candidates: Candidates,
    pub half_window: usize,
    pub image: WindowedImage,
    pub mean: Vec<f32>,
    /// One over the contrast; zero where nothing is to be seen.
    pub weight: Vec<f32>,
}

impl Reference {
    pub fn store(picture: &Picture, candidates: Candidates, half_window: usize) -> Self {
        let top = picture.dn.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
        let grey: Vec<u32> = picture
            .dn
            .chunks_exact(picture.width)
            .flat_map(|row| row.iter().rev().map(|dn| (dn / top * 255.0).round() as u32))
            .collect();
        let image = WindowedImage::new(&grey, picture.width, half_window);
        let area = ((2 * half_window + 1) as f32).powi(2);
        let mean = image.sum.iter().map(|s| s / area).collect();
        let weight = image.contrast.iter().map(|&c| if c > 0.0 { c.recip() } else { 0.0 });
        Reference { candidates, half_window, mean, weight: weight.collect(), image }
    }
}
