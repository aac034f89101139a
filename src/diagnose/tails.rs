//! Residuals beyond four standard deviations: how many, and whether they are too many.

use serde_json::json;
use statrs::distribution::{Continuous, ContinuousCDF};

use super::hanging::{Hanging, Mean, one};
use super::known::KnownTerms;
use super::parameters::estimate;
use super::structure::Structure;
use crate::camera::Camera;
use crate::stats::{MAD_TO_SIGMA, median_in_place};
use crate::terms::{Axis, Statistic};

/// A Gaussian's share beyond four standard deviations.
pub const GAUSSIAN_TAIL: f64 = 6.334e-5;
const TAIL_SIGMAS: f32 = 4.0;

/// Side of the patches whose own scale their residuals are held against: this share of the
/// picture's width, px.
const PATCHES_ACROSS: usize = 7;
const SMALLEST_PATCH: usize = 40;

/// Share of residuals beyond four standard deviations of their patch, their number, and how far
/// out they lie, in standard deviations.
pub fn tail(image: &[f32], camera: &Camera) -> (f64, f64, f64) {
    let (mut beyond, mut n, mut size) = (0.0, 0.0, 0.0);
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
            if sigma <= 0.0 {
                continue;
            }
            for r in &patch {
                n += 1.0;
                if *r > TAIL_SIGMAS * sigma {
                    beyond += 1.0;
                    size += f64::from(r / sigma);
                }
            }
        }
    }
    if n > 0.0 { (beyond / n, n, size / f64::max(beyond, 1.0)) } else { (0.0, 0.0, 0.0) }
}

/// A tail is heavy from this many times a Gaussian's share on.
const HEAVY: f64 = 2.5;
/// So much more where the size of the noise is uneven.
const MUCH_HEAVIER: f64 = 6.0;
/// So heavy it may look without a cause.
const UNEQUAL: f64 = 1.5;
/// A tail of another form than two Gaussians moves its parameters by this share.
const TAIL_FORM: f64 = 0.2;
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
    let size = Mean::of(views, |s| (looked(s) && s.tail > 0.0).then_some(s.tail_size))?;
    let more = m.value - GAUSSIAN_TAIL;
    // How far out they lie that are no Gaussian's.
    let mean = (m.value * size.value - GAUSSIAN_TAIL * beyond_four(1.0).1) / more;
    let scale = wider(mean);
    let fraction = (more / beyond_four(scale).0).clamp(0.0, 1.0);
    let scatter = m.std_error / m.value.max(1e-12);
    let mut parameters = one("fraction", fraction, fraction * scatter.hypot(TAIL_FORM));
    let scatter = size.std_error / (size.value - 4.0).max(1e-6);
    parameters.insert("scale".into(), estimate(scale, scale * scatter.hypot(TAIL_FORM)));
    parameters.insert("share_beyond_4_sigma".into(), json!(m.value));
    Some(Hanging {
        families: vec!["heavy-tails"],
        statistic: Statistic::Distribution,
        axis: Axis::Residual,
        interval: [4.0, 4.0 + 2.0 * (size.value - 4.0).max(0.5)],
        parameters,
        size_sigma: fraction.sqrt() * scale,
        p: m.p_above(GAUSSIAN_TAIL),
        nats: m.value
            * views.iter().map(|s| s.tail_pixels).sum::<f64>()
            * (m.value / GAUSSIAN_TAIL).ln(),
        words: None,
    })
}

/// Share of a Gaussian of this standard deviation beyond four, and its mean distance there.
fn beyond_four(scale: f64) -> (f64, f64) {
    let normal = statrs::distribution::Normal::standard();
    let t = 4.0 / scale;
    let share = 2.0 * normal.sf(t);
    (share, 2.0 * scale * Continuous::pdf(&normal, t) / share)
}

/// Standard deviation of a Gaussian whose mean distance beyond four is `mean`, by bisection.
fn wider(mean: f64) -> f64 {
    let (mut low, mut high) = (1.1, 20.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if beyond_four(middle).1 < mean { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}
