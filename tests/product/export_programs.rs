//! The exported Python file and C header, compared with the library itself.

use std::path::{Path, PathBuf};
use std::process::Command;

use kinoise::camera::Camera;
use kinoise::correct::{Conditions, Correction};
use kinoise::effects::{Active, Instant, fill_normal};
use kinoise::export::{ExportFormat, export};
use kinoise::model::{Direction, Domain, Effect, FitSummary, Provenance, UNEXPLAINED};
use kinoise::scene::{Bench, Seen, Target};
use kinoise::simulate::{FormulaSensor, kinect_v1};
use kinoise::terms::{Basis, Coordinate, Modulation, Statistic, TABLE, Term};
use kinoise::view::RecordingFile;
use kinoise::{DepthCode, Form, NoiseModel, Plane, Seed, Sensor, SigmaModel};
use serde_json::{Value, json};

use crate::common::truth;

/// A Python interpreter with numpy and `module`; `None`, with a printed reason, if there is none.
pub fn python_with(module: &str) -> Option<String> {
    let python = std::env::var("KINOISE_PYTHON").unwrap_or("python3".into());
    let check = Command::new(&python).args(["-c", &format!("import numpy, {module}")]).output();
    if check.is_ok_and(|o| o.status.success()) {
        return Some(python);
    }
    println!("skipped: {python} has no numpy or no {module}; name another in KINOISE_PYTHON");
    None
}

/// Runs a program and returns its output; panics with its stderr on failure.
pub fn run(command: &mut Command) -> String {
    let output = command.output().expect("started");
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {complaint}");
    String::from_utf8(output.stdout).expect("text")
}

/// A sensor of 80 x 60 px with lens distortion.
fn sensor() -> Sensor {
    let plain = kinect_v1(8);
    let camera =
        Camera { distortion: Some([-0.12, 0.05, 1e-3, -8e-4, 0.01]), cx: 40.3, ..plain.camera };
    let code = DepthCode::Metric { units_per_metre: 20_000.0, invalid: 0 };
    Sensor { camera, code, ..plain }
}

fn raw_sensor() -> Sensor {
    let code = DepthCode::Disparity { offset: 3.3309495161, slope: -0.0030711016, invalid: 2047 };
    Sensor { code, ..sensor() }
}

/// Raw disparities of more than a Kinect's 11 bits.
fn fine_sensor() -> Sensor {
    let code = DepthCode::Disparity { offset: 0.01, slope: 1e-4, invalid: 0 };
    Sensor { code, ..sensor() }
}

