//! Local slope of a measured surface at each pixel: planes in disparity fitted to small windows.
//!
//! A window across an edge fits badly. The best of the four windows with the pixel in a corner then
//! replaces it (Kuwahara 1976).

use rayon::prelude::*;

use crate::model::SigmaModel;
use crate::stats::SummedArea;

/// Half a window's side, px: 13 x 13 px reduce the noise of the slope to a fiftieth of a pixel's, per px.
const HALF: usize = 6;
const SIDE: usize = 2 * HALF + 1;
/// Least number of measured pixels in a window: a third of it.
const MIN_PIXELS: f64 = 56.0;
/// A corner window replaces the centred one if its variance is smaller by this factor. Noise over a hundred
/// pixels does not reach this F-ratio.
const MIN_F_RATIO: f64 = 3.0;
/// A pixel farther from the plane than this many standard deviations does not belong to it.
const MAX_DEVIATIONS: f64 = 4.0;
/// Least variance of the pixels of a window along its narrower side, px^2; rejects windows of a single line.
const MIN_WIDTH: f64 = 1.0;

/// The model's noise of a frontal surface, by disparity. A centred window no noisier than this is accepted
/// without comparison.
#[derive(Debug, Clone)]
pub(crate) struct Noise {
    /// Variance in px^2, one node per px of disparity.
    variance: Vec<f64>,
}

/// Number of nodes. No sensor of this kind measures nearer than 0.4 m, which is 109 px for a Kinect.
const NODES: usize = 256;
/// Factor on the model's variance, so that slightly noisier windows pass.
const TOLERANCE: f64 = 1.5;

impl Noise {
    pub fn of(sigma: &SigmaModel, scale_px_m: f64) -> Self {
        let variance = |k: usize| {
            let d = k.max(1) as f64;
            let z = scale_px_m / d;
            let [low, _] = sigma.domain.theta_rad;
            TOLERANCE * (sigma.axial_sigma(z, low) * d / z).powi(2)
        };
        Noise { variance: (0..NODES).map(variance).collect() }
    }

    /// Largest variance of a window accepted without comparison, px^2, one node per px of disparity.
    pub fn limits(&self) -> &[f64] {
        &self.variance
    }

    fn passes(&self, d: f64, variance: f64) -> bool {
        variance <= self.variance[(d.max(0.0) as usize).min(NODES - 1)]
    }
}

/// Sums over pixels: 1, u, v, uu, uv, vv, d, ud, vd, dd.
type Sums = [f64; 10];

/// The slopes of one image.
pub(super) struct Slopes {
    slopes: Vec<[f32; 2]>,
}

impl Slopes {
    /// Fits the slopes of an image whose pixels have this `disparity`, px; NaN where there is none.
    pub fn of(
        width: usize,
        height: usize,
        disparity: impl Fn(usize) -> f64 + Sync,
        noise: &Noise,
    ) -> Self {
        let windows = Windows::of(width, height, &disparity);
        let mut slopes = vec![[0f32; 2]; width * height];
        slopes.par_chunks_mut(width).enumerate().for_each(|(v, line)| {
            for (u, slope) in line.iter_mut().enumerate() {
                let d = disparity(v * width + u);
                if d > 0.0 {
                    *slope = windows.slope(u, v, d, noise).map(|s| s as f32);
                }
            }
        });
        Slopes { slopes }
    }

    /// Slope along u and v, px per px; zero where no plane was found.
    pub fn at(&self, i: usize) -> [f64; 2] {
        self.slopes[i].map(f64::from)
    }
}

/// Sums over any window of the image.
struct Windows {
    width: usize,
    height: usize,
    sums: SummedArea<10>,
}

impl Windows {
    fn of(width: usize, height: usize, disparity: &(impl Fn(usize) -> f64 + Sync)) -> Self {
        let pixel = |i: usize| {
            let (d, x, y) = (disparity(i), (i % width) as f64, (i / width) as f64);
            (d > 0.0).then_some([1.0, x, y, x * x, x * y, y * y, d, x * d, y * d, d * d])
        };
        Windows { width, height, sums: SummedArea::of(width, height, pixel) }
    }

