//! Baselines on white data whose truth is known, and one recording from the disk.

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::camera::Camera;
use crate::correct::Conditions;
use crate::plane::Plane;
use crate::prove::gain::{Oracle, Stand, gain_of, tests::*};
use crate::prove::question::ExamView;
use crate::rng::{Seed, Stream};
use crate::terms::{PixelContext, Pixels};

type Law = dyn Fn(&PixelContext) -> f64;

fn no_bias(_: &PixelContext) -> f64 {
    0.0
}

fn no_spread(_: &PixelContext) -> f64 {
    1.0
}

fn planes() -> Vec<Plane> {
    (0..16)
        .map(|k| {
            let k = f64::from(k);
            let (z, theta) = (0.9 * 1.08f64.powf(k), 0.1 + 0.6 * (0.618 * k).fract());
            Plane::tilted(z, theta, 2.4 * k)
        })
        .collect()
}

/// Views of 5 px tiles with white noise; `bias` in px, `spread` a factor on sigma.
fn tiles(bias: &Law, spread: &Law, rng: &mut Stream) -> Tiles {
    let sensor = sensor();
    let camera = &sensor.camera;
    let rays = camera.rays();
    let scale = sensor.disparity_px_m().unwrap();
    let all = vec![true; camera.pixels()];
    let view = |plane: &Plane, rng: &mut Stream| {
        let pixels = Pixels::new(camera, &rays, scale);
        let stand = Stand::new(pixels, *plane, &all, Conditions::default());
        let mut tiles = Vec::new();
        for v in (1..camera.height - 1).step_by(3) {
            for u in (1..camera.width - 1).step_by(3) {
                let near = |k: usize| (v + k / 3 - 1) * camera.width + u + k % 3 - 1;
                let places: Vec<PixelContext> = (0..9).map(|k| stand.place(near(k))).collect();
                tiles.push(tile(&places, bias, spread, rng));
            }
        }
        tiles
    };
    let views = planes().iter().map(|p| view(p, rng)).collect();
    Tiles::join(&sensor, views).unwrap()
}

/// 9 pixels of 4 frames.
const COUNT: f64 = 36.0;

fn tile(places: &[PixelContext], bias: &Law, spread: &Law, rng: &mut Stream) -> Tile {
    let variance = SIGMA_PX * SIGMA_PX;
    let place = PixelContext { side: 3.0, variance, ..places[4] };
    let sigma = SIGMA_PX * spread(&place);
    let (mut sum, mut squares) = (0.0, 0.0);
    for p in places {
        let bias = bias(p);
        for _ in 0..4 {
            let normal: f64 = StandardNormal.sample(rng);
            let e = bias + sigma * normal;
            sum += e;
            squares += e * e;
        }
    }
    Tile { place, mean: sum / COUNT, square: squares / COUNT, variance, count: COUNT }
}

/// Fresh views: four inside, two nearer than any before.
fn exam(bias: &Law, spread: &Law) -> Vec<ExamView> {
    let places = [(1.1, 0.2, 0.5), (1.6, 0.6, 2.0), (2.1, 0.4, 4.0), (2.6, 0.6, 5.5)];
    let outside = [(0.55, 0.3, 1.0), (0.6, 0.7, 3.0)];
    let pick = |&(z, theta, azimuth): &(f64, f64, f64), beyond: bool| {
        let plane = Plane::tilted(z, theta, azimuth);
        let camera: Camera = sensor().camera;
        let rays = camera.rays();
        let scale = sensor().disparity_px_m().unwrap();
        let on = vec![true; camera.pixels()];
        let stand =
            Stand::new(Pixels::new(&camera, &rays, scale), plane, &on, Conditions::default());
        let at = |[u, v, ..]: Spot| stand.place(v as usize * camera.width + u as usize);
        let mut view = view(&plane, &|s| bias(&at(s)), &|s| spread(&at(s)));
        view.beyond = beyond;
        view
    };
    let inside = places.iter().map(|p| pick(p, false));
    inside.chain(outside.iter().map(|p| pick(p, true))).collect()
}

/// Gains over the oracle's, inside and beyond, and what was learnt.
fn ratios(baseline: &dyn Baseline, bias: &Law, spread: &Law) -> ([f64; 2], Fitted) {
    let tiles = tiles(bias, spread, &mut Seed(5).stream("baselines"));
    let fitted = baseline.fit(&tiles).unwrap();
    let views = exam(bias, spread);
    let oracle = gain_of(&views, &Oracle).unwrap();
    let gain = gain_of(&views, fitted.predictor.as_ref()).unwrap();
    ([gain.within / oracle.within, gain.beyond / oracle.beyond], fitted)
}

