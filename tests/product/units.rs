//! `kinoise units`: fleets drawn with a known common sigma and scatter, units that changed and units that did
//! not, and files that cannot be compared.

use std::path::{Path, PathBuf};

use kinoise::fleet::{Comparison, UnitModel, compare};
use kinoise::measure::{SigmaRow, SigmaTable};
use kinoise::model::{Covariance, Effect, FitSummary, PAPER_EQ1, Provenance, sort_out};
use kinoise::simulate::kinect_v1;
use kinoise::stats::{at_least, at_most};
use kinoise::terms::{Basis, Modulation, Term};
use kinoise::view::RecordingFile;
use kinoise::{Form, NoiseModel, Seed, SigmaModel};
use rand_distr::{Distribution, StandardNormal};
use serde_json::{Value, json};

use crate::common;

fn truth(z: f64, theta: f64) -> f64 {
    Form::Paper.spec().sigma(&PAPER_EQ1, z, theta)
}

/// Relative scatter between views, and effective number of pixels in each.
const BETWEEN_VIEWS: f64 = 0.03;
const N_EFFECTIVE: f64 = 500.0;

/// Sigma calibrated on 24 views of a unit whose noise is `times` Eq. 1.
fn calibrated(times: f64, seed: u64) -> SigmaModel {
    let mut rng = Seed(seed).stream("units");
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let mut rows = Vec::new();
    for i in 0..8 {
        for tilt in [0.05, 0.5, 0.9] {
            let z_m = 0.8 * (4.0f64 / 0.8).powf(f64::from(i) / 7.0);
            let off = BETWEEN_VIEWS * normal() + (0.5 / N_EFFECTIVE).sqrt() * normal();
            rows.push(SigmaRow {
                z_m,
                theta_rad: tilt,
                sigma_m: times * truth(z_m, tilt) * off.exp(),
                n_effective: Some(N_EFFECTIVE),
                view: rows.len(),
            });
        }
    }
    sort_out(&SigmaTable { rows }).fit(Form::Paper).expect("fitted").model()
}

fn unit(serial: &str, date: &str, sigma: SigmaModel) -> UnitModel {
    let mut sensor = RecordingFile::of(&kinect_v1(1));
    sensor.serial = Some(serial.into());
    let created = format!("{date}T00:00:00Z");
    let model = NoiseModel {
        sensor: Some(sensor),
        sigma,
        effects: Vec::new(),
        uncertainty: None,
        fit: FitSummary { views: 24, samples: 24, ..FitSummary::default() },
        provenance: Provenance { created, ..Provenance::default() },
    };
    UnitModel { path: PathBuf::from(format!("{serial}-{date}/model.json")), model }
}

fn normal(seed: u64, name: &str) -> impl FnMut() -> f64 {
    let mut rng = Seed(seed).stream(name);
    move || StandardNormal.sample(&mut rng)
}

/// Compares six units with this relative scatter.
fn fleet(scatter: f64, seed: u64) -> Comparison {
    let mut own = normal(seed, "own");
    let units: Vec<UnitModel> = (0..6)
        .map(|k| {
            let sigma = calibrated((scatter * own()).exp(), 100 * seed + k);
            unit(&format!("unit-{k}"), "2026-01-01", sigma)
        })
        .collect();
    compare(&units).expect("compared")
}

