//! Shapes in and biases out: the simulator against closed forms, the correction against noise.

use std::fs;
use std::path::{Path, PathBuf};

use kinoise::correct::{
    Conditions, CorrectOptions, Correction, SIGMA_UNITS_PER_METRE, correct_recording,
};
use kinoise::effects::Active;
use kinoise::io::{Assumed, FrameSource, open_uncut};
use kinoise::model::{Covariance, Domain, Effect, FitSummary, Provenance, UNEXPLAINED};
use kinoise::scene::{Bench, Seen, Target};
use kinoise::simulate::{FormulaSensor, Physics, Scenery, Shoot, kinect_v1, plan_grid};
use kinoise::terms::{Basis, Coordinate, Modulation, Statistic, Term};
use kinoise::view::RecordingFile;
use kinoise::{DepthCode, Form, Frame, NoiseModel, Plane, Seed, Sensor, SigmaModel};
use serde_json::{Value, json};

use crate::common;
use crate::common::{copy_tree, good, kinoise, tree, truth};

/// Pixels of half the size each way, words of 0.07 mm.
fn sensor() -> Sensor {
    let code = DepthCode::Metric { units_per_metre: 15_000.0, invalid: 0 };
    Sensor { code, ..kinect_v1(2) }
}

/// fx * baseline of it, px m.
const FB: f64 = 290.0 * 0.075;

fn model(sensor: &Sensor, effects: Vec<Effect>) -> NoiseModel {
    NoiseModel {
        sensor: Some(RecordingFile::of(sensor)),
        sigma: truth(),
        effects,
        uncertainty: None,
        fit: FitSummary::default(),
        provenance: Provenance::default(),
    }
}

fn named(id: &str, parameters: Value) -> Effect {
    let parameters = parameters.as_object().expect("an object").clone();
    Effect { id: id.into(), parameters, ..Effect::default() }
}

fn shaped(id: &str, shape: Vec<Term>) -> Effect {
    Effect { id: id.into(), shape, ..Effect::default() }
}

fn term(statistic: Statistic, basis: Basis, coefficients: &[f64]) -> Term {
    Term { statistic, basis, coefficients: coefficients.to_vec() }
}

fn bias(basis: Basis, coefficients: &[f64]) -> Term {
    term(Statistic::Bias, basis, coefficients)
}

/// Frames of a wall through a sensor without noise, or with it.
fn shots(plane: Plane, effects: &[Effect], sigma_m: f64, sessions: &[f64]) -> Vec<Frame> {
    shots_of(&Bench::bare(plane, Target::Wall), effects, sigma_m, sessions)
}

fn shots_of(bench: &Bench, effects: &[Effect], sigma_m: f64, sessions: &[f64]) -> Vec<Frame> {
    let sensor = sensor();
    let rays = sensor.camera.rays();
    let seen = Seen::of(bench, &sensor.camera, &rays);
    let domain = Domain { z_m: [0.1, 20.0], theta_rad: [0.0, 1.45] };
    let sigma = SigmaModel::published(Form::Paper, &[sigma_m, 0.0, 0.0, 0.0, 1.0, 1.5], domain);
    let effects = Active::all_of_model(effects).expect("effects");
    let camera = FormulaSensor {
        sensor: &sensor,
        rays: &rays,
        sigma: &sigma,
        effects: &effects,
        seed: Seed(3),
    };
    let mut shooting = camera.begin(&seen);
    let instant = |(frame, &session_s): (usize, &f64)| kinoise::effects::Instant {
        view: 0,
        frame,
        session_s,
        view_s: frame as f64 / 30.0,
    };
    sessions.iter().enumerate().map(|f| shooting.shoot(instant(f)).depth).collect()
}

const SILENT_M: f64 = 1e-9;

fn depths(frame: &Frame) -> Vec<f32> {
    let table = sensor().code.table();
    frame.raw.iter().map(|&w| table.metres(w)).collect()
}

