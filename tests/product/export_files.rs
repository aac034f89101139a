//! The other exported files, each read by its intended reader.

use std::path::Path;
use std::process::Command;

use kinoise::correct::{Conditions, Correction};
use kinoise::export::{ExportFormat, export};
use kinoise::model::{Effect, UNEXPLAINED};
use kinoise::simulate::kinect_v1;
use kinoise::terms::{Basis, Coordinate, Modulation, Term};
use kinoise::{NoiseModel, SigmaModel};
use serde_json::{Value, json};

use super::export_programs::{model, python_with, run};
use crate::common::kinoise;

/// A bias bowl that grows with the square of the disparity, and noise effects.
fn bowl() -> NoiseModel {
    let basis = Basis::powers(Coordinate::RadiusSquared, 1, Modulation::DisparitySquared);
    let shape = vec![Term::bias(basis, vec![0.4])];
    let parameters = |value: Value| value.as_object().expect("an object").clone();
    let steps = Effect {
        id: "disparity-quantisation".into(),
        parameters: parameters(json!({"step_px": {"value": 0.125}})),
        ..Effect::default()
    };
    let window = Effect {
        id: "spatial-correlation".into(),
        parameters: parameters(json!({"length_px": 9.0})),
        ..Effect::default()
    };
    let bias = Effect { id: UNEXPLAINED.into(), shape, ..Effect::default() };
    let mut model = model(&kinect_v1(1), vec![bias, steps, window]);
    model.sigma = SigmaModel::paper();
    model
}

struct Written {
    folder: tempfile::TempDir,
    notes: String,
}

fn written(model: &NoiseModel, format: ExportFormat, name: &str) -> Written {
    let folder = tempfile::tempdir().expect("a folder");
    let exported = export(model, format).expect("exported");
    std::fs::write(folder.path().join(name), &exported.bytes).expect("written");
    Written { folder, notes: exported.notes.join("\n") }
}

/// Runs a Python program on a file and returns the JSON that it prints.
fn asked(python: &str, folder: &Path, program: &str) -> Value {
    let text = run(Command::new(python).args(["-c", program]).current_dir(folder));
    serde_json::from_str(&text).expect("JSON")
}

fn near(found: &Value, truth: f64, tolerance: f64) {
    let found = found.as_f64().expect("a number");
    assert!((found - truth).abs() <= tolerance * truth.abs(), "{found}, not {truth}");
}

/// Corrected depth of pixel (u, v) in an image of constant depth, m.
fn corrected(model: &NoiseModel, depth: f64, u: usize, v: usize) -> f64 {
    corrected_picture(model, depth)[v * 640 + u]
}

fn corrected_picture(model: &NoiseModel, depth: f64) -> Vec<f64> {
    let sensor = model.described_sensor().expect("whole").expect("a sensor");
    let picture = vec![depth as f32; sensor.camera.pixels()];
    let correction = Correction::of(model, &sensor).expect("a correction");
    correction.corrected(&picture, &Conditions::default()).expect("corrected")
}