/// A cubic that no plane takes: and log variance with a square.
fn cubic(p: &PixelContext) -> f64 {
    let (u, v) = (p.u / 40.0 - 1.0, p.v / 30.0 - 1.0);
    0.15 * u * u * v - 0.1 * v * v + 0.016 * u * v * p.disparity
}

fn rim(p: &PixelContext) -> f64 {
    (0.4 * p.radius * p.radius).exp()
}

fn bowl(p: &PixelContext) -> f64 {
    0.25 * p.radius * p.radius
}

#[test]
fn a_polynomial_recovers_a_polynomial() {
    let ([within, _], fitted) = ratios(&Polynomial, &cubic, &no_spread);
    assert!(within > 0.95 && within < 1.001, "{within}");
    // 20 monomials for the variance; the constant, u, v and 1/z are a plane's.
    assert_eq!(fitted.parameters, 16 + 20);
    let ([within, _], _) = ratios(&Polynomial, &bowl, &rim);
    assert!(within > 0.95, "{within}");
}

#[test]
fn a_gaussian_process_learns_inside_and_knows_nothing_beyond() {
    let ([within, _], fitted) = ratios(&GaussianProcess, &cubic, &rim);
    assert!(within > 0.9 && within < 1.001, "{within}");
    assert!(fitted.parameters > 20 && fitted.parameters < 400, "{}", fitted.parameters);
    // A ripple in the inverse depth, and views nearer than any before.
    let ripple = |p: &PixelContext| 0.2 * (1.4 * p.disparity).sin();
    let ([within, beyond], _) = ratios(&GaussianProcess, &ripple, &no_spread);
    assert!(within > 0.5 && beyond < 0.3, "{within} {beyond}");
}

#[test]
fn a_grid_learns_a_bowl() {
    let ([within, _], fitted) = ratios(&Clams, &bowl, &no_spread);
    assert!(within > 0.7 && within < 1.001, "{within}");
    assert!(fitted.parameters > 300 && fitted.names.is_none());
}

/// Each effect of the columns by its own name alone, on white data.
#[test]
fn sparse_regression_names_what_it_has_columns_for() {
    let locking = |p: &PixelContext| 0.03 * (std::f64::consts::TAU * p.disparity).sin();
    let exponent = |p: &PixelContext| (p.z / 2.0).powf(0.4);
    let none: (&Law, &Law) = (&no_bias, &no_spread);
    let cases: [(&[&str], &Law, &Law); 5] = [
        (&["radial-disparity-bias"], &bowl, none.1),
        (&["pixel-locking"], &locking, none.1),
        (&["vignetting"], none.0, &rim),
        (&["range-exponent"], none.0, &exponent),
        (&["radial-disparity-bias", "vignetting"], &bowl, &rim),
    ];
    for (names, bias, spread) in cases {
        let ([within, _], fitted) = ratios(&Sparse, bias, spread);
        assert_eq!(fitted.names.unwrap(), names);
        assert!(within > 0.95, "{names:?} {within}");
    }
    let clean = tiles(none.0, none.1, &mut Seed(6).stream("baselines"));
    assert_eq!(Sparse.fit(&clean).unwrap().names, Some(Vec::new()));
}

#[test]
fn symbolic_regression_finds_simple_formulas() {
    let ([within, _], fitted) = ratios(&Symbolic::default(), &bowl, &no_spread);
    assert!(within > 0.9, "{within}");
    assert_eq!(fitted.names.unwrap(), ["radial-disparity-bias"]);
    let ([within, _], fitted) = ratios(&Symbolic::default(), &no_bias, &|_| 1.4);
    assert!(within > 0.95, "{within}");
    assert_eq!(fitted.names.unwrap(), ["recalibrate"]);
}

/// Twice the same to the bit, whatever else runs.
#[test]
fn all_are_repeatable() {
    let draw = || tiles(&cubic, &rim, &mut Seed(9).stream("again"));
    let (tiles, views) = (draw(), exam(&cubic, &rim));
    for baseline in all() {
        let gain = |t: &Tiles| {
            let fitted = baseline.fit(t).unwrap();
            (gain_of(&views, fitted.predictor.as_ref()).unwrap(), fitted.parameters, fitted.names)
        };
        assert_eq!(gain(&tiles), gain(&draw()), "{}", baseline.name());
    }
}

