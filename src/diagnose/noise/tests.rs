//! Findings from synthetic structures, and how often noise alone gives one.

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use serde_json::{Map, json};

use super::*;
use crate::diagnose::noise::frame_series::{Jitter, Squares};
use crate::diagnose::noise::in_time::still_share;
use crate::diagnose::noise::moments::Moments;
use crate::diagnose::noise::still::Still;
use crate::diagnose::noise::tail_counts::tail;
use crate::model::{Effect, NoiseModel};
use crate::rng::{Seed, Stream};
use crate::simulate::kinect_v1;

const VIEWS: usize = 14;
const LEVEL: f64 = 1e-3;
/// Relative scatter of a view's statistic.
const SCATTER: f64 = 0.02;

pub(super) fn normal(rng: &mut Stream) -> f64 {
    StandardNormal.sample(rng)
}

/// A model that knows one parameter.
fn knowing(id: &str, name: &str, value: f64) -> KnownTerms {
    let mut parameters = Map::new();
    parameters.insert(name.into(), json!(value));
    let effects = vec![Effect { id: id.into(), parameters, ..Effect::default() }];
    let model = NoiseModel { effects, ..NoiseModel::paper() };
    KnownTerms::of(&model, &kinect_v1(1).camera)
}

/// Statistics of views without any structure, with measurement errors.
fn plain(rng: &mut Stream) -> Vec<Structure> {
    (0..VIEWS)
        .map(|_| Structure {
            variance_px2: 0.04,
            window_px: Some(1.0 + SCATTER * normal(rng)),
            lagged: std::array::from_fn(|_| Some(SCATTER * normal(rng))),
            still: Still {
                fixed_px2: Some(1e-4 * normal(rng)),
                fixed_pixels: 1e5,
                lines_px2: [Some(1e-4 * normal(rng)); 2],
                ..Still::default()
            },
            row_px2: Some(1e-4 * normal(rng)),
            column_px2: Some(1e-4 * normal(rng)),
            ..Structure::default()
        })
        .collect()
}

/// `plain`, with something added to every view.
pub(super) fn with(rng: &mut Stream, add: impl FnMut(&mut Structure)) -> Vec<Structure> {
    let mut views = plain(rng);
    views.iter_mut().for_each(add);
    views
}

/// Views with errors drawn pixel by pixel, of `relative_sigma` times the disparity.
pub(super) fn drawn(
    stream: &str,
    relative_sigma: f64,
    draw: impl Fn(usize, &mut Stream) -> f64,
) -> Vec<Structure> {
    const SIZE: [usize; 2] = [200, 150];
    let mut rng = Seed(6).stream(stream);
    let view = |_| {
        let image: Vec<f32> = (0..SIZE[0] * SIZE[1]).map(|i| draw(i, &mut rng) as f32).collect();
        Structure {
            pixels: image.len() as f64,
            tails: tail(&image, SIZE[0], &mut vec![false; image.len()]),
            moments: Moments::of(&image, SIZE[0]),
            relative_sigma,
            ..Structure::default()
        }
    };
    (0..VIEWS).map(view).collect()
}

/// An error of the disparity that is Gaussian in the depth, `s` times the disparity: in units of its size and
/// about its mean, as the high-pass leaves it.
pub(super) fn gaussian_in_depth(s: f64, rng: &mut Stream) -> f64 {
    let x = normal(rng);
    x / (1.0 - s * x) - s
}

fn names(found: &[TextureFinding]) -> Vec<&'static str> {
    found.iter().flat_map(|h| h.families.first().copied()).collect()
}

#[track_caller]
pub(super) fn parameter(found: &TextureFinding, name: &str) -> [f64; 2] {
    ["value", "std_error"].map(|key| found.parameters[name][key].as_f64().expect("a number"))
}

/// Ten tests at 1e-3 in 400 recordings: at most 4 false alarms are expected; more than 10 have a chance
/// of 3e-3.
#[test]
fn structures_of_nothing_amount_to_nothing() {
    let mut alarms = Vec::new();
    for seed in 0..400 {
        let mut rng = Seed(seed).stream("noise/null");
        let views = moving(0.0, 0.0, &mut rng);
        alarms.extend(names(&texture_findings(&views, &KnownTerms::default(), LEVEL)));
    }
    println!("{} false alarms in 400: {alarms:?}", alarms.len());
    assert!(alarms.len() <= 10, "{alarms:?}");
}

