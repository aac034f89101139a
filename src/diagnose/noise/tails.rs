//! Tests for heavy tails: the number of residuals beyond four standard deviations, and the fourth moment.

use serde_json::{Map, json};

use super::mixture::Mixture;
use super::outliers::{Outliers, outliers};
use super::some_views::Above;
use super::structure::Structure;
use super::tail_counts::{GAUSSIAN_TAIL, TAIL_EDGES, TailCounts};
use super::tails_of_some::tailed_views;
use super::texture_finding::{EXCESS, TextureFinding};
use super::view_mean::{ViewMean, nats};
use crate::diagnose::finding::parameters::estimate;
use crate::diagnose::views::known::KnownTerms;
use crate::terms::{Axis, Statistic};

/// Allowed error of a model's scale, in standard errors.
pub const SURE_SCALE_ERRORS: f64 = 2.0;
/// Multiple of a Gaussian's share beyond 4 sigma from which a tail is heavy.
const HEAVY: f64 = 2.5;
/// Additional factor where the noise level is uneven.
const MUCH_HEAVIER: f64 = 6.0;
/// A wide component whose scale is not above this by two standard errors is noise of uneven level: light
/// known to an octave at the edges of a print leaves a factor of 1.4 in shot noise.
const UNEVEN_SCALE: f64 = 1.5;
/// Multiple of that share that may occur without a cause.
const UNEQUAL: f64 = 1.5;

/// Conditions under which residuals look heavy-tailed although the noise is not.
#[derive(Debug, Clone, Copy, Default)]
pub struct Confusers {
    /// The noise level is uneven in a way for which no law was found.
    pub uneven: bool,
    /// The views are simulated or compared with simulated ones. A simulation by formula lacks the
    /// pixel-to-pixel unevenness that light causes, so the two differ without heavy tails.
    pub simulated: bool,
    /// The raw values are quantised: how far out a view's residuals lie depends on where its steps fall.
    pub stepped: bool,
}

/// Tests whether the residuals have heavier tails than a Gaussian.
///
/// Heavy tails show far out, weak ones in the fourth moment.
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
    // Patches of unequal noise, and quantisation steps, give a Gaussian a tail too.
    let much = if confusers.uneven { MUCH_HEAVIER } else { 1.0 };
    let expected = much * UNEQUAL * own;
    let mut parameters = Map::new();
    parameters.insert("share_beyond_4_sigma".into(), json!(share.value));
    let heavy = much * HEAVY * own;
    let p = share.p_above(expected);
    if share.value >= heavy && p <= level {
        return far_out(views, parameters, own, p, confusers);
    }
    // Second test of tails at this level.
    let of_some = || tailed_views(views, expected, heavy);
    let comparable = !confusers.stepped && !confusers.simulated;
    let of_some = comparable.then(of_some).flatten();
    if let Some(Above { views: some, of, p }) = of_some.filter(|t| 2.0 * t.p <= level) {
        let found = far_out(&some, parameters, own, p, confusers)?;
        return Some(found.of_some([some.len(), of], 2.0 * p));
    }
    let looked = mixture.is_none() && !confusers.uneven && !confusers.simulated;
    if looked { weak(views, level, parameters) } else { None }
}

/// Finding from the counts far out in these views; `own` is the model's share.
fn far_out(
    views: &[Structure],
    mut parameters: Map<String, serde_json::Value>,
    own: f64,
    p: f64,
    confusers: Confusers,
) -> Option<TextureFinding> {
    let share = ViewMean::of(views, Structure::tail_share)?;
    parameters.insert("share_beyond_4_sigma".into(), json!(share.value));
    let mut counts = TailCounts::default();
    views.iter().filter(|s| s.tail_share().is_some()).for_each(|s| counts.add(&s.tails));
    // Gross errors alone have no scale.
    let mut size_sigma = 4.0 * share.value.sqrt();
    if let Some(Outliers { fraction, scale }) = outliers(&counts, share.std_error / share.value) {
        if confusers.uneven && scale[0] - 2.0 * scale[1] < UNEVEN_SCALE {
            return None;
        }
        parameters.insert("fraction".into(), estimate(fraction[0], fraction[1]));
        parameters.insert("scale".into(), estimate(scale[0], scale[1]));
        size_sigma = fraction[0].sqrt() * scale[0];
    }
    let readings: f64 = views.iter().map(independent_readings).sum();
    Some(TextureFinding {
        interval: [4.0, 2.0 * mean_size(&counts) - 4.0],
        parameters,
        size_sigma,
        p,
        nats: readings * (share.value * (share.value / own).ln() - (share.value - own)),
        ..TextureFinding::named(vec!["heavy-tails"], Statistic::Distribution, Axis::Residual)
    })
}

