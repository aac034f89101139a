//! Depth image -> a quarter of its width and height: each block of pixels becomes one point, far
//! less noisy, with the normal of the blocks around it.
//!
//! All in inverse depth q = 1/z over the ray (x, y, 1): a plane is affine there,
//! q = (n_x x + n_y y + n_z) / D, and a disparity sensor's noise is the same everywhere.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::means::{EDGE, LANES, Means, SIGMAS};
use super::noise::Noise;
use super::point::Point;
use crate::camera::{Camera, Rays};

/// Points in the order of a small image.
#[derive(Debug, Clone)]
pub struct Blocks {
    pub width: usize,
    pub height: usize,
    /// Pixels a block, each way.
    pub side_px: usize,
    pub points: Vec<Option<Point>>,
}

/// Blocks differ by the slope of their surface too: two apart, by this share of their distance (see
/// [`super::means`]).
const SLOPE_AROUND: f32 = 0.05;
/// Neighbours on each side for the normal.
const AROUND: usize = EDGE;
/// Of the 25.
const MIN_AROUND: f32 = 8.0;
/// Surfaces seen at more than 80 degrees are rims and mistakes.
const MIN_FACING: f32 = 0.17;

impl Blocks {
    /// Of a depth image, m, NaN where nothing was measured.
    pub fn of(depth: &[f32], camera: &Camera, rays: &Rays, side_px: usize, noise: &Noise) -> Self {
        let means = Means::of(depth, [camera.width, camera.height], rays, side_px, noise);
        let Means { width, height, .. } = means;
        let points = (0..height)
            .into_par_iter()
            .flat_map_iter(|v| {
                let mut row = Vec::with_capacity(width + LANES);
                for u in (0..width).step_by(LANES) {
                    let around = Around::of(&means, u, v);
                    row.extend((0..LANES).map(|lane| {
                        let plane = around.plane(lane)?;
                        let centre = (v * side_px + side_px / 2) * camera.width + side_px / 2;
                        let pixel = centre + (u + lane) * side_px;
                        point(&means, means.index(u + lane, v), &plane, pixel as u32, noise)
                    }));
                }
                row.truncate(width);
                row
            })
            .collect();
        Blocks { width, height, side_px, points }
    }
}

/// Moments of the blocks around [`LANES`] blocks side by side, about each one's own mean.
struct Around {
    /// n, x, y, xx, xy, yy, q, xq, yq; weighted with the pixels of each.
    sums: [[f32; LANES]; 9],
    found: [f32; LANES],
    /// The mean's own x, y, q.
    centre: [[f32; LANES]; 3],
}

#[inline]
fn lanes(values: &[f32], begin: usize) -> [f32; LANES] {
    let mut lanes = [0.0; LANES];
    lanes.copy_from_slice(&values[begin..begin + LANES]);
    lanes
}

/// A number a lane.
#[inline]
fn each(of: impl Fn(usize) -> f32) -> [f32; LANES] {
    std::array::from_fn(of)
}

impl Around {
    fn of(means: &Means, u: usize, v: usize) -> Self {
        let here = means.index(u, v);
        let centre = [&means.x, &means.y, &means.q].map(|values| lanes(values, here));
        let (sigma, n) = (lanes(&means.sigma_q, here), lanes(&means.n, here));
        let tolerance = each(|i| {
            let apart = SIGMAS * sigma[i] / n[i].sqrt() + SLOPE_AROUND * centre[2][i];
            if n[i] > 0.0 { apart } else { -1.0 }
        });
        let mut sums = [[0f32; LANES]; 9];
        let mut found = [0f32; LANES];
        for dv in 0..=2 * AROUND {
            for du in 0..=2 * AROUND {
                let there = here + dv * means.stride + du - AROUND * means.stride - AROUND;
                let (n, x) = (lanes(&means.n, there), lanes(&means.x, there));
                let (y, q) = (lanes(&means.y, there), lanes(&means.q, there));
                let q = each(|i| q[i] - centre[2][i]);
                let n = each(|i| if q[i].abs() <= tolerance[i] { n[i] } else { 0.0 });
                let (x, y) = (each(|i| x[i] - centre[0][i]), each(|i| y[i] - centre[1][i]));
                let (nx, ny) = (each(|i| n[i] * x[i]), each(|i| n[i] * y[i]));
                found = each(|i| found[i] + if n[i] > 0.0 { 1.0 } else { 0.0 });
                sums[0] = each(|i| sums[0][i] + n[i]);
                sums[1] = each(|i| sums[1][i] + nx[i]);
                sums[2] = each(|i| sums[2][i] + ny[i]);
                sums[3] = each(|i| sums[3][i] + nx[i] * x[i]);
                sums[4] = each(|i| sums[4][i] + nx[i] * y[i]);
                sums[5] = each(|i| sums[5][i] + ny[i] * y[i]);
                sums[6] = each(|i| sums[6][i] + n[i] * q[i]);
                sums[7] = each(|i| sums[7][i] + nx[i] * q[i]);
                sums[8] = each(|i| sums[8][i] + ny[i] * q[i]);
            }
        }
        Around { sums, found, centre }
    }

    /// (a, b, c) of q = a x + b y + c through the blocks around one.
    fn plane(&self, lane: usize) -> Option<Vector3<f64>> {
        if self.found[lane] < MIN_AROUND {
            return None;
        }
        let [n, x, y, xx, xy, yy, q, xq, yq] = self.sums.map(|sum| f64::from(sum[lane]));
        let matrix = Matrix3::new(xx, xy, x, xy, yy, y, x, y, n);
        let abc = matrix.try_inverse()? * Vector3::new(xq, yq, q);
        let [cx, cy, cq] = self.centre.map(|c| f64::from(c[lane]));
        Some(Vector3::new(abc.x, abc.y, abc.z + cq - abc.x * cx - abc.y * cy))
    }
}

fn point(
    means: &Means,
    i: usize,
    plane: &Vector3<f64>,
    pixel: u32,
    noise: &Noise,
) -> Option<Point> {
    let z = 1.0 / means.q[i];
    let at = Vector3::new(means.x[i] * z, means.y[i] * z, z);
    // n / D of the plane; it looks away from the camera.
    let normal = -plane.try_normalize(f64::MIN_POSITIVE)?.cast::<f32>();
    let facing = -normal.dot(&at) / at.norm();
    if facing.is_nan() || facing <= MIN_FACING {
        return None;
    }
    let sigma_axial = noise.sigma_axial(z, &normal);
    let sigma_normal = noise.sigma_normal(sigma_axial, &at, &normal, means.n[i]);
    Some(Point { at, normal, sigma_axial, sigma_normal, pixel })
}