/// Disparity minus the plane's, px, of every pixel.
fn residuals(depth: &[f32], plane: &Plane) -> Vec<f64> {
    let rays = sensor().camera.rays();
    let of = |(i, &z): (usize, &f32)| {
        let (x, y) = rays.at(i);
        FB * (1.0 / f64::from(z) - plane.inverse_depth(x, y))
    };
    depth.iter().enumerate().map(of).collect()
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

/// Half a word's step at a depth, px, and single precision.
fn rounding_px(z: f64) -> f64 {
    0.6 / 15_000.0 * FB / (z * z) + 1e-4
}

/// (u, v) of chosen pixels.
const CHOSEN: [(usize, usize); 5] = [(0, 0), (160, 120), (319, 239), (40, 200), (250, 17)];

#[test]
fn a_shape_is_its_closed_form_at_chosen_pixels() {
    let plane = Plane::tilted(1.2, 0.6, 0.4);
    let camera = sensor().camera;
    let shape = vec![
        bias(Basis::powers(Coordinate::RadiusSquared, 2, Modulation::power(2.0)), &[0.8, -0.3]),
        // In fifths of a px.
        bias(Basis::waves(Coordinate::Column, 40.0, 1), &[1.0, -0.5]),
        bias(
            Basis::powers(
                Coordinate::RaySquared,
                1,
                Modulation::RadialSlope { fx: camera.fx, fy: camera.fy },
            ),
            &[-0.05],
        ),
        bias(
            Basis::Curve {
                over: Coordinate::LogZ,
                low: 0.0,
                high: 1.0,
                nodes: 3,
                times: Modulation::Tilt,
            },
            &[0.1, 0.5, 0.3],
        ),
    ];
    let shot = &shots(plane, &[shaped(UNEXPLAINED, shape)], SILENT_M, &[0.0])[0];
    let found = residuals(&depths(shot), &plane);
    for (u, v) in CHOSEN {
        let (x, y) = ((u as f64 - camera.cx) / camera.fx, (v as f64 - camera.cy) / camera.fy);
        let z = plane.depth(x, y);
        let d = FB / z;
        let r2 = ((u as f64 - 159.5).powi(2) + (v as f64 - 119.5).powi(2))
            / (159.5f64.powi(2) + 119.5f64.powi(2));
        let bowl = (d / 40.0).powi(2) * (0.8 * r2 - 0.3 * r2 * r2);
        let phase = std::f64::consts::TAU * u as f64 / 40.0;
        let banding = 0.2 * phase.sin() - 0.1 * phase.cos();
        // k1 of a lens moves a ray by k1 r^2 along the radius: disparity by the plane's gradient.
        let gradient = FB * (plane.q.x * x + plane.q.y * y);
        let lens = -gradient * (x * x + y * y) * -0.05;
        let knot = z.ln().clamp(0.0, 1.0) * 2.0;
        let line = if knot < 1.0 { 0.1 + 0.4 * knot } else { 0.5 - 0.2 * (knot - 1.0) };
        let expected = bowl + banding + lens + line * 0.6f64.sin();
        let off = found[v * 320 + u] - expected;
        assert!(off.abs() < rounding_px(z), "{u} {v}: {off} of {expected}");
    }
}

/// A bow and a mixed edge belong to the board: the wall behind it has neither.
#[test]
fn a_boards_shape_stays_on_the_board() {
    let plane = Plane::tilted(1.0, 0.0, 0.0);
    let mut bench = Bench::bare(plane, common::BOARD);
    bench.wall_m = Some(2.0);
    let shape = vec![
        bias(Basis::relief(2), &[0.05, 0.0, 0.0]),
        bias(Basis::Decay { over: Coordinate::Edge, width: 3.0 }, &[-0.5]),
    ];
    let shot = &shots_of(&bench, &[shaped("target-bow", shape)], SILENT_M, &[0.0])[0];
    let depth = depths(shot);
    let found = residuals(&depth, &plane);
    let camera = sensor().camera;
    // The board reaches from column 14.5 to 304.5 and from row 3.5 to 235.5.
    for (u, v) in [(160, 120), (60, 60), (20, 120), (304, 120), (100, 235)] {
        let right = (u as f64 - camera.cx) / camera.fx;
        let edge = (u - 14).min(305 - u).min(v - 3).min(236 - v) as f64;
        let expected = 0.05 * FB * right * right - 0.5 * (-edge / 3.0).exp();
        let off = found[v * 320 + u] - expected;
        assert!(off.abs() < rounding_px(1.0), "{u} {v}: {off} of {expected}");
    }
    assert!((depth[120 * 320 + 5] - 2.0).abs() < 1e-4, "the wall");
}

#[test]
fn a_shape_over_the_session_moves_with_it_and_the_rest_stands() {
    let plane = Plane::tilted(1.0, 0.0, 0.0);
    let curve =
        |over, high| Basis::Curve { over, low: 0.0, high, nodes: 2, times: Modulation::One };
    let shape = vec![
        bias(curve(Coordinate::Session, 100.0), &[0.0, 1.0]),
        bias(curve(Coordinate::Column, 319.0), &[0.0, 0.5]),
    ];
    let sessions = [0.0, 25.0, 100.0, 400.0];
    let frames = shots(plane, &[shaped("thermal-drift", shape)], SILENT_M, &sessions);
    for (frame, expected) in frames.iter().zip([0.0, 0.25, 1.0, 1.0]) {
        let found = residuals(&depths(frame), &plane);
        for u in [0, 100, 319] {
            let off = found[120 * 320 + u] - expected - 0.5 * u as f64 / 319.0;
            assert!(off.abs() < rounding_px(1.0), "{expected}: {off}");
        }
    }
}

/// Standard deviation times exp(value / 2), by depth read-out over many pixels.
#[test]
fn a_variance_shape_scales_the_noise() {
    let plane = Plane::tilted(1.0, 0.0, 0.0);
    let level = term(Statistic::Variance, Basis::Level, &[1.2]);
    let spread = |effects: &[Effect]| {
        rms(&residuals(&depths(&shots(plane, effects, 0.003, &[0.0])[0]), &plane))
    };
    let ratio = spread(&[shaped("vignetting", vec![level])]) / spread(&[]);
    assert!((ratio / 0.6f64.exp() - 1.0).abs() < 0.01, "{ratio}");
}

/// The same effect by formula and by hand-written shape: the same picture.
#[test]
fn a_bowl_by_shape_is_the_bowl_by_formula() {
    let plane = Plane::tilted(1.5, 0.5, 1.0);
    let bowl = bias(Basis::powers(Coordinate::RadiusSquared, 1, Modulation::power(0.0)), &[0.7]);
    let by_shape = shots(plane, &[shaped("radial-disparity-bias", vec![bowl])], 0.002, &[0.0]);
    let by_formula =
        shots(plane, &[named("radial-disparity-bias", json!({"k_px": 0.7}))], 0.002, &[0.0]);
    let apart = by_shape[0].raw.iter().zip(&by_formula[0].raw).map(|(a, b)| a.abs_diff(*b));
    assert!(apart.max().unwrap_or(0) <= 1);
}

/// Every formula that can be inverted, alone and then all together, with noise.
#[test]
fn what_a_formula_does_its_correction_undoes() {
    let entries = [
        named("depth-scale", json!({"scale": 1.04})),
        named("disparity-offset", json!({"offset_px": 0.4})),
        named("thermal-drift", json!({"relative": 0.02, "time_constant_s": 50.0})),
        named("range-not-depth", json!({"share": 1.0})),
        named("radial-disparity-bias", json!({"k_px": {"value": -0.8, "std_error": 0.1}})),
        named("lens-distortion", json!({"k1": -0.08})),
        named("pixel-locking", json!({"amplitude_px": 0.1})),
        named("column-banding", json!({"amplitude_px": 0.2, "period_px": 50.0})),
    ];
    let plane = Plane::tilted(1.1, 0.7, 0.3);
    let check = |effects: &[Effect], sigma_m: f64, limit_px: f64| {
        let frame = &shots(plane, effects, sigma_m, &[0.0, 70.0])[1];
        let correction =
            Correction::of(&model(&sensor(), effects.to_vec()), &sensor()).expect("one");
        let mut depth = depths(frame);
        let before = rms(&residuals(&depth, &plane));
        let conditions = Conditions { session_s: 70.0, ..Conditions::default() };
        correction.apply(&mut depth, &conditions).expect("applied");
        let after = rms(&residuals(&depth, &plane));
        let ids: Vec<&str> = effects.iter().map(|e| e.id.as_str()).collect();
        assert!(before > 0.03, "{ids:?} did nothing: {before}");
        assert!(after < limit_px, "{ids:?}: {before} -> {after} px, not below {limit_px}");
    };
    for entry in &entries {
        check(std::slice::from_ref(entry), SILENT_M, 0.008);
    }
    check(&entries, SILENT_M, 0.012);
    let noise = rms(&residuals(&depths(&shots(plane, &[], 0.004, &[0.0])[0]), &plane));
    // What scales the depth and what locks it change the noise a little with it.
    check(&entries, 0.004, 1.15 * noise);
}

/// Each view has its own, and tells it: half a read-out's step of 320 columns, beside as much noise.
#[test]
fn columns_that_step_differently_in_every_view_are_taken_out_of_each() {
    let parameters = json!({"amplitude_px": 0.03125, "period_px": 34.0, "spread": 2.5});
    let (plane, effects) = (Plane::tilted(0.8, 0.2, 0.3), [named("column-banding", parameters)]);
    let correction = Correction::of(&model(&sensor(), effects.to_vec()), &sensor()).expect("one");
    let noise = rms(&residuals(&depths(&shots(plane, &[], 0.001, &[0.0])[0]), &plane));
    for frame in shots(plane, &effects, 0.001, &[0.0, 1.0, 2.0]) {
        let mut depth = depths(&frame);
        let before = rms(&residuals(&depth, &plane));
        correction.apply(&mut depth, &Conditions::default()).expect("applied");
        let after = rms(&residuals(&depth, &plane));
        assert!(
            before > noise.hypot(0.015) && after < 1.03 * noise,
            "{noise}: {before} -> {after}"
        );
    }
    let [sharp, clean] = [&effects[..], &[]].map(|e| depths(&shots(plane, e, 0.001, &[0.0])[0]));
    let mut other = clean.clone();
    correction.apply(&mut other, &Conditions::default()).expect("applied");
    let moved =
        |a: &[f32], b: &[f32]| a.iter().zip(b).filter(|(a, b)| (*a - *b).abs() > 1e-6).count();
    assert_eq!(moved(&clean, &other), 0, "an image without steps stays");
    assert!(moved(&clean, &sharp) > 1000);
}

/// Each kind of sensor bias by hand; the surface it needs is found in the noisy picture.
#[test]
fn what_a_shape_does_its_correction_undoes() {
    let (camera, plane) = (sensor().camera, Plane::tilted(1.0, 0.8, -0.7));
    let curve =
        |over, [low, high]: [f64; 2], times| Basis::Curve { over, low, high, nodes: 3, times };
    let map =
        Basis::Map { width: 320.0, height: 240.0, across: 3, down: 2, times: Modulation::One };
    let pair = Basis::Pair {
        over: [Coordinate::Radius, Coordinate::Disparity],
        low: [0.0, 10.0],
        high: [1.0, 30.0],
        nodes: [2, 2],
    };
    let ring =
        Basis::Ring { over: Coordinate::Azimuth, period: 6.3, nodes: 4, times: Modulation::Tilt };
    let kinds = [
        bias(Basis::powers(Coordinate::RadiusSquared, 2, Modulation::power(1.0)), &[2.0, -0.6]),
        bias(
            Basis::powers(
                Coordinate::RaySquared,
                2,
                Modulation::RadialSlope { fx: camera.fx, fy: camera.fy },
            ),
            &[-0.1, 0.05],
        ),
        bias(Basis::powers(Coordinate::Foreshortening, 1, Modulation::Disparity), &[1.0]),
        bias(curve(Coordinate::Z, [0.5, 4.0], Modulation::DisparitySquared), &[1.0, 2.0, -1.0]),
        bias(curve(Coordinate::Theta, [0.0, 1.5], Modulation::One), &[0.0, 0.6, 0.9]),
        bias(curve(Coordinate::Session, [0.0, 100.0], Modulation::Lift), &[0.0, 0.01, 0.02]),
        bias(map, &[0.1, -0.4, 0.6, 0.3, 0.2, -0.5]),
        bias(pair, &[0.5, -0.3, 0.8, 0.4]),
        bias(ring, &[0.4, -0.4, 0.8, 0.2]),
        bias(Basis::waves(Coordinate::Disparity, 3.0, 2), &[0.1, 0.05, 0.0, 0.02]),
    ];
    let quiet = rms(&residuals(&depths(&shots(plane, &[], 0.001, &[0.0])[0]), &plane));
    for kind in kinds {
        let effects = [shaped(UNEXPLAINED, vec![kind.clone()])];
        let frame = &shots(plane, &effects, 0.001, &[60.0])[0];
        let correction =
            Correction::of(&model(&sensor(), effects.to_vec()), &sensor()).expect("one");
        let mut depth = depths(frame);
        let before = rms(&residuals(&depth, &plane));
        let conditions = Conditions { session_s: 60.0, ..Conditions::default() };
        correction.apply(&mut depth, &conditions).expect("applied");
        let after = rms(&residuals(&depth, &plane));
        assert!(before > 1.2 * quiet, "{kind:?} did nothing: {before}, noise {quiet}");
        // A ray length taken for a depth stretches the noise with it, by 9 % here.
        assert!(after < 1.10 * quiet, "{kind:?}: {before} -> {after}, noise {quiet}");
    }
}

/// A board's shape, an edge's mixing and any variance are not the sensor's bias.
#[test]
fn what_is_not_the_sensors_bias_stays_in_and_is_told() {
    let across = Basis::Pair {
        over: [Coordinate::Column, Coordinate::Right],
        low: [0.0, -1.0],
        high: [319.0, 1.0],
        nodes: [2, 2],
    };
    let effects = vec![
        shaped("target-bow", vec![bias(Basis::relief(2), &[0.01, 0.0, 0.0])]),
        shaped(
            "edge-mixing",
            vec![bias(Basis::Decay { over: Coordinate::Edge, width: 2.0 }, &[1.0])],
        ),
        shaped("vignetting", vec![term(Statistic::Variance, Basis::Level, &[1.0])]),
        shaped(UNEXPLAINED, vec![bias(across, &[1.0; 4])]),
        named("target-motion", json!({"velocity_mps": 0.01})),
        named("heavy-tails", json!({})),
    ];
    let correction = Correction::of(&model(&sensor(), effects), &sensor()).expect("a correction");
    assert!(correction.is_identity());
    let ids =
        ["target-bow", "edge-mixing", "vignetting", UNEXPLAINED, "target-motion", "heavy-tails"];
    assert_eq!(correction.ignored(), ids);
}

/// A curve over a temperature that nobody measured is not applied at its cold end.
#[test]
fn an_unknown_temperature_changes_nothing() {
    let curve = Basis::Curve {
        over: Coordinate::Temperature,
        low: 20.0,
        high: 40.0,
        nodes: 2,
        times: Modulation::One,
    };
    let effects = vec![shaped(UNEXPLAINED, vec![bias(curve, &[0.5, 1.0])])];
    let correction = Correction::of(&model(&sensor(), effects), &sensor()).expect("a correction");
    let at = |temperature_c| {
        let mut depth = vec![1.0f32; 320 * 240];
        let conditions = Conditions { temperature_c, ..Conditions::default() };
        correction.apply(&mut depth, &conditions).expect("applied");
        f64::from(depth[0])
    };
    assert_eq!(at(None), 1.0);
    assert!((at(Some(30.0)) - FB / (FB - 0.75)).abs() < 1e-6);
}

// ---- whole recordings ----------------------------------------------------------------------

struct Files {
    folder: tempfile::TempDir,
}

impl Files {
    fn new() -> Self {
        let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("a temporary folder");
        Files { folder }
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn model(&self, model: &NoiseModel) -> PathBuf {
        let path = self.at("model.json");
        model.write(&path).expect("written");
        path
    }

    /// A recording of 160 x 120 px with `code`.
    fn recording(&self, code: DepthCode, effects: Vec<Active>) -> PathBuf {
        let sensor = Sensor { code, ..kinect_v1(4) };
        let grid = common::grid(&[1.0, 1.6], &[0.0, 40.0]);
        let shoot = Shoot {
            views: plan_grid(&grid.views(), &Scenery::bare(Target::Wall), 2, true, Seed(2)),
            sensor,
            physics: Physics::Formula { sigma: truth(), effects },
            infrared: true,
            seed: Seed(2),
        };
        let path = self.at("rec");
        shoot.write(&path, &|_, _| ()).expect("written");
        path
    }

    fn correct(&self, recording: &Path, options: &[&str]) -> (Value, String) {
        let output = self.run(recording, &self.at("out"), options);
        let said = String::from_utf8(output.stderr).expect("text");
        assert!(output.status.success(), "{said}");
        (serde_json::from_slice(&output.stdout).expect("JSON"), said)
    }

    fn run(&self, recording: &Path, out: &Path, options: &[&str]) -> std::process::Output {
        let mut command = kinoise();
        command.arg("correct").arg(recording).arg("--model").arg(self.at("model.json"));
        command.arg("-o").arg(out).arg("--json").args(options).output().expect("runs")
    }

    #[track_caller]
    fn refused(&self, recording: &Path, out: &Path, needles: &[&str]) {
        let output = self.run(recording, out, &[]);
        let said = String::from_utf8(output.stderr).expect("text");
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert_eq!(said.lines().filter(|l| l.starts_with("kinoise: ")).count(), 1, "{said}");
        assert!(needles.iter().all(|n| said.contains(n)), "{needles:?} in {said}");
        assert!(said.contains("; ") && output.stdout.is_empty(), "{said}");
    }
}

const METRIC: DepthCode = DepthCode::Metric { units_per_metre: 5000.0, invalid: 0 };
const RAW: DepthCode =
    DepthCode::Disparity { offset: 3.3309495161, slope: -0.0030711016, invalid: 2047 };

fn small(effects: Vec<Effect>) -> NoiseModel {
    model(&kinect_v1(4), effects)
}

fn bowl(k_px: f64) -> Effect {
    let bowl = bias(Basis::powers(Coordinate::RadiusSquared, 1, Modulation::power(0.0)), &[k_px]);
    shaped("radial-disparity-bias", vec![bowl])
}

/// Root mean square about the best plane of each view's first frame in units of sigma, by
/// calibrating.
fn sigma_ratio(recording: &Path) -> f64 {
    let opened = kinoise::io::open(recording, &Assumed::default()).expect("opened");
    let measured =
        kinoise::measure_recording(&opened, &Default::default(), &|_, _| ()).expect("measured");
    let ratios: Vec<f64> = measured
        .views
        .iter()
        .map(|v| v.whole.spread.spatial_m / truth().sigma(v.z_m, v.theta_rad))
        .collect();
    assert_eq!(ratios.len(), 4);
    ratios.iter().sum::<f64>() / 4.0
}

#[test]
fn a_corrected_recording_is_back_at_noise_level() {
    let files = Files::new();
    let effect = Active::parse("radial-disparity-bias:k_px=0.1").expect("an effect");
    let recording = files.recording(METRIC, vec![effect]);
    files.model(&small(vec![bowl(0.1)]));
    let (json, _) = files.correct(&recording, &[]);
    assert_eq!((&json["frames"], &json["clamped"]), (&json!(8), &json!(0)));
    assert!(json["pixels_changed"].as_u64() > Some(100_000), "{json}");
    assert!((1.0..20.0).contains(&json["rms_shift_mm"].as_f64().expect("a number")), "{json}");
    let (before, after) = (sigma_ratio(&recording), sigma_ratio(&files.at("out")));
    assert!(before > 1.5 && (after - 1.0).abs() < 0.1, "{before} -> {after}");
    // Everything but depth is there, byte for byte.
    let (old, new) = (tree(&recording), tree(&files.at("out")));
    assert_eq!(old.len(), new.len());
    for ((name, a), (other, b)) in old.iter().zip(&new) {
        assert_eq!(name, other);
        assert!(a == b || name.to_string_lossy().contains("depth/"), "{}", name.display());
    }
}

#[test]
fn a_second_correction_is_told() {
    let files = Files::new();
    let recording =
        files.recording(METRIC, vec![Active::parse("radial-disparity-bias").expect("an effect")]);
    files.model(&small(vec![bowl(0.1)]));
    files.correct(&recording, &[]);
    let arguments = ["correct", "out", "-m", "model.json", "-o", "again"];
    let output = kinoise().current_dir(files.at("")).args(arguments).output().expect("it runs");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    assert!(said.contains("is corrected already"), "{said}");
}

/// References give a law its standard error, which is that of the depth: 1 % of it by the scale.
#[test]
fn a_law_has_its_own_uncertainty() {
    let files = Files::new();
    let recording = files.recording(METRIC, Vec::new());
    let error = |error: Value| {
        let scale = json!({"value": 1.02, "std_error": error});
        files.model(&small(vec![named("depth-scale", json!({"scale": scale}))]));
        let arguments = ["correct", "rec", "-m", "model.json", "-o", "out", "--sigma", "sigma"];
        kinoise().current_dir(files.at("")).args(arguments).output().expect("it runs")
    };
    let refused = error(Value::Null);
    assert_eq!(refused.status.code(), Some(2));
    let said = String::from_utf8_lossy(&refused.stderr);
    assert!(said.contains("none has a covariance"), "{said}");
    let output = error(json!(0.01));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let corrected = open_uncut(&files.at("out"), &Assumed::default()).expect("opened");
    let table = corrected.sensor.code.table();
    let mut source = FrameSource::new(160, 120);
    let image = &corrected.views[0].depth[0].path;
    let depth = source.read(image).expect("read");
    let relative = image.strip_prefix(files.at("out")).expect("inside");
    let sigma = source.read(&files.at("sigma").join(relative)).expect("read");
    assert!(recording.is_dir());
    for (&raw, &word) in depth.raw.iter().zip(&sigma.raw) {
        let z = f64::from(table.metres(raw));
        let expected = 0.01 * z * SIGMA_UNITS_PER_METRE;
        assert!(z.is_nan() || (f64::from(word) - expected).abs() < 2.0, "{z}: {word}");
    }
}

#[test]
fn a_model_without_bias_changes_no_byte() {
    let files = Files::new();
    files.model(&small(vec![named("vignetting", json!({"growth": 0.4}))]));
    for code in [METRIC, RAW] {
        let recording = files.recording(code, Vec::new());
        let (json, said) = files.correct(&recording, &[]);
        assert_eq!((&json["pixels_changed"], &json["rms_shift_mm"]), (&json!(0), &json!(0.0)));
        assert!(
            said.contains("left in, because they are noise or belong to the scene: vignetting"),
            "{said}"
        );
        assert!(tree(&recording) == tree(&files.at("out")));
        fs::remove_dir_all(&recording).expect("removed");
        fs::remove_dir_all(files.at("out")).expect("removed");
    }
}

#[test]
fn raw_disparities_become_fine_metric_words_unless_kept() {
    let files = Files::new();
    let offset = Active::parse("disparity-offset:offset_px=0.2").expect("an effect");
    let recording = files.recording(RAW, vec![offset]);
    let described = recording.join("recording.json");
    let text = fs::read_to_string(&described).expect("read");
    fs::write(&described, text.replacen('{', "{ \"owner\": \"lab 3\",", 1)).expect("written");
    files.model(&small(vec![named("disparity-offset", json!({"offset_px": 0.2}))]));
    let (json, _) = files.correct(&recording, &[]);
    assert_eq!(json["units_per_metre"], json!(10_000.0));
    let text = fs::read_to_string(files.at("out/recording.json")).expect("read");
    let value: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!((&value["owner"], &value["raw_disparity"]), (&json!("lab 3"), &Value::Null));
    // d = fb / z and 0.2 px less of it.
    let fb = 145.0 * 0.075;
    let views = |path: &Path| open_uncut(path, &Assumed::default()).expect("opened");
    let (old, new) = (views(&recording), views(&files.at("out")));
    let (old_table, new_table) = (old.sensor.code.table(), new.sensor.code.table());
    let mut source = FrameSource::new(160, 120);
    for (a, b) in old.views.iter().zip(&new.views) {
        let a = source.read(&a.depth[0].path).expect("read");
        let b = source.read(&b.depth[0].path).expect("read");
        for (&raw, &word) in a.raw.iter().zip(&b.raw) {
            let (z, better) = (old_table.metres(raw), new_table.metres(word));
            assert_eq!(z.is_nan(), better.is_nan(), "valid stays valid, and invalid invalid");
            let expected = fb / (fb / f64::from(z) - 0.2);
            assert!(z.is_nan() || (f64::from(better) - expected).abs() < 5.1e-5, "{z} {better}");
        }
    }
    fs::remove_dir_all(files.at("out")).expect("removed");
    let (json, _) = files.correct(&recording, &["--keep-code"]);
    assert_eq!(json["units_per_metre"], Value::Null);
    assert!(fs::read_to_string(files.at("out/recording.json")).expect("read").contains("raw_disp"));
}

#[test]
fn the_bytes_do_not_depend_on_the_number_of_threads() {
    let files = Files::new();
    let recording = files.recording(METRIC, Vec::new());
    let camera = kinect_v1(4).camera;
    let lens = bias(
        Basis::powers(
            Coordinate::RaySquared,
            1,
            Modulation::RadialSlope { fx: camera.fx, fy: camera.fy },
        ),
        &[-0.1],
    );
    files.model(&small(vec![bowl(0.5), shaped("lens-distortion", vec![lens])]));
    let (one, _) = files.correct(&recording, &["--threads", "1"]);
    fs::rename(files.at("out"), files.at("one")).expect("moved");
    let (two, _) = files.correct(&recording, &["--threads", "2"]);
    assert_eq!(one, two);
    assert!(tree(&files.at("one")) == tree(&files.at("out")));
}

#[test]
fn a_film_keeps_its_colour_and_every_frame() {
    let files = Files::new();
    let model_path = files.model(&small(vec![bowl(0.5)]));
    let film = files.at("film");
    let shot = kinoise()
        .args(["simulate", "--room", "--frames", "4", "--model"])
        .arg(&model_path)
        .arg(&film)
        .output()
        .expect("runs");
    assert!(shot.status.success(), "{}", String::from_utf8_lossy(&shot.stderr));
    let (json, said) = files.correct(&film, &[]);
    assert_eq!(json["frames"], json!(4), "{said}");
    let (old, new) = (tree(&film), tree(&files.at("out")));
    let changed: Vec<_> = old.iter().zip(&new).filter(|(a, b)| a != b).map(|(a, _)| &a.0).collect();
    assert_eq!(old.len(), new.len());
    assert_eq!(changed.len(), 4, "the depth images and nothing else: {changed:?}");
    // The shape that the film was shot with is out again: a film without it is the same but for rounding.
    files.model(&small(Vec::new()));
    let plain = files.at("plain");
    let shot = kinoise()
        .args(["simulate", "--room", "--frames", "4", "--model"])
        .arg(&model_path)
        .arg(&plain)
        .output()
        .expect("runs");
    assert!(shot.status.success());
    let mut source = FrameSource::new(160, 120);
    let mut off = 0;
    for name in &changed {
        let a = source.read(&plain.join(name)).expect("read");
        let b = source.read(&files.at("out").join(name)).expect("read");
        // A word of 0.2 mm each way, and as much again from the rounding of the shifted depth.
        off += a.raw.iter().zip(&b.raw).filter(|(a, b)| a.abs_diff(**b) > 3).count();
    }
    assert!(off < 200, "{off} pixels are elsewhere");
}

#[test]
fn a_dump_of_raw_words_goes_on_as_a_described_sequence() {
    let files = Files::new();
    let raw = files.recording(RAW, Vec::new());
    let dump = files.at("dump");
    fs::create_dir(&dump).expect("made");
    let recording = open_uncut(&raw, &Assumed::default()).expect("opened");
    let mut source = FrameSource::new(160, 120);
    let mut index = String::new();
    for (k, frame) in recording.views.iter().flat_map(|v| &v.depth).enumerate() {
        let name = format!("d-{}.{k}-{k}.pgm", 1000 + k);
        let image = source.read(&frame.path).expect("read");
        fs::write(dump.join(&name), kinoise::io::encode_pgm16(&image)).expect("written");
        index += &format!("{name}\nr-{}.{k}-{k}.ppm\n", 1000 + k);
        fs::write(dump.join(format!("r-{}.{k}-{k}.ppm", 1000 + k)), b"P6").expect("written");
    }
    fs::write(dump.join("INDEX.txt"), index).expect("written");
    files.model(&small(vec![bowl(0.5)]));
    let options = ["--intrinsics", "145,145,79.5,59.5"];
    let (json, _) = files.correct(&dump, &options);
    assert_eq!(json["frames"], json!(8));
    let again = open_uncut(&files.at("out"), &Assumed::default()).expect("described");
    assert_eq!((again.views[0].depth.len(), again.sensor.camera.fx), (8, 145.0));
    assert!(files.at("out/r-1000.0-0.ppm").is_file(), "colour goes along");
    fs::remove_dir_all(files.at("out")).expect("removed");
    files.correct(&dump, &[&options[..], &["--keep-code"]].concat());
    assert!(files.at("out/INDEX.txt").is_file());
}

/// A plain folder has no place for what its raw values mean, until it is written again: then the next
/// command reads it without an option.
#[test]
fn a_plain_folder_goes_on_as_a_described_one() {
    let files = Files::new();
    let raw = files.recording(RAW, Vec::new());
    let plain = files.at("plain");
    fs::create_dir(&plain).expect("made");
    for view in open_uncut(&raw, &Assumed::default()).expect("opened").views {
        let image = plain.join(format!("{}.png", view.name));
        fs::copy(&view.depth[0].path, image).expect("copied");
    }
    files.model(&small(vec![bowl(0.5)]));
    let camera = [145.25, 145.0, 79.5, 59.5];
    let intrinsics = camera.map(|v| v.to_string()).join(",");
    let code = "--raw-disparity=3.3309495161,-0.0030711016";
    files.correct(&plain, &["--intrinsics", &intrinsics, code]);
    let out = files.at("out");
    let again = kinoise::io::open(&out, &Assumed::default()).expect("described");
    let seen = &again.sensor.camera;
    assert_eq!([seen.fx, seen.fy, seen.cx, seen.cy], camera);
    assert!(matches!(again.sensor.code, DepthCode::Metric { .. }));
    let names: Vec<String> = again.views.iter().map(|v| v.name.clone()).collect();
    let assumed = Assumed {
        intrinsics: Some(camera),
        code: Some(RAW),
        baseline_m: None,
        ..Assumed::default()
    };
    let before = kinoise::io::open(&plain, &assumed).expect("opened");
    assert_eq!(names, before.views.iter().map(|v| v.name.clone()).collect::<Vec<_>>());
    let refused = kinoise::io::open(&out, &assumed).expect_err("it describes itself");
    assert!(refused.to_string().contains("describes its sensor itself"), "{refused}");
    // Once more, in a code that stays as it is.
    fs::rename(&out, files.at("once")).expect("moved");
    files.correct(&files.at("once"), &[]);
    assert!(kinoise::io::open(&out, &Assumed::default()).is_ok());
}

/// 1/z - 4 px of disparity leave nothing behind 2.7 m: the code's end, and told.
#[test]
fn depths_beyond_the_code_stand_at_its_end() {
    let files = Files::new();
    let recording = files.recording(METRIC, Vec::new());
    files.model(&small(vec![shaped(UNEXPLAINED, vec![bias(Basis::Level, &[6.9])])]));
    let (json, said) = files.correct(&recording, &[]);
    assert!(json["clamped"].as_u64() > Some(0), "{json}");
    assert!(said.contains("beyond the range of the depth code"), "{said}");
}

/// Learnt at 3 to 4 px, 2.7 to 3.6 m, and met by views that are nearer: each is corrected as the
/// nearest that was learnt, and the share of them is told.
#[test]
fn a_shape_is_held_where_its_learning_ended_and_that_is_told() {
    let files = Files::new();
    let recording = files.recording(METRIC, Vec::new());
    let growing =
        bias(Basis::powers(Coordinate::RadiusSquared, 1, Modulation::power(2.0)), &[30.0]);
    let learnt = Effect { learnt_px: Some([3.0, 4.0]), ..shaped(UNEXPLAINED, vec![growing]) };
    files.model(&small(vec![learnt]));
    let (_, said) = files.correct(&recording, &[]);
    assert!(said.contains("outside 2.72 to 3.62 m") && said.contains("held at the edge"), "{said}");
    let held = raw_values(&files.at("out"));
    fs::remove_dir_all(files.at("out")).expect("removed");
    files.model(&small(vec![bowl(30.0 * (4.0f64 / 40.0).powi(2))]));
    let (json, said) = files.correct(&recording, &[]);
    assert!(json["pixels_changed"].as_u64() > Some(100_000), "{json}");
    assert!(!said.contains("held at the edge"), "{said}");
    // Nearer than 2.6 m all is held; what stands still is added up in single precision.
    let (other, near) = (raw_values(&files.at("out")), 13_000);
    let pairs = held.iter().zip(&other).filter(|(a, _)| **a < near);
    assert!(held.len() == other.len() && pairs.clone().count() > 100_000);
    assert!(pairs.clone().all(|(a, b)| a.abs_diff(*b) <= 1));
}

/// Of every frame of a recording, one after another.
fn raw_values(recording: &Path) -> Vec<u16> {
    let opened = open_uncut(recording, &Assumed::default()).expect("opened");
    let mut source = FrameSource::new(160, 120);
    let frames = opened.views.iter().flat_map(|v| &v.depth);
    frames.flat_map(|f| source.read(&f.path).expect("read").raw).collect()
}

#[test]
fn a_damaged_image_is_copied_and_told() {
    let files = Files::new();
    let recording = files.recording(METRIC, Vec::new());
    files.model(&small(vec![bowl(0.5)]));
    fs::write(recording.join("0001/depth/0000.png"), b"no picture").expect("written");
    let (json, said) = files.correct(&recording, &[]);
    assert_eq!(json["frames"], json!(7));
    assert!(said.contains("copied as it is") && said.contains("0000.png"), "{said}");
}

#[test]
fn bad_input_is_refused_with_one_message() {
    let files = Files::new();
    let recording = files.at("rec");
    copy_tree(good(), &recording);
    let out = files.at("out");
    files.refused(&recording, &out, &["model.json"]);
    files.model(&model(&kinect_v1(2), vec![bowl(0.5)]));
    files.refused(&recording, &out, &["320 x 240", "160 x 120"]);
    fs::write(files.at("model.json"), "{\"format\": \"kinoise-model/9\"}").expect("written");
    files.refused(&recording, &out, &["newer"]);
    files.model(&small(vec![named("no-such-thing", json!({}))]));
    files.refused(&recording, &out, &["model.json", "no-such-thing"]);
    let path = files.model(&small(vec![bowl(0.5)]));
    files.refused(&files.at("nowhere"), &out, &["no such folder"]);
    files.refused(&recording, &recording.join("new/folder"), &["inside"]);
    files.refused(&recording, &recording, &["inside"]);
    files.refused(&recording, files.folder.path(), &["not empty"]);
    let text = fs::read_to_string(&path).expect("read");
    for (from, to, says) in [
        ("\"orders\": 1", "\"orders\": 2", "1 coefficients where its basis has 2"),
        ("\"orders\": 1", "\"orders\": 0", "orders"),
        ("\"kind\": \"bowl\"", "\"kind\": \"cup\"", "cup"),
        ("\"statistic\": \"bias\"", "\"statistic\": \"missing\"", "a bias or a variance"),
    ] {
        let lie = text.replacen(from, to, 1);
        assert_ne!(lie, text, "{from}");
        fs::write(&path, lie).expect("written");
        files.refused(&recording, &out, &["model.json", says]);
    }
    assert!(!out.exists(), "nothing was begun");
}

#[test]
fn an_effect_on_top_of_its_shape_is_refused() {
    let files = Files::new();
    let path = files.model(&small(vec![bowl(0.5)]));
    let output = kinoise()
        .args(["simulate", "--effect", "radial-disparity-bias:k_px=1", "--model"])
        .arg(path)
        .arg(files.at("out"))
        .output()
        .expect("runs");
    let said = String::from_utf8(output.stderr).expect("text");
    assert!(output.status.code() == Some(2) && said.contains("brings its shape"), "{said}");
}

#[test]
fn the_library_does_what_the_program_does() {
    let files = Files::new();
    let recording = files.recording(METRIC, Vec::new());
    let model = small(vec![bowl(0.5)]);
    files.model(&model);
    let (json, _) = files.correct(&recording, &[]);
    let out = files.at("library");
    let done = correct_recording(
        &recording,
        &Assumed::default(),
        &model,
        &out,
        &CorrectOptions::default(),
        &|_, _| (),
    )
    .expect("done");
    assert_eq!(json["pixels_changed"], json!(done.changed));
    assert!(tree(&out) == tree(&files.at("out")));
}

/// Two shapes of one fit err together and a third for itself: by hand, at every pixel, and in the
/// images that are written.
#[test]
fn the_uncertainty_of_a_correction_is_its_covariance() {
    let grows =
        |k: f64| bias(Basis::powers(Coordinate::RadiusSquared, 1, Modulation::power(2.0)), &[k]);
    let still =
        |k: f64| bias(Basis::powers(Coordinate::RadiusSquared, 1, Modulation::power(0.0)), &[k]);
    let of = |shape, fit, factors, variances| Effect {
        covariance: Some(Covariance { fit, factors, variances }),
        ..shaped(UNEXPLAINED, vec![shape])
    };
    let effects = vec![
        of(still(0.01), 1, vec![vec![0.2], vec![0.0]], vec![]),
        of(grows(0.01), 1, vec![vec![-0.1], vec![0.3]], vec![]),
        of(still(0.01), 2, vec![], vec![0.04]),
    ];
    let sensor = sensor();
    let correction =
        Correction::of(&model(&sensor, effects.clone()), &sensor).expect("a correction");
    let camera = &sensor.camera;
    let depth: Vec<f32> = (0..camera.pixels()).map(|i| 0.7 + 1e-5 * i as f32).collect();
    let told = correction.uncertainty_m(&depth, &Conditions::default());
    let corner = kinoise::terms::corner_radius(camera);
    for i in (0..camera.pixels()).step_by(97) {
        let (u, v) = ((i % camera.width) as f64, (i / camera.width) as f64);
        let square = (u - camera.cx).powi(2) + (v - camera.cy).powi(2);
        let (r2, z) = (square / corner.powi(2), f64::from(depth[i]));
        let far = (FB / z / 40.0).powi(2);
        let px2 = (0.2 - 0.1 * far).powi(2) + (0.3 * far).powi(2) + 0.04;
        let expected = r2 * px2.sqrt() * z * z / FB;
        assert!((f64::from(told[i]) - expected).abs() < 1e-4 * expected + 1e-9, "{i}");
    }
    assert!(correction.uncertainty_m(&[f32::NAN], &Conditions::default())[0].is_nan());

    let files = Files::new();
    let recording = files.recording(METRIC, Vec::new());
    files.model(&small(effects));
    let sigma = files.at("sigma");
    files.correct(&recording, &["--sigma", sigma.to_str().expect("a path")]);
    let about: Value =
        serde_json::from_slice(&fs::read(sigma.join("sigma.json")).expect("read")).expect("json");
    assert_eq!(about["units_per_metre"], json!(SIGMA_UNITS_PER_METRE));
    let words =
        FrameSource::new(160, 120).read(&sigma.join("0001/depth/0000.png")).expect("read").raw;
    assert!(words[0] > 20 && words[60 * 160 + 80] < 5, "{} {}", words[0], words[60 * 160 + 80]);
    fs::remove_dir_all(files.at("out")).expect("removed");
    files.model(&small(vec![bowl(0.5)]));
    let again = files.at("sigma2");
    let output = kinoise()
        .arg("correct")
        .arg(&recording)
        .args(["--model", files.at("model.json").to_str().expect("a path")])
        .args(["-o", files.at("out").to_str().expect("a path")])
        .args(["--sigma", again.to_str().expect("a path")])
        .output()
        .expect("runs");
    let said = String::from_utf8(output.stderr).expect("text");
    assert!(output.status.code() == Some(2) && said.contains("how sure"), "{said}");
    assert!(!again.exists() && !files.at("out").exists(), "nothing was begun");
}