/// Effective number of independent readings: the pixels that share a window are far out together.
fn independent_readings(view: &Structure) -> f64 {
    view.tails.n / view.repeats()
}

/// Fraction reported for weak tails: the moment gives one number, the catalogue's mixture has two.
const WEAK_FRACTION: f64 = 0.1;

/// Weak tails, by the fourth moment. This is the third test of tails at this level,
/// so its p-value is trebled.
fn weak(
    views: &[Structure],
    level: f64,
    mut parameters: Map<String, serde_json::Value>,
) -> Option<TextureFinding> {
    // Noise that is Gaussian in the disparity or in the depth has no tails.
    let each = [0, 1].map(|k| ViewMean::of(views, |s| Some(s.excess()?[k])));
    let excess = each.into_iter().flatten().min_by(|a, b| a.value.total_cmp(&b.value))?;
    let p = 3.0 * excess.p_above(0.0);
    if p > level {
        return None;
    }
    // Excess of a mixture: 3 f (1 - f) x^2 / (1 + f x)^2, where the wide component has
    // 1 + x times the variance.
    let root = |k: f64| (k.max(0.0) / (3.0 * WEAK_FRACTION * (1.0 - WEAK_FRACTION))).sqrt();
    let scale = |k: f64| {
        let r = root(k);
        (1.0 + r / (1.0 - WEAK_FRACTION * r).max(WEAK_FRACTION)).sqrt()
    };
    let (k, error) = (excess.value, excess.std_error);
    let scale_error = 0.5 * (scale(k + error) - scale(k - error));
    parameters.insert(EXCESS.into(), estimate(k, error));
    parameters.insert("fraction".into(), estimate(WEAK_FRACTION, WEAK_FRACTION));
    parameters.insert("scale".into(), estimate(scale(k), scale_error));
    Some(TextureFinding {
        interval: [2.0, TAIL_EDGES[0]],
        parameters,
        // Root of the variance that the wide component adds, by its fraction.
        size_sigma: (WEAK_FRACTION * (scale(k).powi(2) - 1.0)).sqrt(),
        p,
        nats: nats(&excess, 0.0),
        ..TextureFinding::named(vec!["heavy-tails"], Statistic::Distribution, Axis::Residual)
    })
}