    fn slope(&self, u: usize, v: usize, d: f64, noise: &Noise) -> [f64; 2] {
        // At the image border a window is shifted inwards, not cropped.
        let span = |at: usize, before: usize, end: usize| {
            let first = at.saturating_sub(before).min(end.saturating_sub(SIDE));
            [first, (first + SIDE).min(end)]
        };
        let fit = |left: usize, above: usize| {
            LocalPlane::of(
                &self.sums.window(span(u, left, self.width), span(v, above, self.height)),
            )
        };
        let middle = fit(HALF, HALF);
        if let Some(plane) = middle.filter(|p| noise.passes(d, p.variance)) {
            return plane.slope;
        }
        let corners = [(0, 0), (0, SIDE - 1), (SIDE - 1, 0), (SIDE - 1, SIDE - 1)];
        let best = corners
            .into_iter()
            .filter_map(|(left, above)| fit(left, above))
            .min_by(|a, b| a.variance.total_cmp(&b.variance));
        let chosen = match (middle, best) {
            (Some(m), Some(b)) if m.variance > MIN_F_RATIO * b.variance => Some(b),
            (Some(m), _) => Some(m),
            (None, b) => b,
        };
        chosen.filter(|p| p.has(u as f64, v as f64, d)).map_or([0.0; 2], |p| p.slope)
    }
}

/// A plane in disparity over a window.
#[derive(Debug, Clone, Copy)]
struct LocalPlane {
    /// Means of u, v and d.
    centre: [f64; 3],
    slope: [f64; 2],
    /// Residual variance, px^2.
    variance: f64,
}

impl LocalPlane {
    /// Least-squares fit; `None` for too few pixels or pixels too close to a line.
    fn of(sums: &Sums) -> Option<Self> {
        let n = sums[0];
        if n < MIN_PIXELS {
            return None;
        }
        let [u, v, d] = [sums[1] / n, sums[2] / n, sums[6] / n];
        let (uu, uv, vv) = (sums[3] / n - u * u, sums[4] / n - u * v, sums[5] / n - v * v);
        let (ud, vd, dd) = (sums[7] / n - u * d, sums[8] / n - v * d, sums[9] / n - d * d);
        let determinant = uu * vv - uv * uv;
        if determinant < MIN_WIDTH * (uu + vv) {
            return None;
        }
        let slope = [(vv * ud - uv * vd) / determinant, (uu * vd - uv * ud) / determinant];
        let left = (dd - slope[0] * ud - slope[1] * vd).max(0.0);
        Some(LocalPlane { centre: [u, v, d], slope, variance: left * n / (n - 3.0) })
    }

    fn has(&self, u: f64, v: f64, d: f64) -> bool {
        let [cu, cv, cd] = self.centre;
        let off = d - cd - self.slope[0] * (u - cu) - self.slope[1] * (v - cv);
        off * off <= MAX_DEVIATIONS * MAX_DEVIATIONS * self.variance.max(f64::MIN_POSITIVE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const W: usize = 60;
    const H: usize = 50;

    fn noise() -> Noise {
        Noise::of(&SigmaModel::paper(), 43.5)
    }

    /// Pseudo-random values with a standard deviation of 0.1 px.
    fn ripple(i: usize) -> f64 {
        0.1 * (12.9898 * i as f64).sin() * std::f64::consts::SQRT_2
    }

    #[test]
    fn a_plane_has_its_slope_everywhere_but_at_lone_pixels() {
        let d = |i: usize| 20.0 + 0.05 * (i % W) as f64 - 0.02 * (i / W) as f64 + ripple(i);
        let slopes = Slopes::of(W, H, d, &noise());
        for i in 0..W * H {
            let [a, b] = slopes.at(i);
            assert!((a - 0.05).abs() < 0.02 && (b + 0.02).abs() < 0.02, "{i}: {a} {b}");
        }
        let lone = |i: usize| if i == 700 { 20.0 } else { f64::NAN };
        assert_eq!(Slopes::of(W, H, lone, &noise()).at(700), [0.0; 2]);
    }

    /// A step of 5 px down the middle: no pixel beside it may take the step for a slope.
    #[test]
    fn an_edge_is_no_slope() {
        let d = |i: usize| if i % W < 30 { 30.0 } else { 25.0 } + ripple(i);
        let slopes = Slopes::of(W, H, d, &noise());
        let worst = (0..W * H).map(|i| slopes.at(i)[0].abs()).fold(0.0, f64::max);
        assert!(worst < 0.05, "{worst}; a fit across the edge has 0.6");
    }
}