/// Over 300 fleets the intervals of common value and scatter cover the truth in 95 % at every place; false
/// alarm 1 in 1,000 at each of the binomial bounds.
#[test]
fn common_sigma_and_scatter_are_covered() {
    const FLEETS: u64 = 300;
    const SCATTER: f64 = 0.08;
    let mut held = Vec::new();
    for seed in 0..FLEETS {
        let sigma = fleet(SCATTER, seed).sigma.expect("compared");
        held.resize(sigma.places.len(), [0usize; 2]);
        let inside = |[low, high]: [f64; 2], truth| low <= truth && truth <= high;
        for (held, place) in held.iter_mut().zip(&sigma.places) {
            let expected = truth(place.z_m, place.theta_rad);
            held[0] += usize::from(inside(place.common_interval_m, expected));
            held[1] += usize::from(inside(place.scatter_interval, SCATTER));
        }
    }
    assert_eq!(held.len(), 6, "four distances, two tilts");
    let n = FLEETS as usize;
    for (place, k) in held.iter().enumerate().flat_map(|(p, held)| held.map(|k| (p, k))) {
        assert!(at_most(k, n, 0.95) > 1e-3, "place {place}: {k} of {n}, too narrow");
        assert!(at_least(k, n, 0.95) > 1e-3, "place {place}: {k} of {n}, too wide");
    }
}

/// Identical units: at most one fleet in a hundred is a false alarm, as the tests claim.
#[test]
fn units_of_one_kind_share_a_sigma() {
    const FLEETS: u64 = 300;
    let odd = |seed: &u64| {
        let sigma = fleet(0.0, *seed).sigma.expect("compared");
        sigma.standings.iter().any(|s| s.is_own)
    };
    let k = (0..FLEETS).filter(odd).count();
    assert!(at_least(k, FLEETS as usize, 0.01) > 1e-3, "{k} false alarms in {FLEETS} fleets");
}

/// One of five units is a quarter noisier: it is set apart in every fleet, its interval covers its departure,
/// and further units are set apart no more often than the tests claim.
#[test]
fn the_odd_unit_is_told_apart_from_the_others() {
    const FLEETS: usize = 60;
    let [mut covered, mut others] = [0; 2];
    for seed in 0..FLEETS as u64 {
        let times = |k: u64| if k == 2 { 1.25 } else { 1.0 };
        let one =
            |k| unit(&format!("{k}"), "2026-01-01", calibrated(times(k), 1000 + 10 * seed + k));
        let sigma = compare(&(0..5).map(one).collect::<Vec<_>>()).expect("compared").sigma;
        let sigma = sigma.expect("compared");
        let own: Vec<usize> = (0..5).filter(|k| sigma.standings[*k].is_own).collect();
        assert!(own.contains(&2), "seed {seed}: {:?}", sigma.standings);
        others += usize::from(own.len() > 1);
        let [low, high] = sigma.places[1].units[2].departure_interval;
        covered += usize::from(low <= 0.25 && 0.25 <= high);
    }
    assert!(at_most(covered, FLEETS, 0.95) > 1e-3, "{covered} of {FLEETS}");
    assert!(at_least(others, FLEETS, 0.01) > 1e-3, "{others} of {FLEETS}");
}

fn then_and_now(times: f64, seed: u64) -> Comparison {
    let fitted = |(times, k)| calibrated(times, 50_000 + 2 * seed + k);
    let [then, now] = [(1.0, 0), (times, 1)].map(fitted);
    // Given in the wrong order: the dates decide.
    compare(&[unit("a", "2026-06-01", now), unit("a", "2026-01-01", then)]).expect("compared")
}

/// Comparing an unchanged unit with itself gives a false alarm in 1 of 100 pairs.
#[test]
fn an_unchanged_unit_has_not_changed() {
    const PAIRS: u64 = 600;
    let mut alarms = 0;
    let mut covered = 0;
    for seed in 0..PAIRS {
        let comparison = then_and_now(1.0, seed);
        assert!(comparison.sigma.is_none() && comparison.units.len() == 1);
        let sigma = &comparison.changes[0].sigma;
        alarms += usize::from(sigma.changed);
        covered += sigma
            .places
            .iter()
            .filter(|p| p.interval_m[0] <= 0.0 && 0.0 <= p.interval_m[1])
            .count();
    }
    let n = PAIRS as usize;
    assert!(at_least(alarms, n, 0.01) > 1e-3, "{alarms} false alarms in {n}");
    // The six places of a pair are correlated: count one per pair.
    assert!(at_most(covered / 6, n, 0.95) > 1e-3, "{covered} of {}", 6 * n);
}

