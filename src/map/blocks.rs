//! Downsamples a depth image: each block of pixels becomes one point, far less noisy, with a normal from the
//! blocks around it.
//!
//! All in inverse depth q = 1/z over the ray (x, y, 1): there a plane is affine,
//! q = (n_x x + n_y y + n_z) / D, and the noise of a disparity sensor is uniform.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::point::{Noise, Point};
use crate::camera::{Camera, Rays};

/// The points of a downsampled depth image.
pub struct Blocks {
    /// Side of a block, px.
    pub side_px: usize,
    pub points: Vec<Option<Point>>,
}

/// Relative difference in inverse depth that the slope of a surface may make between blocks two apart.
const SLOPE_AROUND: f32 = 0.05;
/// Blocks on each side used for the normal.
const AROUND: usize = EDGE;
/// Fewest blocks for a normal, of 25.
const MIN_AROUND: f32 = 8.0;
/// Least cosine of incidence: surfaces seen at more than 80 degrees are rims and mistakes.
const MIN_FACING: f32 = 0.17;

impl Blocks {
    /// Downsamples a depth image, m, NaN where nothing was measured.
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
        Blocks { side_px, points }
    }
}

/// Moments of the neighbourhoods of [`LANES`] adjacent blocks, each about its own block's mean.
struct Around {
    /// n, x, y, xx, xy, yy, q, xq, yq, weighted by the pixels of each block.
    sums: [[f32; LANES]; 9],
    found: [f32; LANES],
    /// x, y, q of the block itself.
    centre: [[f32; LANES]; 3],
}

#[inline]
fn lanes(values: &[f32], begin: usize) -> [f32; LANES] {
    let mut lanes = [0.0; LANES];
    lanes.copy_from_slice(&values[begin..begin + LANES]);
    lanes
}

/// One value per lane.
#[inline]
fn each(of: impl Fn(usize) -> f32) -> [f32; LANES] {
    std::array::from_fn(of)
}