#[test]
fn each_structure_has_its_name_and_size() {
    // Added (to a variance of 0.04 px^2), name, parameter, its value.
    type Add = fn(&mut Structure);
    let cases: [(Add, &str, &str, f64); 4] = [
        (|s| s.window_px = s.window_px.map(|w| 5.0 * w), "spatial-correlation", "length_px", 5.0),
        (
            |s| s.still.fixed_px2 = s.still.fixed_px2.map(|f| f + 0.004),
            "fixed-pattern-noise",
            "sigma_px",
            0.004f64.sqrt(),
        ),
        (|s| s.row_px2 = s.row_px2.map(|r| r + 0.01), "row-noise", "sigma_px", 0.1),
        (|s| s.lagged = s.lagged.map(|l| l.map(|c| c + 0.3)), "frozen-noise", "fraction", 0.3),
    ];
    for (add, name, key, value) in cases {
        let mut rng = Seed(1).stream(name);
        let views = with(&mut rng, add);
        let found = texture_findings(&views, &KnownTerms::default(), LEVEL);
        assert_eq!(names(&found), [name]);
        let [estimate, error] = parameter(&found[0], key);
        // Six standard errors, with 13 degrees of freedom: 5e-5.
        assert!(
            (estimate - value).abs() < 6.0 * error,
            "{name}: {estimate} +- {error}, put {value}"
        );
        assert!(error < 0.1 * value && found[0].p < 1e-6, "{name}: +- {error}, p {}", found[0].p);
        // What the model knows is not found again.
        let known = knowing(name, key, value);
        let again = texture_findings(&views, &known, LEVEL);
        assert!(again.is_empty(), "{name} is known: {:?}", names(&again));
    }
}

/// c_k = s + (1 - s) rho^k, exactly.
#[test]
fn what_stands_still_is_told_from_what_fades() {
    for s in [0.0, 0.2, 0.5] {
        for rho in [0.3, 0.5, 0.7f64] {
            let c = [1, 2, 3].map(|k| s + (1.0 - s) * rho.powi(k));
            let found = still_share(c[0], c[1], Some(c[2]));
            assert!((found - s).abs() < 1e-9, "s {s}, rho {rho}: {found}");
        }
        let found = still_share(s, s, Some(s));
        assert!((found - s).abs() < 1e-9, "s {s} alone: {found}");
    }
}

#[test]
fn a_filter_in_time_is_a_filter_and_is_no_news_when_known() {
    let rho = 0.5f64;
    let add = |s: &mut Structure| {
        for (k, lag) in s.lagged.iter_mut().enumerate() {
            *lag = lag.map(|c| c + rho.powi(k as i32 + 1));
        }
    };
    let mut rng = Seed(2).stream("noise/filter");
    let views = with(&mut rng, add);
    let found = texture_findings(&views, &KnownTerms::default(), LEVEL);
    assert_eq!(names(&found)[0], "temporal-correlation");
    let [value, error] = parameter(&found[0], "rho");
    assert!((value - rho).abs() < 6.0 * error && error < 0.05, "{value} +- {error}");
    let again = texture_findings(&views, &knowing("temporal-correlation", "rho", rho), LEVEL);
    assert!(again.is_empty(), "a known filter is {:?}", names(&again));
}

/// Slowly changing noise makes successive frames alike. A fall from no correlation to negative ones, though
/// larger than chance, is no filter.
#[test]
fn a_fall_to_frames_that_differ_is_no_filter() {
    let mut rng = Seed(9).stream("noise/fall");
    let add = |s: &mut Structure| {
        for lag in &mut s.lagged[1..] {
            *lag = lag.map(|c| c - 0.05);
        }
    };
    let views = with(&mut rng, add);
    let fall = ViewMean::of(&views, |s| Some(s.lagged[0]? - s.lagged[1]?)).expect("a mean");
    assert!(fall.p_above(0.0) < LEVEL, "{fall:?}");
    assert!(texture_findings(&views, &KnownTerms::default(), LEVEL).is_empty());
}

/// With two frames per view, constant and fading noise cannot be told apart.
#[test]
fn two_frames_leave_two_names() {
    let mut rng = Seed(3).stream("noise/two");
    let add = |s: &mut Structure| {
        s.lagged = [s.lagged[0].map(|c| c + 0.4), None, None];
    };
    let found = texture_findings(&with(&mut rng, add), &KnownTerms::default(), LEVEL);
    assert_eq!(found.len(), 1);
    let mut both = found[0].families.clone();
    both.sort_unstable();
    assert_eq!(both, ["frozen-noise", "temporal-correlation"]);
}

