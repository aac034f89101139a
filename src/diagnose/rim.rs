//! The rim of the target, where depth may mix with what is behind.
//!
//! Walking off the target, a sharp edge goes from the plane to what is behind in one step; a mixed
//! one has pixels in between, that belong to neither.

use serde_json::Map;

use super::field::{CLIP_SIGMAS, Field};
use super::hanging::Hanging;
use super::parameters::estimate;
use crate::camera::Rays;
use crate::frame::{DepthTable, Frame};
use crate::terms::{Axis, Statistic};

/// One view's edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rim {
    /// Pixels in between, per crossing.
    pub mixed_px: f64,
    pub crossings: f64,
}

/// Farther than this nothing mixes, px.
const FARTHEST: usize = 40;
/// Pixels that must agree on what is behind.
const BEHIND: usize = 4;
/// A step must be this many noise widths, or what lies between cannot be seen.
const STEP: f64 = 3.0;
/// Fewer crossings say nothing.
const FEWEST_CROSSINGS: f64 = 40.0;
/// Mixed pixels per crossing that are no chance: gross errors are rarer.
const LEAST_MIXED_PX: f64 = 0.25;

impl Rim {
    pub fn around(field: &Field, frame: &Frame, rays: &Rays, table: &DepthTable) -> Option<Self> {
        let (w, h) = (field.width, field.height);
        let mut on = vec![u32::MAX; w * h];
        for (k, &i) in field.pixels.iter().enumerate() {
            on[i as usize] = k as u32;
        }
        let disparity = |i: usize| {
            let z = f64::from(table.metres(frame.raw[i]));
            if z.is_finite() { field.scale_px_m / z } else { f64::NAN }
        };
        let plane = |i: usize| {
            let (x, y) = rays.at(i);
            field.scale_px_m * field.plane.inverse_depth(x, y)
        };
        let (mut mixed, mut crossings) = (0.0, 0.0);
        for (k, &i) in field.pixels.iter().enumerate() {
            let (u, v) = (i as usize % w, i as usize / w);
            let clip = f64::from(CLIP_SIGMAS * field.sigma[k].max(field.spread_px));
            for (du, dv) in [(1isize, 0isize), (-1, 0), (0, 1), (0, -1)] {
                let at = |n: usize| {
                    let (u, v) = (u as isize + du * n as isize, v as isize + dv * n as isize);
                    let inside = (0..w as isize).contains(&u) && (0..h as isize).contains(&v);
                    inside.then(|| v as usize * w + u as usize)
                };
                if at(1).is_none_or(|j| on[j] != u32::MAX) {
                    continue;
                }
                let walk: Vec<(f64, f64)> = (1..=FARTHEST)
                    .map_while(at)
                    .take_while(|&j| on[j] == u32::MAX)
                    .map(|j| (disparity(j), plane(j)))
                    .collect();
                if let Some(n) = between(&walk, clip) {
                    mixed += n;
                    crossings += 1.0;
                }
            }
        }
        (crossings >= FEWEST_CROSSINGS).then(|| Rim { mixed_px: mixed / crossings, crossings })
    }
}

/// Pixels between the plane and what is behind along a walk of (disparity, plane's disparity).
fn between(walk: &[(f64, f64)], clip: f64) -> Option<f64> {
    // Behind: the first stretch of pixels that agree with one another and lie below the plane.
    let start = (0..walk.len().checked_sub(BEHIND)? + 1).find(|&n| {
        let stretch = &walk[n..n + BEHIND];
        let [low, high] = crate::stats::range(stretch.iter().map(|d| d.0));
        stretch.iter().all(|d| d.0.is_finite() && d.0 < d.1 - STEP * clip) && high - low < clip
    })?;
    let behind = walk[start..start + BEHIND].iter().map(|d| d.0).sum::<f64>() / BEHIND as f64;
    let mixed =
        walk[..start].iter().filter(|(d, plane)| *d < plane - clip && *d > behind + clip).count();
    Some(mixed as f64)
}

/// Does depth mix at the edge? One number a view, the views are the sample.
pub fn mixing(fields: &[Field], level: f64) -> Option<Hanging> {
    let rims: Vec<Rim> = fields.iter().filter_map(|f| f.rim).collect();
    let n = rims.len() as f64;
    if n < 3.0 {
        return None;
    }
    let mean = rims.iter().map(|r| r.mixed_px).sum::<f64>() / n;
    let variance = rims.iter().map(|r| (r.mixed_px - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let mut all: Vec<f32> = rims.iter().map(|r| r.mixed_px as f32).collect();
    let median = f64::from(crate::stats::median_in_place(&mut all));
    let error = (variance / n).sqrt();
    let t = mean / error.max(1e-9);
    let p = statrs::distribution::StudentsT::new(0.0, 1.0, n - 1.0)
        .map_or(1.0, |d| 1.0 - statrs::distribution::ContinuousCDF::cdf(&d, t));
    if p > level || median < LEAST_MIXED_PX {
        return None;
    }
    let mut parameters = Map::new();
    parameters.insert("width_px".into(), estimate(mean, error));
    Some(Hanging {
        families: vec!["edge-mixing"],
        statistic: Statistic::Bias,
        axis: Axis::EdgeDistance,
        interval: [0.0, mean],
        parameters,
        size_sigma: 1.0,
        p: p.max(1e-300),
        nats: 0.5 * n * (t * t / n).ln_1p(),
        words: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_between_plane_and_wall_are_counted() {
        let walk = |middle: &[f64]| -> Vec<(f64, f64)> {
            [40.0, 40.01].iter().chain(middle).chain(&[20.0; 5]).map(|&d| (d, 40.0)).collect()
        };
        assert_eq!(between(&walk(&[]), 0.5), Some(0.0));
        assert_eq!(between(&walk(&[30.0, 25.0]), 0.5), Some(2.0));
        // A lost pixel is not a mixed one.
        assert_eq!(between(&walk(&[f64::NAN]), 0.5), Some(0.0));
        assert_eq!(between(&[(40.0, 40.0); 9], 0.5), None);
    }
}

#[cfg(test)]
#[path = "rim_tests.rs"]
mod pictures;