/// Only models of one unit need an order in time.
#[test]
fn a_date_is_missed_where_two_models_are_of_one_unit() {
    let told = |units: [(&str, &str); 3]| {
        let model = |((serial, date), seed)| unit(serial, date, calibrated(1.0, seed));
        let models: Vec<UnitModel> = units.into_iter().zip(1..).map(model).collect();
        let remarks = compare(&models).expect("compared").remarks;
        remarks.iter().any(|r| r.contains("do not tell two dates apart"))
    };
    assert!(!told([("a", "unknown"), ("b", "unknown"), ("c", "unknown")]));
    assert!(told([("a", "unknown"), ("a", "2026-01-01"), ("b", "2026-01-01")]));
}

/// 20 % more noise is found in every pair, with its size, whatever the order of the files.
#[test]
fn a_changed_unit_is_found() {
    for seed in 0..50 {
        let comparison = then_and_now(1.2, seed);
        let change = &comparison.changes[0];
        assert!(change.from_created < change.to_created);
        assert!(change.sigma.changed, "seed {seed}: p {}", change.sigma.p_adjusted);
        let ratio = |p: &kinoise::fleet::SigmaThenAndNow| p.to_m / p.from_m;
        let near = &change.sigma.places[1];
        assert!((ratio(near) - 1.2).abs() < 0.15, "seed {seed}: {}", ratio(near));
    }
}

/// A bowl and a map over the image, scattered about the truth by this standard error.
fn bias(bowl: f64, std_error: f64, seed: u64) -> Effect {
    let mut normal = normal(seed, "bias");
    let bases = [
        Basis::powers(kinoise::terms::Coordinate::RadiusSquared, 2, Modulation::One),
        Basis::Map { width: 640.0, height: 480.0, across: 5, down: 4, times: Modulation::One },
    ];
    let count: usize = bases.iter().map(Basis::count).sum();
    // Two factors shared by all coefficients, and an independent error of each coefficient.
    let shared: Vec<Vec<f64>> =
        (0..2).map(|_| (0..count).map(|_| 0.5 * std_error * normal()).collect()).collect();
    let by = [normal(), normal()];
    let mut all = (0..count).map(|j| {
        let sum: f64 = shared.iter().zip(by).map(|(part, by)| part[j] * by).sum();
        sum + std_error * normal()
    });
    let mut term = |basis: Basis, first: f64| {
        let mut coefficients: Vec<f64> = all.by_ref().take(basis.count()).collect();
        coefficients[0] += first;
        Term::bias(basis, coefficients)
    };
    let [a, b] = bases;
    Effect {
        id: "radial-disparity-bias".into(),
        shape: vec![term(a, bowl), term(b, 0.0)],
        learnt_px: Some([12.0, 60.0]),
        covariance: Some(Covariance {
            fit: 1,
            factors: shared,
            variances: vec![std_error.powi(2); count],
        }),
        ..Effect::default()
    }
}

fn with_bias(serial: &str, date: &str, effect: Effect, seed: u64) -> UnitModel {
    let mut unit = unit(serial, date, calibrated(1.0, seed));
    unit.model.effects = vec![effect];
    unit
}

