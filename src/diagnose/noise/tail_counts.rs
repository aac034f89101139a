//! Counts residuals by size, in standard deviations of their patch.

use crate::stats::{MAD_TO_SIGMA, median_in_place};

/// Share of a Gaussian beyond four standard deviations.
pub const GAUSSIAN_TAIL: f64 = 6.334e-5;
const TAIL_SIGMAS: f32 = 4.0;
/// Fewest readings of a view that can show a tail.
pub const MIN_READINGS: f64 = 5000.0;
/// Bin edges. Residuals beyond the last are no tail of the noise: a few of them would decide its mean.
pub const TAIL_EDGES: [f64; 6] = [4.0, 5.0, 6.0, 8.0, 11.0, 16.0];

/// Number of residuals, of those beyond the first of [`TAIL_EDGES`], and of those between each two edges, in
/// standard deviations of their patch.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct TailCounts {
    pub n: f64,
    pub beyond: f64,
    pub between: [f64; TAIL_EDGES.len() - 1],
}

impl TailCounts {
    pub fn add(&mut self, other: &TailCounts) {
        self.n += other.n;
        self.beyond += other.beyond;
        self.between.iter_mut().zip(other.between).for_each(|(a, b)| *a += b);
    }

    /// Share of the residuals beyond the first edge.
    pub fn share(&self) -> f64 {
        self.beyond / self.n.max(1.0)
    }

    pub fn count(&mut self, sigmas: f32) {
        self.n += 1.0;
        self.beyond += f64::from(u8::from(sigmas > TAIL_SIGMAS));
        let inside = |w: &[f64]| (w[0]..w[1]).contains(&f64::from(sigmas));
        if let Some(k) = TAIL_EDGES.windows(2).position(inside) {
            self.between[k] += 1.0;
        }
    }
}

/// Counts the tail of an image's residuals: row-major, `width` px wide, NaN where there is none. Marks pixels
/// beyond the first edge as `far`.
pub fn tail(image: &[f32], width: usize, far: &mut [bool]) -> TailCounts {
    let mut counts = TailCounts::default();
    for patch in patches(image, width) {
        for &i in &patch.pixels {
            let sigmas = image[i].abs() / patch.sigma;
            counts.count(sigmas);
            far[i] |= sigmas > TAIL_SIGMAS;
        }
    }
    counts
}

/// Number of connected groups of `far` pixels, row-major, `width` px wide. A speck in every frame is
/// then one error, not many.
pub fn places(mut far: Vec<bool>, width: usize) -> f64 {
    let (mut places, mut queue) = (0.0, Vec::new());
    for start in 0..far.len() {
        if !std::mem::take(&mut far[start]) {
            continue;
        }
        places += 1.0;
        queue.push(start);
        while let Some(i) = queue.pop() {
            let (u, v) = (i % width, i / width);
            for row in v.saturating_sub(1)..=v + 1 {
                for column in u.saturating_sub(1)..=(u + 1).min(width - 1) {
                    let next = row * width + column;
                    if far.get_mut(next).is_some_and(std::mem::take) {
                        queue.push(next);
                    }
                }
            }
        }
    }
    places
}

/// Number of patches across the picture ...
const PATCHES_ACROSS: usize = 7;
/// ... unless they would be narrower than this, px.
const SMALLEST_PATCH: usize = 40;

/// Pixels of a patch that have a residual, and their robust standard deviation.
pub struct Patch {
    pub pixels: Vec<usize>,
    pub sigma: f32,
    /// Whether steps are so coarse that the median says less than the spread of the bulk.
    pub coarse: bool,
}

/// Patches of an image that are at least a quarter full. The image is row-major, `width` px wide, in any
/// unit, NaN where there is no residual.
pub fn patches(image: &[f32], width: usize) -> impl Iterator<Item = Patch> + '_ {
    let side = (width / PATCHES_ACROSS).max(SMALLEST_PATCH);
    let height = image.len() / width.max(1);
    let corners = (0..height)
        .step_by(side)
        .flat_map(move |v0| (0..width).step_by(side).map(move |u0| [u0, v0]));
    corners.filter_map(move |[u0, v0]| {
        let (rows, end) = (v0..(v0 + side).min(height), (u0 + side).min(width));
        let all = rows.flat_map(|v| v * width + u0..v * width + end);
        let pixels: Vec<usize> = all.filter(|i| image[*i].is_finite()).collect();
        if pixels.len() < side * side / 4 {
            return None;
        }
        let mut sizes: Vec<f32> = pixels.iter().map(|i| image[*i].abs()).collect();
        let mad = MAD_TO_SIGMA as f32 * median_in_place(&mut sizes);
        // Coarse steps make the median jump; the spread of the bulk is a lower bound.
        let end = sizes.len() * 9 / 10;
        sizes.select_nth_unstable_by(end, f32::total_cmp);
        let most = &sizes[..end];
        let square: f64 = most.iter().map(|r| f64::from(*r).powi(2)).sum();
        // The inner 90 % of a Gaussian have .6230 of its variance.
        let spread = (square / most.len() as f64 / 0.6230).sqrt() as f32;
        let sigma = mad.max(0.8 * spread);
        let coarse = mad < sigma;
        (sigma > 0.0).then_some(Patch { pixels, sigma, coarse })
    })
}