/// Noise without a flaw: what is gained is little, and nothing is far below zero.
#[test]
fn nobody_is_far_off_on_clean_noise() {
    let clean = tiles(&no_bias, &no_spread, &mut Seed(4).stream("clean"));
    let views: Vec<ExamView> = exam(&no_bias, &no_spread).into_iter().take(4).collect();
    for baseline in all() {
        let fitted = baseline.fit(&clean).unwrap();
        let gain = gain_of(&views, fitted.predictor.as_ref()).unwrap().within;
        // 280,000 measurements: a parameter costs half a nat of them.
        assert!(gain <= 0.0 && gain > -20.0, "{}: {gain}", baseline.name());
    }
    let mut rng = Seed(1).stream("few");
    let few: Vec<Tile> =
        clean.tiles.iter().filter(|_| rng.random::<f64>() < 0.004).copied().collect();
    let few = Tiles::join(&sensor(), vec![few]).unwrap();
    for baseline in all() {
        let fitted = baseline.fit(&few).unwrap();
        assert!(gain_of(&views, fitted.predictor.as_ref()).is_ok(), "{}", baseline.name());
    }
}

/// A recording of the ray generator, from the disk.
mod disk {
    use std::collections::BTreeMap;
    use std::path::Path;

    use super::*;
    use crate::model::NoiseModel;
    use crate::prove::examine::Examination;
    use crate::prove::gain::examine_and_name;
    use crate::prove::rays::{Cell, Order, Set, Still, write};

    fn order(effect: &str, strength: f64, seed: u64) -> Order {
        let (cell, effects) = (Cell::Single, vec![effect.into()]);
        Order { cell, effects, strength, seed, views: Some(8), frames: Some(4), small: true }
    }

    fn exam(order: &Order) -> Vec<ExamView> {
        let full = Set::draw(order.clone()).unwrap();
        let mut bare = Set::draw(order.clone()).unwrap();
        bare.causes.truncate(bare.known_causes);
        let camera = full.unit.sensor.camera.clone();
        let fb = full.unit.disparity_px_m() as f32;
        let view = |k: usize| {
            let (with, without) = (Still::new(&full, k), Still::new(&bare, k));
            let plan = &full.plans[k];
            let on = |i: usize| {
                let (x, y) = camera.ray((i % camera.width) as f64, (i / camera.width) as f64);
                let point = nalgebra::Vector3::new(x, y, 1.0) * plan.stage.board.depth(x, y);
                point.z > 0.0 && plan.stage.board.holds(plan.stage.board.place(&point))
            };
            let depth = |s: &Still<'_>| -> Vec<f32> {
                let of = |(i, d): (usize, &f32)| if on(i) { fb / d } else { f32::NAN };
                s.disparity.iter().enumerate().map(of).collect()
            };
            ExamView {
                sensor: full.unit.sensor.clone(),
                beyond: false,
                theta: plan.stage.theta,
                azimuth: plan.stage.azimuth,
                conditions: Conditions { session_s: plan.session_s, ..Conditions::default() },
                depth: depth(&with),
                plain: depth(&without),
                sigma: with.sigma.clone(),
                sigma_plain: without.sigma.clone(),
            }
        };
        (0..full.plans.len()).map(view).collect()
    }

    fn examined(order: Order, folder: &Path) -> Examination {
        let set = Set::draw(order.clone()).unwrap();
        write(&set, folder).unwrap();
        std::fs::rename(folder.join(&set.name), folder.join("recording")).unwrap();
        let model = folder.join("model.json");
        std::fs::rename(folder.join("model").join(format!("{}.json", set.name)), &model).unwrap();
        let found = NoiseModel::read(&model).unwrap();
        examine_and_name(&exam(&order), folder, &found, true).unwrap()
    }

    #[test]
    fn a_bowl_on_the_disk_is_learnt_by_all() {
        let folder = tempfile::tempdir().unwrap();
        let examined = examined(order("radial-disparity-bias", 1.0, 3), folder.path());
        let gains = examined.gains.unwrap();
        let oracle = gains.oracle.within;
        let ratios: BTreeMap<&str, f64> =
            gains.methods.iter().map(|(name, m)| (name.as_str(), m.gain.within / oracle)).collect();
        assert!(ratios["none"] == 0.0 && ratios["kinoise"].abs() < 0.2);
        assert!(ratios["polynomial"] > 0.8 && ratios["sparse-regression"] > 0.8);
        assert!(ratios["gaussian-process"] > 0.8 && ratios["clams-grid"] > 0.5);
        assert!(examined.names["sparse-regression"].contains(&"radial-disparity-bias".into()));
    }
}
