//! What the matcher compares with, the pattern on a plane as recorded at the factory, and how shifts
//! against it become 11-bit raw values.

use super::matcher::{LANES, WindowedImage};
use super::pattern::Picture;
use crate::frame::{DepthCode, KINECT_NO_MEASUREMENT};

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
}

/// The stored reference in 8 bits, its rows mirrored (see [`super::matcher::RowPair`]).
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

/// The raw value of infinity on a Kinect v1 (Fisher's 3.331 / 0.003071, OpenKinect).
const RAW_AT_INFINITY: f64 = 1084.6;

/// What a Kinect v1 reads out, px: one raw value a step.
const USUAL_STEP_PX: f64 = 0.125;

/// How a shift becomes a raw value, and a raw value a depth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReadOut {
    /// Where the matcher answers in coarser steps than its raw values have, px.
    coarse_px: Option<f64>,
    /// fx * baseline, px m.
    disparity_px_m: f64,
    offset: f64,
    slope: f64,
}

impl ReadOut {
    /// `nearest_px` is the largest shift there is. A recorder's own disparity code is kept, so
    /// that its description does not betray the step.
    pub fn new(step_px: f64, disparity_px_m: f64, nearest_px: f64, own: &DepthCode) -> Self {
        let raw_px = step_px.min(USUAL_STEP_PX);
        let usual = RAW_AT_INFINITY - disparity_px_m / REFERENCE_M / raw_px;
        // Finer steps need more values; the nearest surface gets at least 1.
        let at_reference = usual.max(nearest_px / raw_px + 1.0).round();
        // shift = fx b (1/z - 1/reference) and shift = (at_reference - raw) raw_px, hence
        // 1/z = 1/reference + (at_reference - raw) raw_px / (fx b).
        let per_raw = raw_px / disparity_px_m;
        let (offset, slope) = match *own {
            DepthCode::Disparity { offset, slope, .. } => (offset, slope),
            DepthCode::Metric { .. } => (1.0 / REFERENCE_M + at_reference * per_raw, -per_raw),
        };
        let coarse_px = (step_px > USUAL_STEP_PX).then_some(step_px);
        ReadOut { coarse_px, disparity_px_m, offset, slope }
    }

    pub fn raw(&self, shift_px: f32) -> u16 {
        let shift = f64::from(shift_px);
        let shift = self.coarse_px.map_or(shift, |step| (shift / step).round() * step);
        let inverse = 1.0 / REFERENCE_M + shift / self.disparity_px_m;
        let raw = ((inverse - self.offset) / self.slope).round();
        let fits = raw > 0.0 && raw < f64::from(KINECT_NO_MEASUREMENT);
        if fits { raw as u16 } else { KINECT_NO_MEASUREMENT }
    }

    pub fn code(&self) -> DepthCode {
        let (offset, slope) = (self.offset, self.slope);
        DepthCode::Disparity { offset, slope, invalid: KINECT_NO_MEASUREMENT }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against triangulation, written down again.
    #[test]
    fn raw_values_and_depths_agree_with_triangulation() {
        let metric = DepthCode::Metric { units_per_metre: 5000.0, invalid: 0 };
        let read_out = ReadOut::new(0.125, 43.5, 90.0, &metric);
        for z in [0.5, 1.0, 2.0, 3.3] {
            let shift = 580.0 * 0.075 / z - 580.0 * 0.075 / REFERENCE_M;
            let raw = read_out.raw(shift as f32);
            let found = read_out.code().metres(raw).unwrap();
            assert!((found - z).abs() <= 0.5 * 2.88e-3 * z * z, "{z}: {found}");
        }
        let DepthCode::Disparity { offset, slope, .. } = read_out.code() else { unreachable!() };
        assert!((offset / -slope - 1084.6).abs() < 1.0, "infinity is where a Kinect has it");
    }

    /// The description is the recorder's own, or the usual one, whatever the step.
    #[test]
    fn the_code_does_not_betray_the_step() {
        let metric = DepthCode::Metric { units_per_metre: 5000.0, invalid: 0 };
        let code = |step| ReadOut::new(step, 43.5, 90.0, &metric).code();
        assert_eq!(code(0.125), code(0.5));
        let own =
            DepthCode::Disparity { offset: 3.12, slope: -0.00286, invalid: KINECT_NO_MEASUREMENT };
        let read_out = ReadOut::new(0.5, 43.5, 90.0, &own);
        assert_eq!(read_out.code(), own);
        let raw: std::collections::BTreeSet<u16> =
            (0..4000).map(|k| read_out.raw(k as f32 * 0.01)).collect();
        assert!((70..=90).contains(&raw.len()), "40 px in half pixels: {}", raw.len());
    }
}