pub fn model(sensor: &Sensor, effects: Vec<Effect>) -> NoiseModel {
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

fn shaped(statistic: Statistic, bases: Vec<Basis>, size: f64) -> Effect {
    let term = |basis: Basis| {
        let wave = |k: usize| size * (1.3 * k as f64 + 0.4).sin();
        let coefficients = (0..basis.count()).map(wave).collect();
        Term { statistic, basis, coefficients }
    };
    let shape = bases.into_iter().map(term).collect();
    Effect { id: UNEXPLAINED.into(), shape, ..Effect::default() }
}

/// Every kind of basis, with all coordinates and modulations that an image has.
fn bases() -> Vec<Basis> {
    use Coordinate as C;
    use Modulation as M;
    let (width, height) = (80.0, 60.0);
    vec![
        Basis::Level,
        Basis::powers(C::RadiusSquared, 3, M::power(-0.7)),
        Basis::powers(C::RaySquared, 2, M::RadialSlope { fx: 72.5, fy: 72.5 }),
        Basis::Lens { fx: 72.5, fy: 72.5, reference_px: 4.5, orders: 2 },
        Basis::powers(C::Foreshortening, 1, M::Disparity),
        Basis::Powers { over: C::LogRatio(2.0), orders: 2, level: true, times: M::One },
        Basis::Polynomial { over: [C::Theta, C::Along], degree: 4, times: M::Lift },
        Basis::waves(C::Disparity, 1.0, 3),
        Basis::waves(C::Column, 17.0, 2),
        Basis::Decay { over: C::Radius, width: 0.3 },
        Basis::Log1p { over: C::Blur(0.8) },
        Basis::Log1p { over: C::Ambient(0.05) },
        Basis::powers(C::Alignment, 1, M::TiltPower(2)),
        Basis::powers(C::Session, 1, M::SlopeSquared),
        Basis::Table {
            z_m: [0.6, 3.0],
            theta_rad: [0.0, 1.2],
            columns: vec![(0..TABLE * TABLE).map(|k| (0.1 * k as f64).cos()).collect(); 2],
        },
        Basis::Curve { over: C::Disparity, low: 2.0, high: 9.0, nodes: 7, times: M::Tilt },
        Basis::Curve { over: C::Temperature, low: 10.0, high: 30.0, nodes: 3, times: M::One },
        Basis::Curve { over: C::LogZ, low: -0.5, high: 1.2, nodes: 5, times: M::One },
        Basis::Ring { over: C::Azimuth, period: std::f64::consts::TAU, nodes: 6, times: M::Tilt },
        Basis::Map { width, height, across: 4, down: 3, times: M::DisparitySquared },
        Basis::Spline { width, height, across: 6, down: 5, times: M::DisparitySquared },
        Basis::Affine { times: M::DisparitySquared },
        Basis::Pair { over: [C::Z, C::Row], low: [0.5, 0.0], high: [4.0, 59.0], nodes: [4, 3] },
    ]
}

/// Name of the model whose shapes were learnt over a part of the range.
const HELD: &str = "held";

/// Models that together contain everything that can be exported.
pub fn models() -> Vec<(&'static str, NoiseModel)> {
    let one = |basis: &Basis| vec![shaped(Statistic::Bias, vec![basis.clone()], 0.03)];
    let biases = || {
        vec![
            named("depth-scale", json!({"scale": 1.02})),
            named("thermal-drift", json!({"relative": 0.01, "time_constant_s": 600.0})),
            named("range-not-depth", json!({"share": 0.5})),
            named("disparity-offset", json!({"offset_px": 0.04})),
            named("pixel-locking", json!({"amplitude_px": 0.05})),
        ]
    };
    // The vignetting formula scales the noise before rounding, the exported term after it: with the coarse
    // steps of raw disparities the noise would differ.
    let formulas = || biases().into_iter().chain([named("vignetting", json!({}))]).collect();
    let learnt = |effect: Effect| Effect { learnt_px: Some([3.0, 5.0]), ..effect };
    let mut models = vec![
        ("all biases", model(&sensor(), vec![shaped(Statistic::Bias, bases(), 0.01)])),
        ("all variances", model(&sensor(), vec![shaped(Statistic::Variance, bases(), 0.05)])),
        ("formulas", model(&sensor(), formulas())),
        ("raw disparities", model(&raw_sensor(), biases())),
        ("fine raw disparities", model(&fine_sensor(), biases())),
        (HELD, model(&sensor(), vec![learnt(shaped(Statistic::Bias, bases(), 0.01))])),
        ("plain", model(&kinect_v1(8), Vec::new())),
    ];
    models.extend(bases().iter().map(|b| ("one basis", model(&sensor(), one(b)))));
    models
}

/// A tilted wall behind a nearer board, with noise, holes and zero depths.
fn picture(sensor: &Sensor) -> Vec<f32> {
    let rays = sensor.camera.rays();
    let (wall, board) = (Plane::tilted(2.2, 0.7, 0.5), Plane::tilted(1.1, 0.4, -2.0));
    let pixel = |i: usize| {
        let (u, v) = (i % sensor.camera.width, i / sensor.camera.width);
        let plane = if u > 30 && v < 40 { board } else { wall };
        let ripple = 1.0 + 2e-3 * (12.9898 * i as f64).sin();
        match i % 37 {
            0 => f32::NAN,
            1 if i.is_multiple_of(5) => 0.0,
            _ => (plane.depth_at(&rays, i) * ripple) as f32,
        }
    };
    (0..sensor.camera.pixels()).map(pixel).collect()
}

const SESSION_S: f64 = 400.0;
const TEMPERATURE_C: f64 = 23.5;
const AMBIENT_LUX: f64 = 300.0;

/// The conditions with and without a thermometer and a light meter.
fn conditions() -> [Conditions; 2] {
    let known = Conditions {
        session_s: SESSION_S,
        temperature_c: Some(TEMPERATURE_C),
        ambient_lux: Some(AMBIENT_LUX),
    };
    [known, Conditions { session_s: SESSION_S, ..Conditions::default() }]
}

const INSTANT: Instant = Instant { view: 0, frame: 0, session_s: SESSION_S, view_s: 0.0 };

/// Input of a program and this library's answers.
struct Case {
    folder: tempfile::TempDir,
    corrected: [Vec<f64>; 2],
    /// Stored depths, m.
    depth: Vec<f32>,
    sigma: [Vec<f64>; 2],
    /// At places inside the range, at its edges and beyond.
    surface: Vec<f64>,
    stored: Vec<f64>,
}

fn places(domain: Domain) -> Vec<f64> {
    let along = |[low, high]: [f64; 2]| {
        let wide = high - low;
        [-0.2, 0.0, 1e-9, 0.13, 0.5, 0.77, 1.0 - 1e-9, 1.0, 1.4].map(|s| low + s * wide)
    };
    let (z, theta) = (along(domain.z_m), along(domain.theta_rad));
    z.iter().flat_map(|&z| theta.iter().flat_map(move |&t| [z.max(0.01), t])).collect()
}

fn write_doubles(path: &Path, numbers: impl IntoIterator<Item = f64>) {
    let bytes: Vec<u8> = numbers.into_iter().flat_map(f64::to_le_bytes).collect();
    std::fs::write(path, bytes).expect("written");
}

fn read_doubles(path: &Path) -> Vec<f64> {
    let bytes = std::fs::read(path).expect("read");
    bytes.chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().expect("8"))).collect()
}

