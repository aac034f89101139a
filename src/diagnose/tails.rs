//! Residuals beyond four standard deviations: how many, and whether they are too many.

use serde_json::{Map, json};

use super::hanging::{Hanging, Mean};
use super::known::KnownTerms;
use super::parameters::estimate;
use super::strays::{Strays, strays};
use super::structure::Structure;
use crate::camera::Camera;
use crate::stats::{MAD_TO_SIGMA, median_in_place};
use crate::terms::{Axis, Statistic};

/// A Gaussian's share beyond four standard deviations.
pub const GAUSSIAN_TAIL: f64 = 6.334e-5;
const TAIL_SIGMAS: f32 = 4.0;
/// What lies beyond the last is no tail of the noise: a few such errors would decide its mean.
pub const TAIL_EDGES: [f64; 6] = [4.0, 5.0, 6.0, 8.0, 11.0, 16.0];

/// Side of the patches whose own scale their residuals are held against: this share of the
/// picture's width, px.
const PATCHES_ACROSS: usize = 7;
const SMALLEST_PATCH: usize = 40;

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

    pub fn count(&mut self, sigmas: f32) {
        self.n += 1.0;
        self.beyond += f64::from(u8::from(sigmas > TAIL_SIGMAS));
        let inside = |w: &[f64]| (w[0]..w[1]).contains(&f64::from(sigmas));
        if let Some(k) = TAIL_EDGES.windows(2).position(inside) {
            self.between[k] += 1.0;
        }
    }
}

/// The tail of an image's residuals.
pub fn tail(image: &[f32], camera: &Camera) -> TailCounts {
    let mut counts = TailCounts::default();
    let side = (camera.width / PATCHES_ACROSS).max(SMALLEST_PATCH);
    for v0 in (0..camera.height).step_by(side) {
        for u0 in (0..camera.width).step_by(side) {
            let rows = v0..(v0 + side).min(camera.height);
            let patch: Vec<f32> = rows
                .flat_map(|v| {
                    let u1 = (u0 + side).min(camera.width);
                    image[v * camera.width + u0..v * camera.width + u1].iter().copied()
                })
                .filter(|r| r.is_finite())
                .map(f32::abs)
                .collect();
            if patch.len() < side * side / 4 {
                continue;
            }
            let mut sizes = patch.clone();
            let mad = MAD_TO_SIGMA as f32 * median_in_place(&mut sizes);
            // Coarse words make the median jump; the bulk's own spread bounds it below.
            let end = sizes.len() * 9 / 10;
            sizes.select_nth_unstable_by(end, f32::total_cmp);
            let most = &sizes[..end];
            let square: f64 = most.iter().map(|r| f64::from(*r).powi(2)).sum();
            // Nine tenths of a Gaussian have 0.72 of its standard deviation... squared 0.6225.
            let spread = (square / most.len() as f64 / 0.6225).sqrt() as f32;
            let sigma = mad.max(0.8 * spread);
            if sigma > 0.0 {
                patch.iter().for_each(|r| counts.count(*r / sigma));
            }
        }
    }
    counts
}

/// A tail is heavy from this many times a Gaussian's share on.
const HEAVY: f64 = 2.5;
/// So much more where the size of the noise is uneven.
const MUCH_HEAVIER: f64 = 6.0;
/// So heavy it may look without a cause.
const UNEQUAL: f64 = 1.5;
/// Views too small to show a tail, in readings.
const FEWEST_READINGS: f64 = 5000.0;

/// Are the residuals' tails heavier than a Gaussian's? `uneven` says that the noise is of unequal
/// size where no law was found for it, which makes a tail too.
pub fn tails(views: &[Structure], known: &KnownTerms, level: f64, uneven: bool) -> Option<Hanging> {
    if known.has("heavy-tails") {
        return None;
    }
    let looked = |s: &Structure| s.tail_pixels > FEWEST_READINGS;
    let m = Mean::of(views, |s| looked(s).then_some(s.tail))?;
    // Patches of unequal noise, and steps of the words, make a tail of a Gaussian too.
    let much = if uneven { MUCH_HEAVIER } else { 1.0 };
    let expected = much * UNEQUAL * GAUSSIAN_TAIL;
    if m.value < much * HEAVY * GAUSSIAN_TAIL || m.p_above(expected) > level {
        return None;
    }
    let mut counts = TailCounts::default();
    views.iter().filter(|s| looked(s)).for_each(|s| counts.add(&s.tails));
    let mut parameters = Map::new();
    parameters.insert("share_beyond_4_sigma".into(), json!(m.value));
    // Where all that strays is gross it has no scale.
    let mut size_sigma = 4.0 * m.value.sqrt();
    if let Some(Strays { fraction, scale }) = strays(&counts, m.std_error / m.value) {
        parameters.insert("fraction".into(), estimate(fraction[0], fraction[1]));
        parameters.insert("scale".into(), estimate(scale[0], scale[1]));
        size_sigma = fraction[0].sqrt() * scale[0];
    }
    Some(Hanging {
        families: vec!["heavy-tails"],
        statistic: Statistic::Distribution,
        axis: Axis::Residual,
        interval: [4.0, 2.0 * mean_size(&counts) - 4.0],
        parameters,
        size_sigma,
        p: m.p_above(GAUSSIAN_TAIL),
        nats: m.value
            * views.iter().map(|s| s.tail_pixels).sum::<f64>()
            * (m.value / GAUSSIAN_TAIL).ln(),
        words: None,
    })
}

/// Of what lies between the edges, a bin's middle standing for it; at least five.
fn mean_size(counts: &TailCounts) -> f64 {
    let all: f64 = counts.between.iter().sum();
    let middles = TAIL_EDGES.windows(2).map(|w| 0.5 * (w[0] + w[1]));
    let sum: f64 = counts.between.iter().zip(middles).map(|(n, x)| n * x).sum();
    if all > 0.0 { sum / all } else { 5.0 }
}
