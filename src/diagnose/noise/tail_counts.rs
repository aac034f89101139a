//! How many residuals lie how far out, in standard deviations of their patch.

use crate::diagnose::views::patches::patches;

/// A Gaussian's share beyond four standard deviations.
pub const GAUSSIAN_TAIL: f64 = 6.334e-5;
const TAIL_SIGMAS: f32 = 4.0;
/// What lies beyond the last is no tail of the noise: a few such errors would decide its mean.
pub const TAIL_EDGES: [f64; 6] = [4.0, 5.0, 6.0, 8.0, 11.0, 16.0];

/// How many residuals were looked at, and how many lie between each two of [`TAIL_EDGES`], in
/// standard deviations of their patch; beyond the first, whatever their size, in all.
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

    /// Share beyond the first edge.
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

/// The tail of an image's residuals: row by row, `width` px a row, NaN where there is none.
pub fn tail(image: &[f32], width: usize) -> TailCounts {
    let mut counts = TailCounts::default();
    for patch in patches(image, width) {
        patch.pixels.iter().for_each(|i| counts.count(image[*i].abs() / patch.sigma));
    }
    counts
}

/// Views too small to show a tail, in readings.
pub const FEWEST_READINGS: f64 = 5000.0;
