//! The matcher's reference, the pattern on a plane as recorded at the factory: its sums over the matching
//! window, and the conversion of shifts against it to 11-bit raw values.

use super::optics::Picture;
use crate::frame::{DepthCode, KINECT_NO_MEASUREMENT};
use crate::stats::SummedArea;

/// Distance of the factory's plane, m. The real one is not published; from 2 m the pattern shifts by +22 px
/// at 1 m and by -11 px at 4 m.
pub const REFERENCE_M: f64 = 2.0;
/// Depth range of the matcher, m (near mode begins at 0.4 m; at 8 m a step is 0.2 m).
const NEAREST_M: f64 = 0.4;
const FARTHEST_M: f64 = 8.0;

/// Candidate shifts against the reference, px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidates {
    pub first: i64,
    pub count: usize,
}

impl Candidates {
    /// All shifts from the farthest to the nearest depth for this fx * baseline, px m.
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
}

/// The stored reference in 8 bits, its rows mirrored (see [`RowPair`]).
pub struct Reference {
    pub candidates: Candidates,
    pub half_window: usize,
    pub image: WindowedImage,
    pub mean: Vec<f32>,
    /// Reciprocal of the contrast; zero where that is zero.
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

/// The raw value of infinity on a Kinect v1 (Fisher's 3.331 / 0.003071, OpenKinect).
const RAW_AT_INFINITY: f64 = 1084.6;

/// Read-out step of a Kinect v1, px: one raw value per step.
const USUAL_STEP_PX: f64 = 0.125;

/// Conversion of shifts to raw values, and of raw values to depths.
pub struct ReadOut {
    /// Step of the matcher, px, where it is coarser than that of the raw values.
    coarse_px: Option<f64>,
    /// fx * baseline, px m.
    disparity_px_m: f64,
    pub code: DepthCode,
}

impl ReadOut {
    /// `nearest_px` is the largest possible shift. A recorder's own disparity code is kept, so that its
    /// description does not betray the step.
    pub fn new(step_px: f64, disparity_px_m: f64, nearest_px: f64, own: &DepthCode) -> Self {
        let raw_px = step_px.min(USUAL_STEP_PX);
        let usual = RAW_AT_INFINITY - disparity_px_m / REFERENCE_M / raw_px;
        // Finer steps need more values; the nearest surface gets at least 1.
        let at_reference = usual.max(nearest_px / raw_px + 1.0).round();
        // shift = fx b (1/z - 1/reference) and shift = (at_reference - raw) raw_px, hence
        // 1/z = 1/reference + (at_reference - raw) raw_px / (fx b).
        let per_raw = raw_px / disparity_px_m;
        let code = match *own {
            DepthCode::Disparity { .. } => *own,
            DepthCode::Metric { .. } => DepthCode::Disparity {
                offset: 1.0 / REFERENCE_M + at_reference * per_raw,
                slope: -per_raw,
                invalid: KINECT_NO_MEASUREMENT,
            },
        };
        let coarse_px = (step_px > USUAL_STEP_PX).then_some(step_px);
        ReadOut { coarse_px, disparity_px_m, code }
    }

    pub fn raw(&self, shift_px: f32) -> u16 {
        let shift = f64::from(shift_px);
        let shift = self.coarse_px.map_or(shift, |step| (shift / step).round() * step);
        self.code.raw(1.0 / (1.0 / REFERENCE_M + shift / self.disparity_px_m))
    }
}

/// A picture with the sums over the window about each pixel, row-major; zero where the window does not fit.
pub struct WindowedImage {
    pub width: usize,
    pub height: usize,
    pub grey: Vec<f32>,
    pub sum: Vec<f32>,
    /// Root of the sum of squared deviations from the window's mean; zero in a uniform window.
    pub contrast: Vec<f32>,
}

impl WindowedImage {
    pub fn new(grey: &[u32], width: usize, half: usize) -> Self {
        let height = grey.len() / width;
        // Whole numbers: the sums are exact.
        let sums = SummedArea::of(width, height, |i| {
            let g = f64::from(grey[i]);
            Some([g, g * g])
        });
        let area = ((2 * half + 1) as f32).powi(2);
        let (mut sum, mut contrast) = (vec![0f32; grey.len()], vec![0f32; grey.len()]);
        for v in half..height.saturating_sub(half) {
            for u in half..width.saturating_sub(half) {
                let [total, squares] = sums.around(u, v, half).map(|s| s as f32);
                sum[v * width + u] = total;
                contrast[v * width + u] = (squares - total * total / area).max(0.0).sqrt();
            }
        }
        let grey = grey.iter().map(|&g| g as f32).collect();
        WindowedImage { width, height, grey, sum, contrast }
    }

    pub fn row<'a>(&self, values: &'a [f32], v: usize) -> &'a [f32] {
        &values[v * self.width..][..self.width]
    }
}

/// Candidates are processed in groups of this size: a multiple of any vector register.
pub const LANES: usize = 8;

/// For every column u and candidate k the products picture(u) * reference(u, k), summed over the rows of
/// the window; k varies fastest, so that every loop below vectorises.
///
/// Picture and reference hold integers of 10 and 8 bits: sums over 31 rows stay below 2^24, so single
/// precision is exact, and adding and subtracting rows accumulates no error.
pub struct ColumnProducts {
    width: usize,
    candidates: usize,
    sums: Vec<f32>,
}