impl Around {
    fn of(means: &Means, u: usize, v: usize) -> Self {
        let here = means.index(u, v);
        let all = |at: usize| means.planes.each_ref().map(|plane| lanes(plane, at));
        let [n, x, y, q, sigma] = all(here);
        let centre = [x, y, q];
        let tolerance = each(|i| {
            let apart = SIGMAS * sigma[i] / n[i].sqrt() + SLOPE_AROUND * centre[2][i];
            if n[i] > 0.0 { apart } else { -1.0 }
        });
        let mut sums = [[0f32; LANES]; 9];
        let mut found = [0f32; LANES];
        for dv in 0..=2 * AROUND {
            for du in 0..=2 * AROUND {
                let there = here + dv * means.stride + du - AROUND * means.stride - AROUND;
                let [n, x, y, q, _] = all(there);
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

    /// Fits q = a x + b y + c to a block's neighbourhood; returns (a, b, c).
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
    let [n, x, y, q, _] = means.planes.each_ref().map(|plane| plane[i]);
    let z = 1.0 / q;
    let at = Vector3::new(x * z, y * z, z);
    // The plane is n / D, which points away from the camera.
    let normal = -plane.try_normalize(f64::MIN_POSITIVE)?.cast::<f32>();
    let facing = -normal.dot(&at) / at.norm();
    if facing.is_nan() || facing <= MIN_FACING {
        return None;
    }
    let sigma_axial = noise.sigma_axial(z, &normal);
    let sigma_normal = noise.sigma_normal(sigma_axial, &at, &normal, n);
    Some(Point { at, normal, sigma_axial, sigma_normal, pixel })
}

/// Empty blocks padded on each side of the image, so that neighbourhoods need no border check.
pub const EDGE: usize = 2;
/// Blocks processed at once: their sums stay in the registers of any x86-64 or aarch64.
pub const LANES: usize = 4;

/// Mean of a block: n pixels, x and y of the ray (x, y, 1), the inverse depth q along z, and the sigma of a
/// single inverse depth at normal incidence, 1/m. All zero where the block is empty.
type Mean = [f32; 5];

/// The means of all blocks, one plane per number, in rows of `stride` with an empty edge.
struct Means {
    width: usize,
    height: usize,
    stride: usize,
    planes: [Vec<f32>; 5],
}

/// Inverse depths on one surface may differ by this many sigmas of noise ...
pub const SIGMAS: f32 = 4.0;
/// ... and by this share for its slope: a block of 4 px at f = 525 px is 0.8 % of the distance wide, and a
/// tilt of 70 degrees makes 2.7 times that, half to either side.
const SLOPE: f32 = 0.012;
/// Least filled share of a block: less is the rim of something.
const MIN_FILLED: f32 = 0.4;

impl Means {
    /// Averages the blocks of a depth image, m, NaN where nothing was measured.
    fn of(
        depth: &[f32],
        [columns, rows]: [usize; 2],
        rays: &Rays,
        side: usize,
        noise: &Noise,
    ) -> Self {
        let (width, height) = (columns / side, rows / side);
        let stride = width.next_multiple_of(LANES) + 2 * EDGE;
        let size = stride * (height + 2 * EDGE);
        let picture = Picture { depth, columns, rays, side, noise };
        let found: Vec<Vec<Mean>> = (0..height).into_par_iter().map(|v| picture.row(v)).collect();
        let planes = std::array::from_fn(|k| {
            let mut plane = vec![0.0; size];
            for (v, row) in found.iter().enumerate() {
                let begin = (v + EDGE) * stride + EDGE;
                for (value, mean) in plane[begin..begin + width].iter_mut().zip(row) {
                    *value = mean[k];
                }
            }
            plane
        });
        Means { width, height, stride, planes }
    }

    /// Index of a block in the planes.
    #[inline]
    fn index(&self, u: usize, v: usize) -> usize {
        (v + EDGE) * self.stride + u + EDGE
    }
}

struct Picture<'a> {
    depth: &'a [f32],
    columns: usize,
    rays: &'a Rays,
    side: usize,
    noise: &'a Noise,
}

/// Sums over the rows of a block, by column: n, x, y, q, and the least and greatest q.
type Columns = [Vec<f32>; 6];

impl Picture<'_> {
    fn row(&self, v: usize) -> Vec<Mean> {
        let columns = self.columns(v);
        let mut scratch = Vec::with_capacity(self.side * self.side);
        (0..self.columns / self.side).map(|u| self.mean(&columns, [u, v], &mut scratch)).collect()
    }

    fn columns(&self, v: usize) -> Columns {
        let [inf, zero] = [f32::INFINITY, 0.0];
        let mut sums = [zero, zero, zero, zero, inf, zero].map(|v| vec![v; self.columns]);
        for row in v * self.side..(v + 1) * self.side {
            let range = row * self.columns..(row + 1) * self.columns;
            let depth = &self.depth[range.clone()];
            let (x, y) = (&self.rays.x[range.clone()], &self.rays.y[range]);
            let [n, sx, sy, sq, low, high] = sums.each_mut().map(|values| values.as_mut_slice());
            let pixels = depth.iter().zip(x).zip(y);
            let into = n.iter_mut().zip(sx).zip(sy).zip(sq).zip(low).zip(high);
            for (((&z, &x), &y), (((((n, sx), sy), sq), low), high)) in pixels.zip(into) {
                let q = 1.0 / z;
                let there = q > 0.0;
                let only = |value: f32| if there { value } else { 0.0 };
                *n += only(1.0);
                *sx += only(x);
                *sy += only(y);
                *sq += only(q);
                *low = low.min(if there { q } else { f32::INFINITY });
                *high = high.max(only(q));
            }
        }
        sums
    }

    fn mean(&self, columns: &Columns, [u, v]: [usize; 2], scratch: &mut Vec<f32>) -> Mean {
        let range = u * self.side..(u + 1) * self.side;
        let [n, x, y, q, low, high] = columns.each_ref().map(|values| &values[range.clone()]);
        let n = n.iter().sum::<f32>();
        if n < self.min_pixels() {
            return Mean::default();
        }
        let low = low.iter().fold(f32::INFINITY, |l, &q| l.min(q));
        let high = high.iter().fold(0.0f32, |h, &q| h.max(q));
        let (sigma_q, tolerance) = self.tolerance(0.5 * (low + high));
        // Most blocks show one surface.
        if high - low <= tolerance {
            let [x, y, q] = [x, y, q].map(|values| values.iter().sum::<f32>() / n);
            return [n, x, y, q, sigma_q];
        }
        self.larger_part([u, v], scratch)
    }

    /// Mean of the larger surface in a block that shows more than one, which is where the median lies.
    fn larger_part(&self, [u, v]: [usize; 2], scratch: &mut Vec<f32>) -> Mean {
        let side = self.side;
        let pixels = || {
            let rows = v * side..(v + 1) * side;
            rows.flat_map(move |row| {
                let first = row * self.columns + u * side;
                (first..first + side).map(|i| (i, 1.0 / self.depth[i]))
            })
        };
        scratch.clear();
        scratch.extend(pixels().map(|(_, q)| q).filter(|q| *q > 0.0));
        let half = scratch.len() / 2;
        let middle = *scratch.select_nth_unstable_by(half, f32::total_cmp).1;
        let (sigma_q, tolerance) = self.tolerance(middle);
        let (mut n, mut sum) = (0.0, [0.0; 3]);
        for (i, q) in pixels().filter(|(_, q)| (q - middle).abs() < tolerance) {
            n += 1.0;
            sum = [sum[0] + self.rays.x[i], sum[1] + self.rays.y[i], sum[2] + q];
        }
        let [x, y, q] = sum.map(|s| s / n);
        if n < self.min_pixels() { Mean::default() } else { [n, x, y, q, sigma_q] }
    }

    fn min_pixels(&self) -> f32 {
        MIN_FILLED * (self.side * self.side) as f32
    }

    /// Sigma of one inverse depth, and the largest difference of others on its surface, 1/m.
    fn tolerance(&self, q: f32) -> (f32, f32) {
        let sigma_q = self.noise.sigma_facing(1.0 / q) * q * q;
        (sigma_q, SIGMAS * sigma_q + SLOPE * q)
    }
}