impl Case {
    fn of(model: &NoiseModel) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let sensor = model.described_sensor().expect("whole").expect("a sensor");
        let depth = picture(&sensor);
        let correction = Correction::of(model, &sensor).expect("a correction");
        let at = |name: &str| folder.path().join(name);
        write_doubles(&at("depth"), depth.iter().map(|&z| f64::from(z)));
        let places = places(model.sigma.domain);
        write_doubles(&at("places"), places.iter().copied());

        let rays = sensor.camera.rays();
        let seen = Seen::of(
            &Bench::bare(Plane::tilted(1.4, 0.5, 0.3), Target::Wall),
            &sensor.camera,
            &rays,
        );
        let effects = Active::all_of_model(&model.effects).expect("effects");
        let camera = FormulaSensor {
            sensor: &sensor,
            rays: &rays,
            sigma: &model.sigma,
            effects: &effects,
            seed: Seed(3),
        };
        let mut shooting = camera.begin(&seen);
        shooting.temperature_c = Some(TEMPERATURE_C);
        shooting.ambient_lux = AMBIENT_LUX;
        let shot = shooting.shoot(INSTANT);
        let mut noise = vec![0f32; seen.depth.len()];
        fill_normal(&mut noise, &mut Seed(3).stream("simulate/0/0"));
        write_doubles(&at("true"), seen.depth.iter().map(|&z| f64::from(z)));
        write_doubles(&at("normals"), seen.normal.iter().flatten().map(|&c| f64::from(c)));
        write_doubles(&at("noise"), noise.iter().map(|&n| f64::from(n)));
        let of = |c: Conditions| correction.corrected(&depth, &c).expect("corrected");
        let sigma = |c: Conditions| correction.sigma_m(&depth, &c).expect("sigma");
        Case {
            corrected: conditions().map(of),
            sigma: conditions().map(sigma),
            depth: depth.clone(),
            surface: places
                .chunks_exact(2)
                .map(|at| model.sigma.axial_sigma(at[0], at[1]))
                .collect(),
            stored: shot
                .depth
                .raw
                .iter()
                .map(|&w| sensor.code.metres(w).unwrap_or(f64::NAN))
                .collect(),
            folder,
        }
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn check(&self, name: &str, code: DepthCode) {
        same(name, "sigma", &read_doubles(&self.at("surface")), &self.surface, |_| 1.0);
        for (k, (corrected, sigma)) in self.corrected.iter().zip(&self.sigma).enumerate() {
            // To 1e-12 of the disparity: where a bias leaves little of it, the depth magnifies the error.
            let magnified = |i: usize| (corrected[i] / f64::from(self.depth[i])).max(1.0);
            let read = |what: &str| read_doubles(&self.at(&format!("{what}{k}")));
            same(name, "correct", &read("corrected"), corrected, magnified);
            same(name, "sigma_image", &read("sigma"), sigma, magnified);
        }
        // The simulator does not hold shapes beyond the range they were learnt at.
        if name == HELD {
            return;
        }
        // The simulator works in single precision: a depth at the boundary of two raw values may round to the
        // other one, but no further.
        let sampled = read_doubles(&self.at("sampled"));
        let apart = |(a, b): &(&f64, &f64)| !(a == b || (a.is_nan() && b.is_nan()));
        let others: Vec<_> = sampled.iter().zip(&self.stored).filter(apart).collect();
        let few = 100 * others.len() < sampled.len();
        assert!(few, "{name}: {} of them differ, {:?}", others.len(), &others[..3]);
        for (a, b) in others {
            let step = code.step_inverse(*b) * b * b;
            assert!((a - b).abs() < 1.5 * step, "{name} sample: {a}, not {b}");
        }
    }
}