/// The bias at two dates: false alarms at the nominal rate, and a change found with its size in metres.
#[test]
fn a_bias_that_changed_is_found_and_one_that_did_not_is_not() {
    const STD_ERROR: f64 = 0.02;
    let pair = |bowl: f64, seed: u64| {
        let then = with_bias("a", "2026-01-01", bias(0.1, STD_ERROR, 2 * seed), 9);
        let now = with_bias("a", "2026-06-01", bias(bowl, STD_ERROR, 2 * seed + 1), 10);
        compare(&[then, now]).expect("compared").changes[0].bias.clone().expect("compared")
    };
    const PAIRS: u64 = 300;
    let k = (0..PAIRS).filter(|s| pair(0.1, *s).changed).count();
    // Two tests share the level.
    assert!(at_least(k, PAIRS as usize, 0.01) > 1e-3, "{k} false alarms in {PAIRS}");
    const CHANGED: u64 = 20;
    let mut ratios = 0.0;
    for seed in 0..CHANGED {
        let found = pair(0.5, seed);
        assert!(found.changed, "seed {seed}: p {}", found.p_adjusted);
        // One pixel of disparity is z^2 / (fx baseline) of depth.
        let far = found.distances.last().expect("distances");
        let expected = 0.4 * RADIUS_SQUARED_RMS * far.z_m.powi(2) / (580.0 * 0.075);
        // At worst the whole error lies along the bowl: four standard deviations of it.
        let off = (far.change_rms_m - expected).abs();
        assert!(off < 4.0 * far.error_rms_m, "seed {seed}: {far:?} {expected}");
        ratios += far.change_rms_m / expected;
    }
    // The error is a quarter of the change: 5 % of the mean, and two of these.
    let mean = ratios / CHANGED as f64;
    assert!((mean - 1.0).abs() < 0.1, "{mean}");
}

/// Standard deviation of r^2 over a 4:3 image with r = 1 in the corner: u^2 and v^2, with u and v uniform
/// up to 0.8 and 0.6, have variances of 4/45 of the fourth powers; the root of 4/45 (0.8^4 + 0.6^4).
const RADIUS_SQUARED_RMS: f64 = 0.2188;

/// The bias that the fleet shares, and that of a single unit.
#[test]
fn a_bias_of_ones_own_is_told_from_the_common_one() {
    let bowls = [0.1, 0.1, 0.5, 0.1];
    let units: Vec<UnitModel> = (0..4u64)
        .map(|k| with_bias(&format!("{k}"), "2026-01-01", bias(bowls[k as usize], 0.02, 70 + k), k))
        .collect();
    let shared = compare(&units).expect("compared").bias.expect("compared");
    let own: Vec<bool> = shared.standings.iter().map(|s| s.is_own).collect();
    assert_eq!(own, [false, false, true, false]);
    let far = shared.distances.last().expect("distances");
    assert!(far.units[2].departure_rms_m > 3.0 * far.units[0].departure_rms_m, "{far:?}");
}

/// A constant of the disparity is another plane: what the projection leaves of it is rounding, which has
/// neither a size nor an error to compare.
#[test]
fn a_constant_that_no_plane_shows_is_not_compared() {
    let constant = |px: f64| Effect {
        shape: vec![Term::bias(Basis::Level, vec![px])],
        covariance: Some(Covariance { fit: 1, factors: Vec::new(), variances: vec![4e-4] }),
        ..bias(0.0, 0.02, 1)
    };
    let then = with_bias("a", "2026-01-01", constant(0.1), 9);
    let now = with_bias("a", "2026-06-01", constant(0.5), 10);
    assert_eq!(compare(&[then, now]).expect("compared").changes[0].bias, None);
}

/// Writes a model with one change.
fn write(folder: &Path, name: &str, unit: &UnitModel, change: impl Fn(&mut Value)) -> PathBuf {
    let mut value: Value =
        serde_json::from_str(&unit.model.to_json().expect("a model")).expect("JSON");
    change(&mut value);
    let path = folder.join(name).join("model.json");
    std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
    std::fs::write(&path, value.to_string()).expect("written");
    path
}

fn units(models: &[&Path]) -> (Option<i32>, String, String) {
    let run = common::kinoise().arg("units").args(models).arg("--json").output().expect("runs");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (run.status.code(), text(&run.stdout), text(&run.stderr))
}

/// A change to a valid file.
type Fault<'a> = &'a dyn Fn(&mut Value);