/// Columns that move together, or have a constant error each, have no name, but a statistic and an axis.
#[test]
fn columns_that_move_as_one_have_no_name() {
    type Add = fn(&mut Structure);
    let cases: [(Add, Statistic); 2] = [
        (|s| s.column_px2 = s.column_px2.map(|c| c + 0.01), Statistic::Correlation),
        (|s| s.still.lines_px2[0] = s.still.lines_px2[0].map(|c| c + 0.01), Statistic::Bias),
    ];
    for (add, statistic) in cases {
        let mut rng = Seed(4).stream("noise/columns");
        let found = texture_findings(&with(&mut rng, add), &KnownTerms::default(), LEVEL);
        assert_eq!(found.len(), 1);
        assert!(found[0].families.is_empty() && found[0].words.is_some());
        assert_eq!((found[0].statistic, found[0].axis), (statistic, Axis::Column));
        let [value, error] = parameter(&found[0], "sigma_px");
        assert!((value - 0.1).abs() < 6.0 * error && error < 0.01, "{value} +- {error}");
    }
}

/// Means of 6 frames about a line; `sigma_px` is their scatter beyond what the pixels explain.
fn jitter(sigma_px: f64, velocity_px: f64, rng: &mut Stream) -> Jitter {
    const FREEDOM: usize = 4;
    let expected = 1e-6;
    let spread = (expected + sigma_px * sigma_px).sqrt();
    let sum = (0..FREEDOM).map(|_| (spread * normal(rng)).powi(2)).sum();
    let trend = spread * normal(rng) + velocity_px * rng.random_range(0.8..1.2);
    let about = Squares { sum, freedom: FREEDOM as f64, expected };
    Jitter { about, trend_px2: trend * trend, velocity_mps: trend }
}

fn moving(sigma_px: f64, velocity_px: f64, rng: &mut Stream) -> Vec<Structure> {
    let mut views = plain(rng);
    views.iter_mut().for_each(|s| s.jitter = Some(jitter(sigma_px, velocity_px, rng)));
    views
}

#[test]
fn jitter_and_motion_are_told_apart() {
    let mut rng = Seed(6).stream("noise/jitter");
    let found = texture_findings(&moving(0.02, 0.0, &mut rng), &KnownTerms::default(), LEVEL);
    assert_eq!(names(&found), ["frame-jitter"]);
    let [value, error] = parameter(&found[0], "sigma_px");
    assert!((value - 0.02).abs() < 5.0 * error && error < 0.004, "{value} +- {error}");
    let known = knowing("frame-jitter", "sigma_px", 0.02);
    assert!(texture_findings(&moving(0.02, 0.0, &mut rng), &known, LEVEL).is_empty());
    let found = texture_findings(&moving(0.0, 0.05, &mut rng), &KnownTerms::default(), LEVEL);
    assert_eq!(names(&found), ["target-motion"]);
}

/// Correlated frames drift to either side; a drift that all views share is a motion.
#[test]
fn motion_is_what_all_views_have_in_common() {
    let filter = knowing("temporal-correlation", "rho", 0.75);
    let resembling = |velocity_px: f64, signed: bool| {
        let mut rng = Seed(8).stream("noise/wander");
        let mut views = moving(0.0, velocity_px, &mut rng);
        for s in &mut views {
            s.lagged = [0.75, 0.56, 0.42].map(|rho| Some(rho + 0.01 * normal(&mut rng)));
            let jitter = s.jitter.as_mut().expect("a jitter");
            if signed && rng.random::<bool>() {
                jitter.velocity_mps *= -1.0;
            }
        }
        [&KnownTerms::default(), &filter].map(|known| texture_findings(&views, known, LEVEL))
    };
    // The drift is no motion either where the filter is known.
    let drifting = resembling(0.003, true);
    assert!(drifting.iter().all(|found| !names(found).contains(&"target-motion")));
    let [found, _] = resembling(0.003, false);
    let motion = found.iter().find(|h| h.families == ["target-motion"]).expect("a motion");
    let [velocity, error] = parameter(motion, "velocity_mps");
    assert!((velocity - 0.003).abs() < 3.0 * error && error < 0.001, "{velocity} +- {error}");
}

#[test]
fn one_view_is_no_sample() {
    let mut rng = Seed(7).stream("noise/one");
    let add = |s: &mut Structure| s.window_px = Some(5.0);
    let one = &with(&mut rng, add)[..1];
    assert!(texture_findings(one, &KnownTerms::default(), LEVEL).is_empty());
    assert!(texture_findings(&[], &KnownTerms::default(), LEVEL).is_empty());
}
