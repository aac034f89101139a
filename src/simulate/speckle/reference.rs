//! What the matcher compares with: the pattern on a plane, recorded at the factory.

use super::picture::Picture;
use super::scores::{LANES, window_sums};

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

/// The stored reference in 8 bits, its rows mirrored (see [`super::scores::RowPair`]).
pub struct Reference {
    pub candidates: Candidates,
    pub half_window: usize,
    columns: usize,
    grey: Vec<f32>,
    mean: Vec<f32>,
    /// One over the root of the summed squares about the mean; zero where nothing is to be seen.
    weight: Vec<f32>,
}

/// One row of [`Reference`].
#[derive(Clone, Copy)]
pub struct ReferenceRow<'a> {
    pub grey: &'a [f32],
    pub mean: &'a [f32],
    pub weight: &'a [f32],
}

impl Reference {
    pub fn store(picture: &Picture, candidates: Candidates, half_window: usize) -> Self {
        let top = picture.dn.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
        let grey: Vec<u32> = picture
            .dn
            .chunks_exact(picture.width)
            .flat_map(|row| row.iter().rev().map(|dn| (dn / top * 255.0).round() as u32))
            .collect();
        let squares: Vec<u32> = grey.iter().map(|g| g * g).collect();
        let sums = window_sums(&grey, picture.width, half_window);
        let square_sums = window_sums(&squares, picture.width, half_window);
        let area = ((2 * half_window + 1) as f32).powi(2);
        let weight = |(&sum, &squares): (&u32, &u32)| {
            let about_mean = squares as f32 - sum as f32 * sum as f32 / area;
            if about_mean > 0.0 { about_mean.sqrt().recip() } else { 0.0 }
        };
        Reference {
            candidates,
            half_window,
            columns: picture.width,
            grey: grey.iter().map(|&g| g as f32).collect(),
            mean: sums.iter().map(|&s| s as f32 / area).collect(),
            weight: sums.iter().zip(&square_sums).map(weight).collect(),
        }
    }

    pub fn row(&self, v: usize) -> ReferenceRow<'_> {
        let span = v * self.columns..(v + 1) * self.columns;
        ReferenceRow {
            grey: &self.grey[span.clone()],
            mean: &self.mean[span.clone()],
            weight: &self.weight[span],
        }
    }
}
