//! Depth image -> a quarter of its width and height: each block of pixels becomes one point, far
//! less noisy, with the normal of the blocks around it.
//!
//! All in inverse depth q = 1/z over the ray (x, y, 1): a plane is affine there,
//! q = (n_x x + n_y y + n_z) / D, and a disparity sensor's noise is the same everywhere.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

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

/// The mean of a block's pixels on its front-most surface.
#[derive(Debug, Clone, Copy, Default)]
struct Mean {
    n: f32,
    x: f32,
    y: f32,
    q: f32,
    /// Of one inverse depth, faced squarely, 1/m.
    sigma_q: f32,
}

/// Inverse depths on one surface differ by noise, up to this many sigma ...
const SIGMAS: f32 = 4.0;
/// ... and by its slope: a block of 4 px at 525 px is 0.8 % of the distance wide, and 70 degrees
/// make 2.7 times that, half to either side; blocks two apart, four times as much.
const SLOPE: f32 = 0.012;
const SLOPE_AROUND: f32 = 0.05;
/// A block with fewer pixels than this share is the rim of something.
const LEAST_FILLED: f32 = 0.4;
/// Neighbours on each side for the normal.
const AROUND: isize = 2;
/// Of the 25.
const FEWEST_AROUND: usize = 8;
/// Surfaces seen at more than 80 degrees are rims and mistakes.
const LEAST_FACING: f32 = 0.17;

impl Blocks {
    /// Of a depth image, m, NaN where nothing was measured.
    pub fn of(depth: &[f32], camera: &Camera, rays: &Rays, side_px: usize, noise: &Noise) -> Self {
        let (width, height) = (camera.width / side_px, camera.height / side_px);
        let means: Vec<Mean> = (0..height)
            .into_par_iter()
            .flat_map_iter(|v| {
                let mut scratch = Vec::with_capacity(side_px * side_px);
                let row: Vec<Mean> = (0..width)
                    .map(|u| mean(depth, camera.width, rays, [u, v], side_px, noise, &mut scratch))
                    .collect();
                row
            })
            .collect();
        let points = (0..height)
            .into_par_iter()
            .flat_map_iter(|v| {
                let row: Vec<Option<Point>> = (0..width)
                    .map(|u| {
                        let at =
                            (v * side_px + side_px / 2) * camera.width + u * side_px + side_px / 2;
                        let plane = plane(&means, [width, height], [u, v])?;
                        point(&means[v * width + u], &plane, at as u32, noise)
                    })
                    .collect();
                row
            })
            .collect();
        Blocks { width, height, side_px, points }
    }
}

fn mean(
    depth: &[f32],
    width: usize,
    rays: &Rays,
    [u, v]: [usize; 2],
    side: usize,
    noise: &Noise,
    scratch: &mut Vec<f32>,
) -> Mean {
    scratch.clear();
    for row in v * side..(v + 1) * side {
        let first = row * width + u * side;
        scratch.extend(depth[first..first + side].iter().filter(|z| **z > 0.0).map(|z| 1.0 / z));
    }
    if (scratch.len() as f32) < LEAST_FILLED * (side * side) as f32 {
        return Mean::default();
    }
    let (low, high) =
        scratch.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), &q| (l.min(q), h.max(q)));
    let gate_of = |q: f32| {
        let sigma_q = noise.axial(1.0 / q, &Vector3::z()) * q * q;
        (sigma_q, SIGMAS * sigma_q + SLOPE * q)
    };
    // Mostly all is one surface; where it is not, the median stands on the larger part.
    let mut middle = 0.5 * (low + high);
    let (mut sigma_q, mut gate) = gate_of(middle);
    if high - low > gate {
        let n = scratch.len();
        middle = *scratch.select_nth_unstable_by(n / 2, f32::total_cmp).1;
        (sigma_q, gate) = gate_of(middle);
    }
    let mut sum = Mean { sigma_q, ..Mean::default() };
    for row in v * side..(v + 1) * side {
        let first = row * width + u * side;
        for (k, &z) in depth[first..first + side].iter().enumerate() {
            let (i, q) = (first + k, 1.0 / z);
            if (q - middle).abs() < gate {
                sum.n += 1.0;
                sum.x += rays.x[i];
                sum.y += rays.y[i];
                sum.q += q;
            }
        }
    }
    if sum.n < LEAST_FILLED * (side * side) as f32 {
        return Mean::default();
    }
    let n = sum.n;
    Mean { n, x: sum.x / n, y: sum.y / n, q: sum.q / n, sigma_q }
}

/// (a, b, c) of q = a x + b y + c through the blocks around one.
fn plane(means: &[Mean], [width, height]: [usize; 2], [u, v]: [usize; 2]) -> Option<Vector3<f64>> {
    let centre = means[v * width + u];
    if centre.n == 0.0 {
        return None;
    }
    let gate = SIGMAS * centre.sigma_q / centre.n.sqrt() + SLOPE_AROUND * centre.q;
    let mut sums = [0f32; 9];
    let mut found = 0;
    for dv in -AROUND..=AROUND {
        for du in -AROUND..=AROUND {
            let (Some(column), Some(row)) = (u.checked_add_signed(du), v.checked_add_signed(dv))
            else {
                continue;
            };
            if column >= width || row >= height {
                continue;
            }
            let m = means[row * width + column];
            if m.n == 0.0 || (m.q - centre.q).abs() > gate {
                continue;
            }
            found += 1;
            let [n, x, y, q] = [m.n, m.x - centre.x, m.y - centre.y, m.q - centre.q];
            let terms =
                [n, n * x, n * y, n * x * x, n * x * y, n * y * y, n * q, n * x * q, n * y * q];
            for (sum, term) in sums.iter_mut().zip(terms) {
                *sum += term;
            }
        }
    }
    if found < FEWEST_AROUND {
        return None;
    }
    let [n, x, y, xx, xy, yy, q, xq, yq] = sums.map(f64::from);
    let matrix = Matrix3::new(xx, xy, x, xy, yy, y, x, y, n);
    let abc = matrix.try_inverse()? * Vector3::new(xq, yq, q);
    let [cx, cy, cq] = [centre.x, centre.y, centre.q].map(f64::from);
    Some(Vector3::new(abc.x, abc.y, abc.z + cq - abc.x * cx - abc.y * cy))
}

fn point(mean: &Mean, plane: &Vector3<f64>, pixel: u32, noise: &Noise) -> Option<Point> {
    let z = 1.0 / mean.q;
    let at = Vector3::new(mean.x * z, mean.y * z, z);
    // n / D of the plane; it looks away from the camera.
    let normal = -plane.try_normalize(f64::MIN_POSITIVE)?.cast::<f32>();
    let facing = -normal.dot(&at) / at.norm();
    if facing.is_nan() || facing <= LEAST_FACING {
        return None;
    }
    let axial = noise.axial(z, &normal);
    let across = noise.across(axial, &at, &normal, mean.n);
    Some(Point { at, normal, axial, across, pixel })
}
