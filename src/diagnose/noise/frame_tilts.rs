//! Frames whose slope over the picture changes as the pixels' noise does not explain.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::frame_series::AboutLine;
use super::structure::Structure;
use super::texture_finding::TextureFinding;
use super::view_mean::variance_px2;
use crate::diagnose::finding::parameters::one;
use crate::diagnose::views::field::{CLIP_SIGMAS, Field};
use crate::terms::{Axis, Statistic};

/// The frames' slopes scatter by this factor more before it is told, as their means before they jitter: what pixels
/// share beyond a window's reach is not in their noise.
const MUCH: f64 = 2.0;

/// How the slopes of a view's frames scatter about a line in time, along both axes of the picture together.
#[derive(Debug, Clone, Copy)]
pub struct TiltScatter {
    /// Sum of squares, px^2 at one standard deviation of the target's pixels from its middle.
    pub sum_px2: f64,
    pub freedom: f64,
    /// What the pixels' own noise lets one expect for the sum over the freedom, px^2.
    pub expected_px2: f64,
}

impl TiltScatter {
    /// Of the frames that are kept; `mean_px2` is what a frame's mean errs by. `None` with fewer than three.
    /// Where the noise is larger far from the middle, as on a tilted target, slopes err by more.
    pub fn of(field: &Field, mean_px2: f64) -> Option<Self> {
        let times: Vec<f64> = field.frames.iter().map(|f| f.0).collect();
        let axes = axes(field)?;
        let slopes: Vec<[f64; 2]> = field.first.iter().map(|r| slopes(field, r, &axes)).collect();
        let n = slopes.len();
        let of_axis = |axis: usize| {
            let series = times.iter().zip(&slopes).map(|(t, s)| (*t, s[axis]));
            AboutLine::of(&series.collect::<Vec<_>>()).map(|line| line.scatter)
        };
        let sum_px2 = of_axis(0)? + of_axis(1)?;
        let freedom = 2.0 * (n as f64 - 2.0);
        let noise = || field.sigma.iter().map(|s| f64::from(*s).powi(2));
        let apart = axes.iter().zip(noise()).map(|([u, v], px2)| 0.5 * (u * u + v * v) * px2);
        let lever = apart.sum::<f64>() / noise().sum::<f64>();
        let expected_px2 = lever * mean_px2;
        (expected_px2 > 0.0).then_some(TiltScatter { sum_px2, freedom, expected_px2 })
    }

    /// Per degree of freedom, beyond what is expected, px^2.
    pub fn beyond_px2(&self) -> f64 {
        self.sum_px2 / self.freedom - self.expected_px2
    }
}

/// Places of the target's pixels along two axes, uncorrelated and of unit variance.
fn axes(field: &Field) -> Option<Vec<[f64; 2]>> {
    let n = field.pixels.len() as f64;
    let width = field.width as u32;
    let at = |&i: &u32| [f64::from(i % width), f64::from(i / width)];
    let mut all: Vec<[f64; 2]> = field.pixels.iter().map(at).collect();
    for axis in [0, 1] {
        let mean = all.iter().map(|p| p[axis]).sum::<f64>() / n;
        all.iter_mut().for_each(|p| p[axis] -= mean);
        if axis == 1 {
            let shared = all.iter().map(|p| p[0] * p[1]).sum::<f64>() / n;
            all.iter_mut().for_each(|p| p[1] -= shared * p[0]);
        }
        let spread = (all.iter().map(|p| p[axis].powi(2)).sum::<f64>() / n).sqrt();
        if !(spread > 0.0) {
            return None;
        }
        all.iter_mut().for_each(|p| p[axis] /= spread);
    }
    Some(all)
}

/// Slopes of a frame's residuals, px at one standard deviation from the middle.
fn slopes(field: &Field, residuals: &[f32], axes: &[[f64; 2]]) -> [f64; 2] {
    let (mut n, mut sum, mut of_axes, mut places) = (0.0, 0.0, [0.0; 2], [0.0; 2]);
    for ((&e, at), sigma) in residuals.iter().zip(axes).zip(&field.sigma) {
        if e.abs() <= CLIP_SIGMAS * sigma.max(field.spread_px) {
            let e = f64::from(e);
            n += 1.0;
            sum += e;
            for axis in [0, 1] {
                of_axes[axis] += at[axis] * e;
                places[axis] += at[axis];
            }
        }
    }
    // Pixels that are lost move the middle.
    [0, 1].map(|axis| (of_axes[axis] - places[axis] * sum / n) / n)
}

/// Slopes that scatter as neither noise nor what moves the frames' means by `jitter_px2` explains.
pub fn frame_tilts(views: &[Structure], jitter_px2: f64, level: f64) -> Option<TextureFinding> {
    let all: Vec<TiltScatter> = views.iter().filter_map(|s| s.tilts).collect();
    let freedom: f64 = all.iter().map(|t| t.freedom).sum();
    let expected = |t: &TiltScatter| t.expected_px2 + jitter_px2;
    let ratio: f64 = all.iter().map(|t| t.sum_px2 / expected(t)).sum();
    let p = ChiSquared::new(freedom).ok()?.sf(ratio / MUCH);
    let beyond_px2 = all.iter().map(|t| t.freedom * t.beyond_px2()).sum::<f64>() / freedom;
    if !(p < level && beyond_px2 > 0.0) {
        return None;
    }
    let sigma = beyond_px2.sqrt();
    let larger = ratio / freedom;
    Some(TextureFinding {
        parameters: one("sigma_px", sigma, sigma / (2.0 * freedom).sqrt()),
        size_sigma: sigma / variance_px2(views).max(1e-12).sqrt(),
        p: p.max(1e-300),
        nats: 0.5 * freedom * (larger - 1.0 - larger.ln()),
        words: Some("the slope over the picture changes from frame to frame".into()),
        ..TextureFinding::named(vec![], Statistic::Correlation, Axis::Frame)
    })
}