/// Asserts equality to 1e-12, times the factor by which the computation magnifies errors.
fn same(name: &str, what: &str, found: &[f64], truth: &[f64], magnified: impl Fn(usize) -> f64) {
    assert_eq!(found.len(), truth.len(), "{name} {what}");
    for (i, (a, b)) in found.iter().zip(truth).enumerate() {
        let near = || (a - b).abs() <= 1e-12 * b.abs() * magnified(i);
        let equal = a == b || (a.is_nan() && b.is_nan()) || near();
        assert!(equal, "{name} {what} {i}: {a}, not {b}");
    }
}

fn write_export(model: &NoiseModel, format: ExportFormat, path: &Path) {
    std::fs::write(path, export(model, format).expect("exported").bytes).expect("written");
}

const ASK_IN_PYTHON: &str = "
import numpy as np
import model
read = lambda name: np.fromfile(name)
z, theta = read('places').reshape(-1, 2).T
model.sigma(z, theta).tofile('surface')
depth = read('depth').reshape(model.HEIGHT, model.WIDTH)
known = dict(session_s=400.0, temperature_c=23.5, ambient_lux=300.0)
for k, conditions in enumerate((known, dict(session_s=400.0))):
    model.correct(depth, **conditions).tofile(f'corrected{k}')
    model.sigma_image(depth, **conditions).tofile(f'sigma{k}')
model.sample(read('true'), read('normals').reshape(-1, 3), read('noise'), **known).tofile('sampled')
";

#[test]
fn the_python_file_is_the_model() {
    let Some(python) = python_with("types") else { return };
    for (name, model) in models() {
        let case = Case::of(&model);
        write_export(&model, ExportFormat::Python, &case.at("model.py"));
        std::fs::write(case.at("ask.py"), ASK_IN_PYTHON).expect("written");
        run(Command::new(&python).arg("ask.py").current_dir(case.folder.path()));
        let sensor = model.described_sensor().expect("whole").expect("a sensor");
        case.check(name, sensor.code);
    }
}

