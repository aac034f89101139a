//! The default plane fit: affine in inverse depth, all pixels, redescending weights.

use nalgebra::{Matrix3, Vector3};

use super::Plane;
use crate::camera::Rays;
use crate::stats::{TUKEY, median_in_place};

pub(crate) use crate::stats::MAD_TO_SIGMA;

/// A robust plane and the scale of its residuals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AffineFit {
    pub plane: Plane,
    /// Robust standard deviation of the residual in inverse depth, 1/m.
    pub scale: f64,
    /// Number of pixels with a weight above zero.
    pub supporting: usize,
}

/// How many pixels the last rounds use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effort {
    /// A regular sample of some ten thousand, for detection.
    Sample,
    /// Every pixel, for measurement.
    AllPixels,
}

/// Pixels used while the weights converge; with [`Effort::AllPixels`] the final rounds use all.
const SETTLING_PIXELS: usize = 12_000;
const SETTLING_ROUNDS: usize = 12;
const FINAL_ROUNDS: usize = 2;

/// Iteratively reweighted least squares of w on (x, y, 1) from a first guess.
///
/// `pixels` index `w` (inverse depth, 1/m; NaN = none) and `rays`; `floor` is the least plausible scale (by
/// the step of the depth code), 1/m. `None` when fewer than 12 pixels support a plane.
pub fn fit_affine_robust(
    w: &[f32],
    rays: &Rays,
    pixels: &[u32],
    start: &Plane,
    floor: f64,
    effort: Effort,
) -> Option<AffineFit> {
    let stride = (pixels.len() / SETTLING_PIXELS).max(1);
    let few: Vec<u32> = pixels.iter().copied().step_by(stride).collect();
    let mut fit = AffineFit { plane: *start, scale: 0.0, supporting: 0 };
    fit.scale = scale_about(w, rays, &few, &fit.plane, floor)?;
    for _ in 0..SETTLING_ROUNDS {
        let previous = fit.plane;
        fit = reweighted(w, rays, &few, &fit)?;
        fit.scale = scale_about(w, rays, &few, &fit.plane, floor)?;
        if (fit.plane.q - previous.q).norm() < 1e-4 * fit.scale {
            break;
        }
    }
    if stride > 1 && effort == Effort::AllPixels {
        for _ in 0..FINAL_ROUNDS {
            fit = AffineFit { scale: fit.scale, ..reweighted(w, rays, pixels, &fit)? };
        }
    }
    (fit.supporting >= 12 && fit.plane.is_finite()).then_some(fit)
}

fn scale_about(w: &[f32], rays: &Rays, pixels: &[u32], plane: &Plane, floor: f64) -> Option<f64> {
    let mut off: Vec<f32> = pixels
        .iter()
        .map(|&i| i as usize)
        .map(|i| (f64::from(w[i]) - plane.inverse_depth_at(rays, i)).abs() as f32)
        .filter(|r| r.is_finite())
        .collect();
    if off.len() < 12 {
        return None;
    }
    Some((MAD_TO_SIGMA * f64::from(median_in_place(&mut off))).max(floor))
}

fn reweighted(w: &[f32], rays: &Rays, pixels: &[u32], fit: &AffineFit) -> Option<AffineFit> {
    let mut normal = Matrix3::zeros();
    let mut right = Vector3::zeros();
    let mut supporting = 0;
    let reach = 1.0 / (TUKEY * fit.scale);
    for &i in pixels {
        let i = i as usize;
        let (x, y) = rays.at(i);
        let r = f64::from(w[i]) - fit.plane.inverse_depth(x, y);
        let t = r * reach;
        // NaN fails the comparison and is left out.
        if t.abs() < 1.0 {
            let weight = (1.0 - t * t) * (1.0 - t * t);
            supporting += 1;
            let (wx, wy) = (weight * x, weight * y);
            normal.m11 += wx * x;
            normal.m12 += wx * y;
            normal.m13 += wx;
            normal.m22 += wy * y;
            normal.m23 += wy;
            normal.m33 += weight;
            right += Vector3::new(wx, wy, weight) * r;
        }
    }
    normal.m21 = normal.m12;
    normal.m31 = normal.m13;
    normal.m32 = normal.m23;
    let shift = normal.cholesky()?.solve(&right);
    let plane = Plane::new(fit.plane.q + shift);
    plane.is_finite().then_some(AffineFit { plane, scale: fit.scale, supporting })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::rng::Seed;
    use rand::Rng;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn thirty_percent_clutter_in_front_moves_the_plane_by_less_than_a_percent_of_sigma() {
        let camera = Camera::centred(160, 120, 145.0);
        let rays = camera.rays();
        let truth = Plane::tilted(2.0, 0.7, 1.0);
        let sigma = 0.002;
        let mut rng = Seed(2).stream("w");
        let w: Vec<f32> = (0..camera.pixels())
            .map(|i| {
                let (x, y) = rays.at(i);
                let noise: f64 = StandardNormal.sample(&mut rng);
                let clutter =
                    if rng.random::<f64>() < 0.3 { rng.random_range(0.05..0.5) } else { 0.0 };
                (truth.inverse_depth(x, y) + sigma * noise + clutter) as f32
            })
            .collect();
        let pixels: Vec<u32> = (0..camera.pixels() as u32).collect();
        let start = Plane::tilted(1.9, 0.6, 1.1);
        let fit = fit_affine_robust(&w, &rays, &pixels, &start, 1e-6, Effort::AllPixels).unwrap();
        // 13,440 good pixels: standard error of the mean is sigma / 116; allow five of them.
        let centre = (fit.plane.inverse_depth(0.0, 0.0) - truth.inverse_depth(0.0, 0.0)).abs();
        assert!(centre < 5.0 * sigma / 116.0, "{centre}");
        let scale = fit.scale / sigma;
        assert!((scale - 1.0).abs() < 0.8, "MAD counts the clutter: {scale}");
    }

    #[test]
    fn too_few_pixels_are_no_plane() {
        let rays = Camera::centred(3, 3, 5.0).rays();
        let pixels: Vec<u32> = (0..9).collect();
        let start = Plane::tilted(1.0, 0.0, 0.0);
        let found = fit_affine_robust(&[1.0; 9], &rays, &pixels, &start, 1e-6, Effort::Sample);
        assert_eq!(found, None);
    }
}