/// A row of the picture and the same row of the reference, mirrored, so that the candidates of
/// column u are `reference[width - 1 - u..]` in order.
#[derive(Clone, Copy)]
pub struct RowPair<'a> {
    pub picture: &'a [f32],
    pub reference: &'a [f32],
}

impl ColumnProducts {
    pub fn new(width: usize, candidates: usize) -> Self {
        ColumnProducts { width, candidates, sums: vec![0.0; width * candidates] }
    }

    pub fn of(&self, column: usize) -> &[f32] {
        &self.sums[column * self.candidates..][..self.candidates]
    }

    pub fn enter(&mut self, row: RowPair) {
        let n = self.candidates;
        for (u, sums) in self.sums.chunks_exact_mut(n).enumerate() {
            let grey = row.picture[u];
            let reference = &row.reference[self.width - 1 - u..][..n];
            sums.iter_mut().zip(reference).for_each(|(s, r)| *s += grey * r);
        }
    }

    pub fn exchange(&mut self, enters: RowPair, leaves: RowPair) {
        let n = self.candidates;
        for (u, sums) in self.sums.chunks_exact_mut(n).enumerate() {
            let (new, old) = (enters.picture[u], leaves.picture[u]);
            let place = self.width - 1 - u;
            let fresh = &enters.reference[place..][..n];
            let stale = &leaves.reference[place..][..n];
            for ((s, f), o) in sums.iter_mut().zip(fresh).zip(stale) {
                *s += new * f - old * o;
            }
        }
    }
}

/// Index of the largest value (the first of them), and the value.
pub fn best(scores: &[f32]) -> (usize, f32) {
    let mut lanes = [f32::NEG_INFINITY; LANES];
    for group in scores.chunks_exact(LANES) {
        for (top, &s) in lanes.iter_mut().zip(group) {
            // Not f32::max, whose NaN handling costs a branch per lane.
            *top = if s > *top { s } else { *top };
        }
    }
    let top = lanes.iter().fold(f32::NEG_INFINITY, |a, &b| a.max(b));
    let place = scores.iter().position(|&s| s == top).unwrap_or(0);
    (place, top)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against an independent implementation of triangulation.
    #[test]
    fn raw_values_and_depths_agree_with_triangulation() {
        let metric = DepthCode::Metric { units_per_metre: 5000.0, invalid: 0 };
        let read_out = ReadOut::new(0.125, 43.5, 90.0, &metric);
        for z in [0.5, 1.0, 2.0, 3.3] {
            let shift = 580.0 * 0.075 / z - 580.0 * 0.075 / REFERENCE_M;
            let raw = read_out.raw(shift as f32);
            let found = read_out.code.metres(raw).unwrap();
            assert!((found - z).abs() <= 0.5 * 2.88e-3 * z * z, "{z}: {found}");
        }
        let DepthCode::Disparity { offset, slope, .. } = read_out.code else { unreachable!() };
        assert!((offset / -slope - 1084.6).abs() < 1.0, "infinity is where a Kinect has it");
    }

    /// The description is the recorder's own, or the usual one, for usual and coarse steps alike.
    #[test]
    fn the_code_does_not_betray_the_step() {
        let metric = DepthCode::Metric { units_per_metre: 5000.0, invalid: 0 };
        let code = |step| ReadOut::new(step, 43.5, 90.0, &metric).code;
        assert_eq!(code(0.125), code(0.5));
        let own =
            DepthCode::Disparity { offset: 3.12, slope: -0.00286, invalid: KINECT_NO_MEASUREMENT };
        let read_out = ReadOut::new(0.5, 43.5, 90.0, &own);
        assert_eq!(read_out.code, own);
        let raw: std::collections::BTreeSet<u16> =
            (0..4000).map(|k| read_out.raw(k as f32 * 0.01)).collect();
        assert!((70..=90).contains(&raw.len()), "40 px in half pixels: {}", raw.len());
    }

    #[test]
    fn window_sums_are_the_sums_over_windows() {
        let values: Vec<u32> = (0..70u32).map(|i| i * i % 101).collect();
        let image = WindowedImage::new(&values, 10, 1);
        let window = (2..5).flat_map(|v| (4..7).map(move |u| v * 10 + u)).map(|i| values[i]);
        let window: Vec<u32> = window.collect();
        let sum: u32 = window.iter().sum();
        let squares: u32 = window.iter().map(|g| g * g).sum();
        assert_eq!(image.sum[3 * 10 + 5], sum as f32);
        let contrast = (squares as f32 - (sum * sum) as f32 / 9.0).sqrt();
        assert_eq!(image.contrast[3 * 10 + 5], contrast);
        assert_eq!(image.sum[0], 0.0);
        assert_eq!(image.sum[6 * 10 + 5], 0.0, "the last row has no whole window");
    }

    #[test]
    fn the_best_is_the_first_of_the_largest() {
        let mut scores = vec![0.0f32; 24];
        scores[13] = 2.0;
        scores[21] = 2.0;
        assert_eq!(best(&scores), (13, 2.0));
    }
}