const ASK_IN_C: &str = r#"
#include <stdio.h>
#include "model.h"
#define PIXELS (KINOISE_WIDTH * KINOISE_HEIGHT)
static double depth[PIXELS], out[PIXELS], normals[3 * PIXELS], noise[PIXELS], places[10000];
static float stored[PIXELS];
static size_t get(const char *name, double *to, size_t most)
{
    FILE *f = fopen(name, "rb");
    size_t n = fread(to, sizeof *to, most, f);
    fclose(f);
    return n;
}
static void put(const char *name, const double *from, size_t n)
{
    FILE *f = fopen(name, "wb");
    fwrite(from, sizeof *from, n, f);
    fclose(f);
}
int main(void)
{
    size_t n = get("places", places, 10000) / 2, i;
    kinoise_conditions known = {400.0, 1, 23.5, 1, 300.0}, unmeasured = {400.0, 0, 0.0, 0, 0.0};
    for (i = 0; i < n; i++)
        places[i] = kinoise_sigma(places[2 * i], places[2 * i + 1]);
    put("surface", places, n);
    get("depth", depth, PIXELS);
    for (i = 0; i < PIXELS; i++)
        stored[i] = (float)depth[i];
    if (kinoise_correct(stored, out, &known))
        return 1;
    put("corrected0", out, PIXELS);
    if (kinoise_correct(stored, out, &unmeasured))
        return 1;
    put("corrected1", out, PIXELS);
    if (kinoise_sigma_image(stored, out, &known))
        return 1;
    put("sigma0", out, PIXELS);
    if (kinoise_sigma_image(stored, out, &unmeasured))
        return 1;
    put("sigma1", out, PIXELS);
    get("true", depth, PIXELS);
    get("normals", normals, 3 * PIXELS);
    get("noise", noise, PIXELS);
    for (i = 0; i < PIXELS; i++)
        out[i] = kinoise_sample((int)i, depth[i], normals + 3 * i, noise[i], &known);
    put("sampled", out, PIXELS);
    return 0;
}
"#;

#[test]
fn the_c_header_is_the_model() {
    if Command::new("gcc").arg("--version").output().is_err() {
        println!("skipped: there is no gcc");
        return;
    }
    for (name, model) in models() {
        let case = Case::of(&model);
        write_export(&model, ExportFormat::C, &case.at("model.h"));
        std::fs::write(case.at("ask.c"), ASK_IN_C).expect("written");
        let strict =
            ["-std=c99", "-Wall", "-Wextra", "-Werror", "-O1", "ask.c", "-o", "ask", "-lm"];
        run(Command::new("gcc").args(strict).current_dir(case.folder.path()));
        run(Command::new("./ask").current_dir(case.folder.path()));
        let sensor = model.described_sensor().expect("whole").expect("a sensor");
        case.check(name, sensor.code);
    }
}

/// Each form, as axial and as perpendicular noise, without a sensor.
#[test]
fn every_form_of_sigma_is_the_same_in_python() {
    let Some(python) = python_with("types") else { return };
    let domain = truth().domain;
    let disparity = SigmaModel::published(Form::Disparity, &[1.4e-3, 0.8e-3], domain);
    for sigma in
        [SigmaModel::paper(), SigmaModel::nguyen(), SigmaModel::khoshelham(), disparity, truth()]
    {
        for direction in [Direction::Axial, Direction::Perpendicular] {
            let sigma = SigmaModel { direction, ..sigma.clone() };
            let bare = NoiseModel { sigma: sigma.clone(), ..NoiseModel::paper() };
            let folder = tempfile::tempdir().expect("a folder");
            write_export(&bare, ExportFormat::Python, &folder.path().join("model.py"));
            let places = places(sigma.domain);
            write_doubles(&folder.path().join("places"), places.iter().copied());
            let ask = "import numpy as np, model; z, t = np.fromfile('places').reshape(-1, 2).T; model.sigma(z, t).tofile('surface')";
            run(Command::new(&python).args(["-c", ask]).current_dir(folder.path()));
            let truth: Vec<f64> =
                places.chunks_exact(2).map(|at| sigma.axial_sigma(at[0], at[1])).collect();
            let found = read_doubles(&folder.path().join("surface"));
            same(sigma.form.id(), "sigma", &found, &truth, |_| 1.0);
        }
    }
}
