//! How a measured surface leans at each pixel: planes in disparity over small windows.
//!
//! A window that lies across an edge fits badly; then the best of four that have the pixel in a
//! corner is taken (Kuwahara 1976).

use rayon::prelude::*;

use crate::model::SigmaModel;
use crate::stats::SummedArea;

/// Half a window's side, px: 13 x 13 px bring the slope's noise to a fiftieth of a pixel's a px.
const HALF: usize = 6;
const SIDE: usize = 2 * HALF + 1;
/// A third of the window must be measured.
const MIN_PIXELS: f64 = 56.0;
/// A corner window is believed over the middle one when its variance is this much less: an F-ratio
/// that noise over a hundred pixels does not reach.
const MIN_F_RATIO: f64 = 3.0;
/// A pixel farther from the plane than this many of its standard deviations is not of it.
const MAX_DEVIATIONS: f64 = 4.0;
/// Variance (px^2) of pixels in a window along its narrower side: not a line of them.
const MIN_WIDTH: f64 = 1.0;

/// The model's noise of a frontal surface, by disparity: a middle window no noisier than this
/// needs no comparison.
#[derive(Debug, Clone)]
pub(crate) struct Noise {
    /// Variance in px^2, a node a px of disparity.
    variance: Vec<f64>,
}

/// Nearer than 0.4 m no sensor of this kind measures: a Kinect has 109 px there.
const NODES: usize = 256;
/// Of the model's variance, to let windows of a little more noise pass.
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

    /// The largest variance of a window that needs no comparison, px^2, a node a px of disparity.
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
    /// Of `disparity` (px, NaN where there is none) of a pixel.
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

    /// px per px along the columns and the rows; zero where there is no plane to be seen.
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
        // At the picture's border a window is moved in, not cut.
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
    /// Of what it leaves, px^2.
    variance: f64,
}

impl LocalPlane {
    /// Least squares.
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

    /// Numbers without a pattern, sd 0.1 px.
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

    /// A step of 5 px down the middle: no pixel beside it takes the step for a slope.
    #[test]
    fn an_edge_is_no_slope() {
        let d = |i: usize| if i % W < 30 { 30.0 } else { 25.0 } + ripple(i);
        let slopes = Slopes::of(W, H, d, &noise());
        let worst = (0..W * H).map(|i| slopes.at(i)[0].abs()).fold(0.0, f64::max);
        assert!(worst < 0.05, "{worst}; a fit across the edge has 0.6");
    }
}