#[test]
fn numpy_reads_the_tables() {
    let Some(python) = python_with("json") else { return };
    let model = bowl();
    let file = written(&model, ExportFormat::Npz, "model.npz");
    let found = asked(&python, file.folder.path(), "
import json, numpy as np
m = np.load('model.npz')
s, z, t, c = m['sigma_m'], m['sigma_z_m'], m['sigma_theta_rad'], m['correction_m']
print(json.dumps({'sigma': s.tolist(), 'z': z.tolist(), 'theta': t.tolist(), 'shape': c.shape,
    'depths': m['correction_z_m'].tolist(), 'corner': c[:, 0, 0].tolist(), 'k': m['intrinsics'].tolist()}))");
    assert_eq!(found["shape"], json!([9, 480, 640]));
    assert_eq!(found["k"], json!([580.0, 580.0, 319.5, 239.5]));
    let list =
        |name: &str| serde_json::from_value::<Vec<f64>>(found[name].clone()).expect("numbers");
    for (i, z) in list("z").into_iter().enumerate() {
        for (j, theta) in list("theta").into_iter().enumerate() {
            near(&found["sigma"][i][j], model.sigma.sigma(z, theta), 0.0);
        }
    }
    for (depth, found) in list("depths").into_iter().zip(list("corner")) {
        let truth = corrected(&model, depth, 0, 0) - f64::from(depth as f32);
        assert!((found - truth).abs() < 1e-7, "{depth}: {found}, not {truth}");
    }
}

#[test]
fn opencv_reads_its_storage() {
    let Some(python) = python_with("cv2") else { return };
    let model = bowl();
    let file = written(&model, ExportFormat::OpenCv, "model.yaml");
    let found = asked(&python, file.folder.path(), "
import cv2, json
f = cv2.FileStorage('model.yaml', cv2.FILE_STORAGE_READ)
m = lambda name: f.getNode(name).mat().tolist()
print(json.dumps({'width': f.getNode('image_width').real(), 'k': m('camera_matrix'), 'sigma': m('sigma_m'),
    'z': m('sigma_z_m')[0], 'theta': m('sigma_theta_rad')[0], 'factor': m('correction_factor'),
    'depths': m('correction_z_m')[0]}))");
    assert_eq!(found["width"], 640.0);
    assert_eq!(found["k"][1], json!([0.0, 580.0, 239.5]));
    let list =
        |name: &str| serde_json::from_value::<Vec<f64>>(found[name].clone()).expect("numbers");
    for (i, z) in list("z").into_iter().enumerate() {
        for (j, theta) in list("theta").into_iter().enumerate() {
            near(&found["sigma"][i][j], model.sigma.sigma(z, theta), 1e-12);
        }
    }
    for (row, depth) in list("depths").into_iter().enumerate() {
        // The block of columns 320 to 335 and rows 240 to 255.
        let all = corrected_picture(&model, depth);
        let block = (240..256).flat_map(|v| (320..336).map(move |u| v * 640 + u));
        let mean = block.map(|i| all[i] / depth).sum::<f64>() / 256.0;
        near(&found["factor"][row][15 * 40 + 20], mean, 1e-12);
    }
    assert!(file.notes.contains("16 x 16 px"), "{}", file.notes);
}

#[test]
fn ros_reads_the_intrinsics_and_the_processor_its_parameters() {
    let Some(python) = python_with("yaml") else { return };
    let model = bowl();
    let file = written(&model, ExportFormat::CameraInfo, "camera.yaml");
    let read = |name: &str| {
        format!("import json, yaml; print(json.dumps(yaml.safe_load(open('{name}'))))")
    };
    let found = asked(&python, file.folder.path(), &read("camera.yaml"));
    assert_eq!((&found["image_width"], &found["image_height"]), (&json!(640), &json!(480)));
    assert_eq!(found["distortion_model"], "plumb_bob");
    for (name, rows, cols) in [
        ("camera_matrix", 3, 3),
        ("distortion_coefficients", 1, 5),
        ("rectification_matrix", 3, 3),
        ("projection_matrix", 3, 4),
    ] {
        let matrix = &found[name];
        assert_eq!((&matrix["rows"], &matrix["cols"]), (&json!(rows), &json!(cols)), "{name}");
        assert_eq!(matrix["data"].as_array().map(Vec::len), Some(rows * cols), "{name}");
    }
    assert!(file.notes.contains("no place in camera_info"), "{}", file.notes);

    for sigma in [SigmaModel::paper(), SigmaModel::nguyen(), SigmaModel::khoshelham()] {
        let model = NoiseModel { sigma, ..bowl() };
        let file = written(&model, ExportFormat::ElevationMapping, "sensor.yaml");
        let found = asked(&python, file.folder.path(), &read("sensor.yaml"));
        let p = &found["sensor_processor"];
        assert_eq!(p["type"], "structured_light");
        let get = |name: &str| p[name].as_f64().unwrap_or_else(|| panic!("{name} in {p}"));
        let [low, high] = [get("cutoff_min_depth"), get("cutoff_max_depth")];
        assert_eq!([low, high], model.sigma.domain.z_m);
        for z in [low, 0.5 * (low + high), high] {
            let normal = get("normal_factor_a")
                + get("normal_factor_b") * (z - get("normal_factor_c")).powi(2)
                + get("normal_factor_d") * z.powf(get("normal_factor_e"));
            near(&json!(normal), model.sigma.sigma(z, 0.0), 1e-12);
        }
        near(&p["lateral_factor"], 1.0 / (580.0 * 12f64.sqrt()), 1e-12);
        assert!(file.notes.contains("knows no tilt"), "{}", file.notes);
    }
}

#[test]
fn usd_parses_the_depth_sensor() {
    let Some(python) = python_with("pxr") else { return };
    let model = bowl();
    let file = written(&model, ExportFormat::Isaac, "sensor.usda");
    let found = asked(&python, file.folder.path(), "
import json
from pxr import Usd
stage = Usd.Stage.Open('sensor.usda')
prim = stage.GetDefaultPrim()
get = {a.GetName().split(':')[-1]: a.Get() for a in prim.GetAttributes() if 'depthSensor' in a.GetName()}
print(json.dumps({'type': prim.GetTypeName(), 'schemas': prim.GetPrimTypeInfo().GetAppliedAPISchemas(), **get}))");
    assert_eq!(found["type"], "RenderProduct");
    assert_eq!(found["schemas"], json!(["OmniSensorDepthSensorSingleViewAPI"]));
    assert_eq!(found["enabled"], true);
    // USD's floats have single precision.
    for (name, truth) in [
        ("baselineMM", 75.0),
        ("focalLengthPixel", 580.0),
        ("sensorSizePixel", 640.0),
        ("maxDisparityPixel", 43.5),
        ("noiseMean", 0.125),
        ("noiseDownscaleFactorPixel", 9.0),
        ("minDistance", 1.0),
        ("maxDistance", 4.0),
    ] {
        near(&found[name], truth, 1e-7);
    }
    let sigma_px = |z: f64| model.sigma.sigma(z, 0.0) * 43.5 / (z * z);
    // Together with the steps' own noise it lies within the model's noise over the range.
    let found = found["noiseSigma"].as_f64().expect("a number").hypot(0.125 / 12f64.sqrt());
    let sizes = [1.0, 1.5, 2.0, 3.0, 4.0].map(sigma_px);
    let within = sizes.iter().any(|s| *s < found) && sizes.iter().any(|s| *s > found);
    assert!(within, "{found} {sizes:?}");
}

/// CLAMS is not available to the test: the steps of its reader are repeated here.
#[test]
fn clams_finds_the_bias() {
    let Some(python) = python_with("struct") else { return };
    let model = bowl();
    let file = written(&model, ExportFormat::Clams, "model.clams");
    let found = asked(&python, file.folder.path(), "
import json, math, struct
import numpy as np
f = open('model.clams', 'rb')
assert f.readline() == b'DiscreteDepthDistortionModel v01\\n'
get = lambda kind: struct.unpack('<' + kind, f.read(struct.calcsize('<' + kind)))
width, height, bw, bh, bin_depth, nx, ny = get('iiiidii')
def vector():
    size, rows, cols = get('iii')
    assert (size, cols) == (4, 1)
    return np.frombuffer(f.read(4 * rows), '<f4')
frustums = []
for _ in range(nx * ny):
    farthest, bins, depth = get('did')
    counts, numerators, denominators, multipliers = (vector() for _ in range(4))
    assert bins == len(counts) == len(multipliers) == math.ceil(farthest / depth)
    assert np.allclose(numerators / denominators, multipliers, rtol=1e-6)
    frustums.append((counts, multipliers))
assert not f.read()
def undistort(u, v, z):
    counts, m = frustums[v // bh * nx + u // bw]
    idx = min(len(m) - 1, int(z / bin_depth))
    one = idx if z - bin_depth * idx < bin_depth / 2 else idx + 1
    nought = one - 1
    if nought < 0 or one >= len(m) or counts[nought] < 50 or counts[one] < 50:
        return z * float(m[idx])
    share = (z - ((nought + 1) * bin_depth - bin_depth / 2)) / bin_depth
    return z * float((1 - share) * m[nought] + share * m[one])
print(json.dumps([[width, height, bw, bh, nx, ny]] + [undistort(4, 3, z) for z in (1.0, 1.7, 2.53, 3.9)]))");
    assert_eq!(found[0], json!([640, 480, 8, 6, 80, 80]));
    for (k, depth) in [1.0, 1.7, 2.53, 3.9].into_iter().enumerate() {
        // Half a block off the middle of a corner block, and between the bins of 0.2 m.
        near(&found[1 + k], corrected(&model, depth, 4, 3), 2e-4);
    }
    assert!(file.notes.contains("the bias alone"), "{}", file.notes);
}

/// Reads it as Open3D's own comment says: np.loadtxt(fname, comments='%', skiprows=5).
#[test]
fn open3d_finds_the_bias() {
    let Some(python) = python_with("json") else { return };
    let model = bowl();
    let file = written(&model, ExportFormat::Open3d, "model.txt");
    let found = asked(
        &python,
        file.folder.path(),
        "
import json, numpy as np
data = np.loadtxt('model.txt', comments='%', skiprows=5)
assert data.shape == (6400 * 23,), data.shape
table = np.zeros((80, 80, 5))
for y in range(80):
    for x in range(80):
        idx = (y * 80 + x) * 23 + 3
        if not (data[idx:idx + 5] < 8000).all():
            table[y, x] = data[idx + 15:idx + 20]
def distort(u, v, d):
    i2 = int((d + 1) / 2)
    i1 = i2 - 1
    a = (d - (i1 * 2 + 1)) / 2
    m = table[v // 6, u // 8]
    return d / ((1 - a) * m[max(i1, 0)] + a * m[min(i2, 4)])
print(json.dumps([distort(4, 3, d) for d in (1.0, 3.0)]))",
    );
    for (k, depth) in [1.0, 3.0].into_iter().enumerate() {
        let stored = found[k].as_f64().expect("a number");
        near(&json!(corrected(&model, stored, 4, 3)), depth, 1e-4);
    }
    let Some(python) = python_with("open3d") else { return };
    let same = asked(
        &python,
        file.folder.path(),
        "
import json, numpy as np, open3d as o3d
s = o3d.t.io.DepthNoiseSimulator('model.txt')
s.enable_deterministic_debug_mode()
flat = o3d.t.geometry.Image(np.full((480, 640, 1), 3.0, np.float32))
print(json.dumps(float(s.simulate(flat, depth_scale=1.0).as_tensor().numpy()[3, 4, 0])))",
    );
    let step = 9.0 / (35.13 * 8.0);
    let (simulated, ours) =
        (same.as_f64().expect("a number"), found[1].as_f64().expect("a number"));
    assert!((simulated - ours).abs() < step, "{simulated} and {ours}");
}

#[test]
fn the_command_writes_every_format_and_refuses_what_it_must() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    bowl().write(&at("model.json")).expect("written");
    NoiseModel::paper().write(&at("bare.json")).expect("written");
    let export = |model: &str, format: &str, output: &str, more: &[&str]| {
        let output = kinoise()
            .args(["export", model, "--format", format, "-o", output])
            .args(more)
            .current_dir(folder.path())
            .output()
            .expect("started");
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    for format in [
        "python",
        "c",
        "npz",
        "opencv",
        "camera-info",
        "elevation-mapping",
        "isaac",
        "clams",
        "open3d",
    ] {
        let (code, said) = export("model.json", format, &format!("{format}.out"), &[]);
        assert_eq!(code, Some(0), "{format}: {said}");
        assert!(at(&format!("{format}.out")).metadata().expect("a file").len() > 200);
        assert!(said.contains("wrote"), "{said}");
        let needs_sensor = !["python", "c", "npz", "elevation-mapping"].contains(&format);
        let (code, said) = export("bare.json", format, &format!("{format}.bare"), &[]);
        assert_eq!(code, Some(if needs_sensor { 2 } else { 0 }), "{format}: {said}");
        assert_eq!(at(&format!("{format}.bare")).exists(), !needs_sensor);
    }
    let (code, said) = export("model.json", "c", "c.out", &[]);
    assert!(code == Some(2) && said.contains("--force"), "{said}");
    assert_eq!(export("model.json", "c", "c.out", &["--force"]).0, Some(0));
    let (code, said) = export("model.json", "c", "model.json", &["--force"]);
    assert!(code == Some(2) && said.contains("replace the model"), "{said}");
    assert_eq!(NoiseModel::read(&at("model.json")).expect("unharmed"), bowl());
}
