//! Residuals beyond four standard deviations: how many, and whether they are too many.

use serde_json::{Map, json};
use statrs::function::erf::erfc;

use super::known::KnownTerms;
use super::outliers::{Outliers, outliers};
use super::parameters::estimate;
use super::structure::Structure;
use super::texture_finding::{TextureFinding, ViewMean};
use crate::camera::Camera;
use crate::stats::{MAD_TO_SIGMA, bisect, median_in_place};
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

/// Standard errors that a model's scale may be off by.
pub const SURE_SCALE_ERRORS: f64 = 2.0;
/// A tail is heavy from this many times a Gaussian's share on.
const HEAVY: f64 = 2.5;
/// So much more where the size of the noise is uneven.
const MUCH_HEAVIER: f64 = 6.0;
/// So heavy it may look without a cause.
const UNEQUAL: f64 = 1.5;
/// Views too small to show a tail, in readings.
pub const FEWEST_READINGS: f64 = 5000.0;

/// Are the residuals' tails heavier than a Gaussian's? `uneven` says that the noise is of unequal
/// size where no law was found for it, which makes a tail too.
pub fn tails(
    views: &[Structure],
    known: &KnownTerms,
    level: f64,
    uneven: bool,
) -> Option<TextureFinding> {
    let mixture = Mixture::of(known);
    // A simulation's tails are compared elsewhere.
    if known.has("heavy-tails") && mixture.is_none() {
        return None;
    }
    let own = mixture.map_or(GAUSSIAN_TAIL, |m| m.tail(1.0, SURE_SCALE_ERRORS).max(GAUSSIAN_TAIL));
    let m = ViewMean::of(views, Structure::tail_share)?;
    // Patches of unequal noise, and steps of the words, make a tail of a Gaussian too.
    let much = if uneven { MUCH_HEAVIER } else { 1.0 };
    let expected = much * UNEQUAL * own;
    if m.value < much * HEAVY * own || m.p_above(expected) > level {
        return None;
    }
    let mut counts = TailCounts::default();
    views.iter().filter(|s| s.tail_share().is_some()).for_each(|s| counts.add(&s.tails));
    let mut parameters = Map::new();
    parameters.insert("share_beyond_4_sigma".into(), json!(m.value));
    // Where all that strays is gross it has no scale.
    let mut size_sigma = 4.0 * m.value.sqrt();
    if let Some(Outliers { fraction, scale }) = outliers(&counts, m.std_error / m.value) {
        parameters.insert("fraction".into(), estimate(fraction[0], fraction[1]));
        parameters.insert("scale".into(), estimate(scale[0], scale[1]));
        size_sigma = fraction[0].sqrt() * scale[0];
    }
    Some(TextureFinding {
        families: vec!["heavy-tails"],
        statistic: Statistic::Distribution,
        axis: Axis::Residual,
        interval: [4.0, 2.0 * mean_size(&counts) - 4.0],
        parameters,
        size_sigma,
        p: m.p_above(own),
        nats: m.value * views.iter().map(|s| s.tails.n).sum::<f64>() * (m.value / own).ln(),
        words: None,
    })
}

/// The model's heavy tails: noise of which a share is drawn so many times wider.
#[derive(Debug, Clone, Copy)]
pub struct Mixture {
    fraction: f64,
    scale: f64,
    scale_error: f64,
}

impl Mixture {
    pub fn of(known: &KnownTerms) -> Option<Self> {
        let at = |name| known.parameter("heavy-tails", name);
        let scale_error = known.std_error("heavy-tails", "scale");
        let mixture = Mixture { fraction: at("fraction")?, scale: at("scale")?, scale_error };
        (mixture.fraction > 0.0 && mixture.scale > 1.0).then_some(mixture)
    }

    /// Share of the readings beyond `t` of the narrow part's standard deviations.
    fn beyond(&self, t: f64) -> f64 {
        let gaussian = |t: f64| erfc(t * std::f64::consts::FRAC_1_SQRT_2);
        (1.0 - self.fraction) * gaussian(t) + self.fraction * gaussian(t / self.scale)
    }

    /// Standard deviation by the median, over that of the narrow part.
    pub fn width(&self) -> f64 {
        let [_, median] = bisect([0.0, self.scale], |t| self.beyond(t) > 0.5);
        MAD_TO_SIGMA * median
    }

    /// Share beyond four standard deviations where there is this share of the strays, and their scale
    /// is off by so many of its standard errors: that of weak tails is hardly known.
    pub fn tail(&self, share: f64, errors: f64) -> f64 {
        let scale = (self.scale + errors * self.scale_error).max(1.0);
        let other = Mixture { fraction: share * self.fraction, scale, ..*self };
        other.beyond(4.0 * other.width())
    }

    /// Of the strays, over the noise's standard deviation.
    pub fn size_sigma(&self) -> f64 {
        self.fraction.sqrt() * self.scale
    }
}

/// Of what lies between the edges, a bin's middle standing for it; at least five.
fn mean_size(counts: &TailCounts) -> f64 {
    let all: f64 = counts.between.iter().sum();
    let middles = TAIL_EDGES.windows(2).map(|w| 0.5 * (w[0] + w[1]));
    let sum: f64 = counts.between.iter().zip(middles).map(|(n, x)| n * x).sum();
    if all > 0.0 { sum / all } else { 5.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against a Monte-Carlo draw of the catalogue's mixture.
    #[test]
    fn a_mixture_is_as_wide_and_as_heavy_as_what_is_drawn_from_it() {
        use crate::rng::Seed;
        use rand::Rng;
        use rand_distr::{Distribution, StandardNormal};
        let mut rng = Seed(3).stream("mixture");
        for (fraction, scale) in [(0.05, 8.0), (0.3, 3.0), (1.0, 100.0)] {
            let mixture = Mixture { fraction, scale, scale_error: 0.0 };
            let mut drawn: Vec<f32> = (0..400_000)
                .map(|_| {
                    let one: f64 = StandardNormal.sample(&mut rng);
                    let wide = rng.random_bool(fraction);
                    (if wide { scale * one } else { one }).abs() as f32
                })
                .collect();
            let sigma = MAD_TO_SIGMA * f64::from(median_in_place(&mut drawn));
            assert!((mixture.width() / sigma - 1.0).abs() < 0.01, "{sigma} {}", mixture.width());
            let beyond = drawn.iter().filter(|d| f64::from(**d) > 4.0 * sigma).count() as f64;
            let share = beyond / drawn.len() as f64;
            let error = 5.0 * (share / drawn.len() as f64).sqrt();
            assert!((mixture.tail(1.0, 0.0) - share).abs() < error + 0.03 * share, "{share}");
        }
    }
}
