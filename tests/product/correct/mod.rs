//! Shapes applied and biases removed: the simulator against closed forms, the correction against noise.

use std::fs;
use std::path::{Path, PathBuf};

use kinoise::correct::{
    Conditions, CorrectOptions, Correction, SIGMA_UNITS_PER_METRE, correct_recording,
};
use kinoise::effects::Active;
use kinoise::io::{Assumed, FrameSource, encode_pgm16, open_uncut};
use kinoise::model::{Covariance, Domain, Effect, FitSummary, Provenance, UNEXPLAINED};
use kinoise::scene::{Bench, Seen, Target};
use kinoise::simulate::{FormulaSensor, Physics, Scenery, Shoot, kinect_v1, plan_grid};
use kinoise::terms::{Basis, Coordinate, Modulation, Statistic, Term};
use kinoise::view::RecordingFile;
use kinoise::{DepthCode, Form, Frame, NoiseModel, Plane, Seed, Sensor, SigmaModel};
use serde_json::{Value, json};

use crate::common;
use crate::common::{copy_tree, good, kinoise, tree, truth};

mod layouts;
mod recordings;
mod refusals;
mod shapes;

/// Half the resolution of a Kinect v1, words of 0.07 mm.
fn sensor() -> Sensor {
    let code = DepthCode::Metric { units_per_metre: 15_000.0, invalid: 0 };
    Sensor { code, ..kinect_v1(2) }
}

/// fx * baseline of this sensor, px m.
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

/// Frames of a wall by a sensor with this noise, one for each session time.
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

/// Disparity minus that of the plane, px, at every pixel.
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

/// Rounding of half a word at this depth, px, plus that of single precision.
fn rounding_px(z: f64) -> f64 {
    0.6 / 15_000.0 * FB / (z * z) + 1e-4
}

/// (u, v) of the tested pixels.
const CHOSEN: [(usize, usize); 5] = [(0, 0), (160, 120), (319, 239), (40, 200), (250, 17)];

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

    /// Writes a recording of 160 x 120 px with `code`.
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

/// Mean over the four views of the measured spatial sigma in units of the true one.
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
/// Raw values of all frames of a recording, in order.
fn raw_values(recording: &Path) -> Vec<u16> {
    let opened = open_uncut(recording, &Assumed::default()).expect("opened");
    let mut source = FrameSource::new(160, 120);
    let frames = opened.views.iter().flat_map(|v| &v.depth);
    frames.flat_map(|f| source.read(&f.path).expect("read").raw).collect()
}
