//! Depth image -> the mean inverse depth of each block of pixels, on its front-most surface.

use rayon::prelude::*;

use super::noise::Noise;
use crate::camera::Rays;

/// Blocks beyond the image on each side, all empty: who looks around needs no border.
pub const EDGE: usize = 2;
/// Blocks worked on at once: their sums stay in the registers of any x86-64 or aarch64.
pub const LANES: usize = 4;

/// One number a block, in rows of `stride` with an empty edge; zero where there is nothing.
#[derive(Debug, Clone)]
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

/// The mean of a block.
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

/// A depth image to be cut up.
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
