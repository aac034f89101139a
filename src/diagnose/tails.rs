//! Residuals beyond four standard deviations: how many, and whether they are too many.

use serde_json::{Map, json};
use statrs::function::erf::erfc;

use super::known::KnownTerms;
use super::outliers::{Outliers, outliers};
use super::parameters::estimate;
use super::patches::patches;
use super::structure::Structure;
use super::texture_finding::{self, TextureFinding, ViewMean};
use crate::stats::{MAD_TO_SIGMA, bisect};
use crate::terms::{Axis, Statistic};

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

/// The tail of an image's residuals.
pub fn tail(image: &[f32], width: usize) -> TailCounts {
    let mut counts = TailCounts::default();
    for patch in patches(image, width) {
        patch.pixels.iter().for_each(|i| counts.count(image[*i].abs() / patch.sigma));
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

/// What makes residuals look heavy-tailed where their noise is not.
#[derive(Debug, Clone, Copy, Default)]
pub struct Confusers {
    /// The noise is of unequal size where no law was found for it.
    pub uneven: bool,
    /// Tails are a simulation's or are compared with one: the light of a real sensor makes its noise
    /// uneven from pixel to pixel.
    pub simulated: bool,
}

/// Are the residuals' tails heavier than a Gaussian's?
///
/// Heavy ones show far out, weak ones in the fourth moment.
pub fn tails(
    views: &[Structure],
    known: &KnownTerms,
    level: f64,
    confusers: Confusers,
) -> Option<TextureFinding> {
    let mixture = Mixture::of(known);
    // A simulation's tails are compared elsewhere.
    if known.has("heavy-tails") && mixture.is_none() {
        return None;
    }
    let own = mixture.map_or(GAUSSIAN_TAIL, |m| m.tail(1.0, SURE_SCALE_ERRORS).max(GAUSSIAN_TAIL));
    let share = ViewMean::of(views, Structure::tail_share)?;
    // Patches of unequal noise, and steps of the words, make a tail of a Gaussian too.
    let much = if confusers.uneven { MUCH_HEAVIER } else { 1.0 };
    let expected = much * UNEQUAL * own;
    let readings: f64 = views.iter().map(|s| s.tails.n).sum();
    let (p, nats) = if share.value >= much * HEAVY * own && share.p_above(expected) <= level {
        (share.p_above(own), share.value * readings * (share.value / own).ln())
    } else {
        let looked = mixture.is_none() && !confusers.uneven && !confusers.simulated;
        let excess = ViewMean::of(views, |s| s.fourth.excess()).filter(|_| looked)?;
        let p = excess.p_above(0.0);
        (p <= level).then(|| (p, texture_finding::nats(&excess, 0.0)))?
    };
    let mut counts = TailCounts::default();
    views.iter().filter(|s| s.tail_share().is_some()).for_each(|s| counts.add(&s.tails));
    let mut parameters = Map::new();
    parameters.insert("share_beyond_4_sigma".into(), json!(share.value));
    // Where all that strays is gross it has no scale.
    let mut size_sigma = 4.0 * share.value.sqrt();
    if let Some(Outliers { fraction, scale }) = outliers(&counts, share.std_error / share.value) {
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
        p,
        nats,
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
    use crate::diagnose::kurtosis::FourthMoment;
    use crate::rng::Seed;
    use rand_distr::{Distribution, StandardNormal, StudentT};

    const VIEWS: usize = 14;

    /// Against a Monte-Carlo draw of the catalogue's mixture.
    #[test]
    fn a_mixture_is_as_wide_and_as_heavy_as_what_is_drawn_from_it() {
        use crate::stats::median_in_place;
        use rand::Rng;
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

    /// A Gaussian's own share beyond four deviations is no tail; a tenth of a per cent is one.
    #[test]
    fn tails_are_heavy_when_most_views_have_them() {
        let tailed = |share: f64, of: usize| -> Vec<Structure> {
            let view = |k: usize| {
                let (tail, n) = (if k < of { share } else { GAUSSIAN_TAIL }, 50_000.0);
                // As exponential as a tail of matches gone astray.
                let between = [0.4, 0.24, 0.2, 0.12, 0.03].map(|part| part * n * tail);
                let tails = TailCounts { n, beyond: n * tail, between };
                Structure { tails, ..Structure::default() }
            };
            (0..VIEWS).map(view).collect()
        };
        assert!(
            tails(
                &tailed(GAUSSIAN_TAIL, VIEWS),
                &KnownTerms::default(),
                1e-3,
                Confusers::default()
            )
            .is_none()
        );
        assert!(
            tails(&tailed(2e-3, 4), &KnownTerms::default(), 1e-3, Confusers::default()).is_none(),
            "in a few views only"
        );
        let found = tails(&tailed(2e-3, VIEWS), &KnownTerms::default(), 1e-3, Confusers::default())
            .expect("a tail");
        assert_eq!(found.families, ["heavy-tails"]);
        let fraction = found.parameters["fraction"]["value"].as_f64().expect("a number");
        assert!(fraction > 2e-3 && fraction < 0.2, "{fraction}");
        let mut known = KnownTerms::default();
        known.learn("heavy-tails", "fraction", fraction);
        assert!(tails(&tailed(2e-3, VIEWS), &known, 1e-3, Confusers::default()).is_none());
    }

    /// Weak tails, with hardly anything far out: a Student's t is seen by its fourth moment unless the
    /// noise is uneven anyway, or a simulation's; a Gaussian and a Gaussian of uneven size are not.
    #[test]
    fn weak_tails_are_seen_by_the_fourth_moment() {
        const SIZE: [usize; 2] = [200, 150];
        let student = StudentT::new(80.0).expect("a distribution");
        let views = |stream: &str, heavy: bool, uneven: f64| -> Vec<Structure> {
            let mut rng = Seed(11).stream(stream);
            let view = |_| {
                let mut pixel = |i: usize| -> f32 {
                    let x: f64 = if heavy {
                        student.sample(&mut rng)
                    } else {
                        StandardNormal.sample(&mut rng)
                    };
                    (x * (1.0 + uneven * ((i % SIZE[0]) as f64 / 25.0).sin())) as f32
                };
                let image: Vec<f32> = (0..SIZE[0] * SIZE[1]).map(&mut pixel).collect();
                Structure {
                    tails: tail(&image, SIZE[0]),
                    fourth: FourthMoment::of(&image, SIZE[0]),
                    ..Structure::default()
                }
            };
            (0..VIEWS).map(view).collect()
        };
        let told = |views: &[Structure], uneven: bool, simulated: bool| {
            let confusers = Confusers { uneven, simulated };
            tails(views, &KnownTerms::default(), 1e-3, confusers)
        };
        let heavy = views("student", true, 0.0);
        assert_eq!(told(&heavy, false, false).expect("weak tails").families, ["heavy-tails"]);
        assert!(told(&heavy, true, false).is_none(), "of a noise that is uneven anyway");
        assert!(told(&heavy, false, true).is_none(), "of a simulation");
        assert!(told(&views("gaussian", false, 0.0), false, false).is_none());
        assert!(told(&views("uneven", false, 0.3), false, false).is_none());
    }
}