/// Mean size of the residuals between the edges, each at the middle of its bin; five where there are none.
fn mean_size(counts: &TailCounts) -> f64 {
    let all: f64 = counts.between.iter().sum();
    let middles = TAIL_EDGES.windows(2).map(|w| 0.5 * (w[0] + w[1]));
    let sum: f64 = counts.between.iter().zip(middles).map(|(n, x)| n * x).sum();
    if all > 0.0 { sum / all } else { 5.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::noise::tests::{drawn, gaussian_in_depth, normal, parameter};
    use rand_distr::{Distribution, StudentT};

    const VIEWS: usize = 14;

    /// A Gaussian's own share beyond four standard deviations is no heavy tail; 0.2 % is one.
    #[test]
    fn tails_are_heavy_when_most_views_have_them() {
        let tailed = |share: f64, of: usize| -> Vec<Structure> {
            let view = |k: usize| {
                let (tail, n) = (if k < of { share } else { GAUSSIAN_TAIL }, 50_000.0);
                // Roughly exponential, like a tail of false matches.
                let between = [0.4, 0.24, 0.2, 0.12, 0.03].map(|part| part * n * tail);
                let tails = TailCounts { n, beyond: n * tail, between };
                Structure { tails, far_places: n * tail, ..Structure::default() }
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
        let of = |views: usize, confusers: Confusers| {
            tails(&tailed(2e-3, views), &KnownTerms::default(), 1e-3, confusers)
        };
        assert!(of(1, Confusers::default()).is_none(), "in one odd view only");
        for some in [2, 4] {
            let found = of(some, Confusers::default()).expect("in some views");
            assert_eq!(found.words, Some(format!("in {some} of {VIEWS} views")));
        }
        // With quantisation steps, and next to a simulation, views differ anyway.
        for confusers in [
            Confusers { stepped: true, ..Confusers::default() },
            Confusers { simulated: true, ..Confusers::default() },
        ] {
            assert!(of(4, confusers).is_none(), "{confusers:?}");
        }
        let found = tails(&tailed(2e-3, VIEWS), &KnownTerms::default(), 1e-3, Confusers::default())
            .expect("a tail");
        assert_eq!(found.families, ["heavy-tails"]);
        let fraction = found.parameters["fraction"]["value"].as_f64().expect("a number");
        assert!(fraction > 2e-3 && fraction < 0.2, "{fraction}");
        let mut known = KnownTerms::default();
        known.learn("heavy-tails", "fraction", fraction);
        assert!(tails(&tailed(2e-3, VIEWS), &known, 1e-3, Confusers::default()).is_none());
    }

    /// Weak tails with hardly anything far out: the fourth moment shows a Student's t, unless the noise is
    /// uneven anyway or a simulation's. It shows neither a Gaussian nor a Gaussian of uneven level.
    #[test]
    fn weak_tails_are_seen_by_the_fourth_moment() {
        let student = StudentT::new(80.0).expect("a distribution");
        let heavy = |s: f64| drawn("student", s, |_, rng| student.sample(rng));
        let gaussian = |uneven: f64| {
            let size = move |i: usize| 1.0 + uneven * ((i % 200) as f64 / 25.0).sin();
            drawn("gaussian", 0.0, move |i, rng| size(i) * normal(rng))
        };
        let told = |views: &[Structure], uneven: bool, simulated: bool| {
            let confusers = Confusers { uneven, simulated, stepped: false };
            tails(views, &KnownTerms::default(), 1e-3, confusers)
        };
        let found = told(&heavy(0.0), false, false).expect("weak tails");
        assert_eq!(found.families, ["heavy-tails"]);
        let [fraction, scale, excess] = ["fraction", "scale", EXCESS]
            .map(|name| found.parameters[name]["value"].as_f64().expect("a number"));
        // The reported mixture has the measured excess.
        let x = fraction * (scale * scale - 1.0);
        let had = 3.0 * (1.0 - fraction) / fraction * (x / (1.0 + x)).powi(2);
        assert!((had / excess - 1.0).abs() < 1e-3, "{had} {excess}");
        // For noise that is no small part of the depth, also in the depth.
        const S: f64 = 0.035;
        assert!(told(&heavy(S), false, false).is_some());
        let in_depth = |s: f64| {
            let mut views = drawn("tails/depth", s, |_, rng| gaussian_in_depth(S, rng));
            views.iter_mut().for_each(|v| v.tails.beyond = GAUSSIAN_TAIL * v.tails.n);
            views
        };
        // Its excess in the disparity is 72 s^2 = .088, of which .013 lie beyond the cut.
        let bent = told(&in_depth(0.0), false, false).expect("heavy in the disparity");
        let [value, error] = parameter(&bent, EXCESS);
        assert!((value - 0.075).abs() < 4.0 * error, "{value} +- {error}");
        assert!(told(&in_depth(S), false, false).is_none(), "Gaussian in the depth");
        assert!(told(&heavy(0.0), true, false).is_none(), "of a noise that is uneven anyway");
        assert!(told(&heavy(0.0), false, true).is_none(), "of a simulation");
        assert!(told(&[], false, false).is_none());
        assert!(told(&gaussian(0.0), false, false).is_none());
        assert!(told(&gaussian(0.3), false, false).is_none());
    }
}