#[test]
fn what_cannot_be_compared_is_refused_in_one_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let [a, b] = ["a", "b"].map(|serial| unit(serial, "2026-01-01", calibrated(1.0, 3)));
    let good = write(folder, "a", &a, |_| ());
    let (code, out, _) = units(&[&good, &write(folder, "good", &b, |_| ())]);
    let out: Value = serde_json::from_str(&out).expect("JSON");
    assert_eq!((code, &out["format"]), (Some(0), &json!("kinoise-units/1")));

    let zeros = json!(vec![vec![0.0; 6]; 6]);
    let faults: [(&str, Fault<'_>, &str); 10] = [
        ("sensor", &|m| m["sensor"]["sensor"] = json!("Xtion"), "its sensor is \"Xtion\", not"),
        ("size", &|m| m["sensor"]["width"] = json!(320), "320 x 480 px, not 640 x 480"),
        ("mode", &|m| m["sensor"]["mode"] = json!("near"), "mode \"near\""),
        ("table", &|m| m["sensor"] = Value::Null, "bare table"),
        ("exact", &|m| m["sigma"]["covariance"] = zeros.clone(), "no covariance"),
        (
            "none",
            &|m| {
                m["sigma"].as_object_mut().expect("one").remove("covariance");
            },
            "covariance",
        ),
        ("nan", &|m| m["sigma"]["parameters"]["b"]["value"] = json!("NaN"), "parameter b"),
        ("few", &|m| m["fit"]["degrees_of_freedom"] = json!(1.0), "too few"),
        ("far", &|m| m["sigma"]["valid"]["z_m"] = json!([5.0, 6.0]), "nothing in common"),
        ("newer", &|m| m["format"] = json!("kinoise-model/2"), "newer"),
    ];
    for (name, fault, says) in faults {
        let bad = write(folder, name, &b, fault);
        let (code, out, told) = units(&[&good, &bad]);
        assert_eq!((code, out.as_str()), (Some(2), ""), "{name}: {told}");
        assert!(told.contains(says) && told.lines().count() == 1, "{name}: {told}");
        assert!(told.contains(&format!("{name}/model.json")), "{name}: {told}");
    }
    let frames = |m: &mut Value| m["provenance"]["sha256"]["frames"] = json!("f00");
    let [one, two] = [("one", &a), ("two", &b)].map(|(name, u)| write(folder, name, u, frames));
    for (models, says) in [
        (vec![], "no model was given"),
        (vec![good.as_path()], "one model has nothing to be compared with"),
        (vec![good.as_path(), folder], "check that the path is right"),
        (vec![one.as_path(), two.as_path()], "same frames"),
    ] {
        let (code, out, told) = units(&models);
        assert_eq!((code, out.as_str()), (Some(2), ""), "{told}");
        assert!(told.contains(says) && told.lines().count() == 1, "{told}");
    }
}

/// A model from before covariances: its sigma is compared, its bias is not, and this is reported.
#[test]
fn an_older_file_is_compared_as_far_as_it_goes() {
    let folder = tempfile::tempdir().expect("a folder");
    let models: Vec<PathBuf> = ["a", "b", "c"]
        .iter()
        .zip(0..)
        .map(|(serial, k)| {
            let unit = with_bias(serial, "2026-01-01", bias(0.1, 0.02, k), 20 + k);
            write(folder.path(), serial, &unit, |m| {
                if *serial == "c" {
                    m["effects"][0].as_object_mut().expect("one").remove("covariance");
                }
            })
        })
        .collect();
    // A folder stands for the model in it.
    let given: Vec<&Path> = models.iter().map(|m| m.parent().expect("a folder")).collect();
    let (code, out, told) = units(&given);
    assert_eq!(code, Some(0), "{told}");
    let out: Value = serde_json::from_str(&out).expect("JSON");
    assert_eq!(out["sigma"]["standings"].as_array().map(Vec::len), Some(3));
    assert_eq!(out["bias"]["standings"].as_array().map(Vec::len), Some(2));
    assert!(told.contains("note: c: its model does not say how sure"), "{told}");
}
