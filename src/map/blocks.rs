//! Depth image -> a quarter of its width and height: each block of pixels becomes one point, far
//! less noisy, with the normal of the blocks around it.
//!
//! All in inverse depth q = 1/z over the ray (x, y, 1): a plane is affine there,
//! q = (n_x x + n_y y + n_z) / D, and a disparity sensor's noise is the same everywhere.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::point::{Noise, Point};
use crate::camera::{Camera, Rays};

/// Points in the order of a small image.
pub struct Blocks {
    pub width: usize,
    pub height: usize,
    /// Pixels a block, each way.
    pub side_px: usize,
    pub points: Vec<Option<Point>>,
}

/// Blocks two apart differ by the slope of their surface too, by this share of their distance.
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

/// Blocks beyond the image on each side, all empty: who looks around needs no border.
pub const EDGE: usize = 2;
/// Blocks worked on at once: their sums stay in the registers of any x86-64 or aarch64.
pub const LANES: usize = 4;

/// One number a block, in rows of `stride` with an empty edge; zero where there is nothing.
pub struct Means {
    pub width: usize,
    pub height: usize,
    pub stride: usize,
    /// Pixels in it.
    pub n: Vec<f32>,
    /// The ray (x, y, 1), and the inverse depth along z, 1/m.
    pub x: Vec<f32>,
    pub y: Vec<f32>,
    pub q: Vec<f32>,
    /// Of one inverse depth, faced squarely, 1/m.
    pub sigma_q: Vec<f32>,
}

/// Inverse depths on one surface differ by noise, up to this many sigma ...
pub const SIGMAS: f32 = 4.0;
/// ... and by its slope: a block of 4 px at 525 px is 0.8 % of the distance wide, and 70 degrees
/// make 2.7 times that, half to either side.
const SLOPE: f32 = 0.012;
/// A block with fewer pixels than this share is the rim of something.
const MIN_FILLED: f32 = 0.4;

#[derive(Debug, Clone, Copy, Default)]
struct Mean {
    n: f32,
    x: f32,
    y: f32,
    q: f32,
    sigma_q: f32,
}

impl Means {
    /// Of a depth image of `size`, m, NaN where nothing was measured.
    pub fn of(
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
        let laid_out = |of: fn(&Mean) -> f32| {
            let mut plane = vec![0.0; size];
            for (v, row) in found.iter().enumerate() {
                let begin = (v + EDGE) * stride + EDGE;
                for (value, mean) in plane[begin..begin + width].iter_mut().zip(row) {
                    *value = of(mean);
                }
            }
            plane
        };
        Means {
            width,
            height,
            stride,
            n: laid_out(|m| m.n),
            x: laid_out(|m| m.x),
            y: laid_out(|m| m.y),
            q: laid_out(|m| m.q),
            sigma_q: laid_out(|m| m.sigma_q),
        }
    }

    /// Where a block's numbers are.
    #[inline]
    pub fn index(&self, u: usize, v: usize) -> usize {
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

/// Sums over the rows of a block, column by column.
struct Columns {
    n: Vec<f32>,
    x: Vec<f32>,
    y: Vec<f32>,
    q: Vec<f32>,
    low: Vec<f32>,
    high: Vec<f32>,
}

impl Picture<'_> {
    fn row(&self, v: usize) -> Vec<Mean> {
        let columns = self.columns(v);
        let mut scratch = Vec::with_capacity(self.side * self.side);
        (0..self.columns / self.side).map(|u| self.mean(&columns, [u, v], &mut scratch)).collect()
    }

    fn columns(&self, v: usize) -> Columns {
        let zero = || vec![0.0; self.columns];
        let mut sums = Columns {
            n: zero(),
            x: zero(),
            y: zero(),
            q: zero(),
            low: vec![f32::INFINITY; self.columns],
            high: zero(),
        };
        for row in v * self.side..(v + 1) * self.side {
            let range = row * self.columns..(row + 1) * self.columns;
            let depth = &self.depth[range.clone()];
            let (x, y) = (&self.rays.x[range.clone()], &self.rays.y[range]);
            let Columns { n, x: sx, y: sy, q: sq, low, high } = &mut sums;
            let (n, sx, sy, sq) = (&mut n[..], &mut sx[..], &mut sy[..], &mut sq[..]);
            let pixels = depth.iter().zip(x).zip(y);
            let into = n.iter_mut().zip(sx).zip(sy).zip(sq).zip(&mut low[..]).zip(&mut high[..]);
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
        let of = |values: &[f32]| values[u * self.side..(u + 1) * self.side].iter().sum::<f32>();
        let n = of(&columns.n);
        if n < self.min_pixels() {
            return Mean::default();
        }
        let range = u * self.side..(u + 1) * self.side;
        let low = columns.low[range.clone()].iter().fold(f32::INFINITY, |l, &q| l.min(q));
        let high = columns.high[range].iter().fold(0.0f32, |h, &q| h.max(q));
        let (sigma_q, tolerance) = self.tolerance(0.5 * (low + high));
        // Mostly all is one surface.
        if high - low <= tolerance {
            let [x, y, q] = [&columns.x, &columns.y, &columns.q].map(|values| of(values) / n);
            return Mean { n, x, y, q, sigma_q };
        }
        self.larger_part([u, v], scratch)
    }

    /// Where a block shows more than one surface, the median stands on the larger part.
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
        let mut sum = Mean { sigma_q, ..Mean::default() };
        for (i, q) in pixels() {
            if (q - middle).abs() < tolerance {
                sum.n += 1.0;
                sum.x += self.rays.x[i];
                sum.y += self.rays.y[i];
                sum.q += q;
            }
        }
        if sum.n < self.min_pixels() {
            return Mean::default();
        }
        let n = sum.n;
        Mean { n, x: sum.x / n, y: sum.y / n, q: sum.q / n, sigma_q }
    }

    fn min_pixels(&self) -> f32 {
        MIN_FILLED * (self.side * self.side) as f32
    }

    /// Sigma of one inverse depth, and how far others of its surface may be from it, 1/m.
    fn tolerance(&self, q: f32) -> (f32, f32) {
        let sigma_q = self.noise.sigma_frontal(1.0 / q) * q * q;
        (sigma_q, SIGMAS * sigma_q + SLOPE * q)
    }
}
