//! Invariances: results do not depend on the orientation of the image, the scale of the world, the order in
//! which files were written, or the locale.

use std::fs;
use std::path::{Path, PathBuf};

use kinoise::diagnose::{DiagnoseOptions, Finding, diagnose};
use kinoise::effects::Active;
use kinoise::measure::{MeasureOptions, TargetFrames, Workbench};
use kinoise::scene::Target;
use kinoise::simulate::{Grid, Physics, Shoot, kinect_v1};
use kinoise::view::{FrameRef, Recording, RecordingFile};
use kinoise::{
    CalibrateOptions, DepthCode, Form, Frame, NoiseModel, Seed, Sensor, SigmaModel, io,
    measure_recording, model_of,
};

use crate::common::{copy_tree, good, grid, kinoise, shots, tree, write_depth};

/// Transformation of a recording.
#[derive(Clone, Copy)]
enum Turn {
    /// Left and right swapped.
    Mirrored,
    /// Rows and columns swapped.
    Transposed,
    /// The whole world twice as large, sensor included.
    Doubled,
}

impl Turn {
    fn sensor(self, sensor: Sensor) -> Sensor {
        let mut camera = sensor.camera.clone();
        match self {
            // The principal point is central.
            Turn::Mirrored => sensor,
            Turn::Transposed => {
                let old = sensor.camera.clone();
                (camera.width, camera.height) = (old.height, old.width);
                (camera.fx, camera.fy, camera.cx, camera.cy) = (old.fy, old.fx, old.cy, old.cx);
                Sensor { camera, ..sensor }
            }
            Turn::Doubled => {
                let DepthCode::Metric { units_per_metre, invalid } = sensor.code else {
                    panic!("a metric code")
                };
                let code = DepthCode::Metric { units_per_metre: units_per_metre / 2.0, invalid };
                Sensor { code, baseline_m: sensor.baseline_m.map(|b| 2.0 * b), ..sensor }
            }
        }
    }

    fn frame(self, frame: Frame) -> Frame {
        let Frame { width, height, raw } = frame;
        match self {
            Turn::Mirrored => {
                let raw = (0..raw.len()).map(|i| raw[i / width * width + width - 1 - i % width]);
                Frame { width, height, raw: raw.collect() }
            }
            Turn::Transposed => {
                let raw = (0..raw.len()).map(|i| raw[i % height * width + i / height]);
                Frame { width: height, height: width, raw: raw.collect() }
            }
            Turn::Doubled => Frame { width, height, raw },
        }
    }

    /// Writes a transformed copy of the recording in `from`.
    fn recording(self, from: &Path, to: &Path) -> Recording {
        copy_tree(from, to);
        let sensor = io::open(from, &Default::default()).expect("a recording").sensor;
        let (width, height) = (sensor.camera.width, sensor.camera.height);
        let images = tree(to).into_iter().map(|(file, _)| file);
        for file in images.filter(|f| f.extension().is_some_and(|e| e == "png")) {
            let frame = io::FrameSource::new(width, height).read(&to.join(&file)).expect("a frame");
            write_depth(&to.join(&file), &self.frame(frame));
        }
        io::write_recording_file(to, &self.sensor(sensor)).expect("written");
        io::open(to, &Default::default()).expect("a recording")
    }
}

fn folder() -> tempfile::TempDir {
    tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("a folder")
}

fn sigma_of(recording: &Recording) -> SigmaModel {
    let options = CalibrateOptions { form: Some(Form::Paper), ..Default::default() };
    let measured = measure_recording(recording, &options.measure, &|_, _| ()).expect("measured");
    model_of(recording, &measured, &options).expect("a model").model.sigma
}

/// Mirrored and rotated recordings are tested in determinism.rs.
#[test]
fn a_transposed_recording_has_the_same_noise_and_a_doubled_one_has_twice_as_much() {
    let plain = sigma_of(&io::open(good(), &Default::default()).expect("a recording"));
    for (turn, scale) in [(Turn::Transposed, 1.0), (Turn::Doubled, 2.0)] {
        let folder = folder();
        let turned = sigma_of(&turn.recording(good(), &folder.path().join("rec")));
        for (z, theta) in [(1.0, 0.0), (2.0, 0.5), (3.0, 0.0), (1.5, 1.0)] {
            let ratio = turned.sigma(scale * z, theta) / plain.sigma(z, theta) / scale;
            assert!((ratio - 1.0).abs() < 1e-3, "{z} m, {theta} rad: {ratio}");
        }
    }
}

/// A wall at five distances and three tilts, with one effect.
fn with_effect(root: &Path, effect: &str) {
    let distances_m = vec![1.0, 1.5, 2.0, 3.0, 4.0];
    let poses = Grid { distances_m, tilts_rad: vec![0.0, 0.5, 0.9] }.views();
    let sigma = SigmaModel::paper();
    let mut shoot = Shoot::plain(kinect_v1(4), Target::Wall, &poses, 2, sigma.clone(), Seed(1));
    let effects = vec![Active::parse(effect).expect("an effect")];
    shoot.physics = Physics::Formula { sigma, effects };
    shoot.write(root, &|_, _| ()).expect("a recording");
}

/// The first finding against Eq. 1, scaled to a world `scale` times as large.
fn first_finding(recording: &Recording, scale: f64) -> Finding {
    let mut model = NoiseModel::paper();
    model.sensor = Some(RecordingFile::of(&recording.sensor));
    model.sigma = scaled(&model.sigma, scale);
    let found = diagnose(recording, &model, &DiagnoseOptions::default(), &|_, _| ());
    let findings = found.expect("diagnosed").diagnosis.findings;
    findings.into_iter().next().expect("a finding")
}

/// Eq. 1 in a world `scale` times as large: sigma(scale z) = scale sigma(z).
fn scaled(sigma: &SigmaModel, scale: f64) -> SigmaModel {
    let [a, b, c, d, e, f] = sigma.parameters[..] else { panic!("Eq. 1") };
    let parameters = [a * scale, b / scale, c * scale, d * scale.powf(1.0 - e), e, f];
    let mut domain = sigma.domain;
    domain.z_m = domain.z_m.map(|z| z * scale);
    let scaled = SigmaModel::published(sigma.form, &parameters, domain);
    for (z, theta) in [(1.0, 0.0), (2.0, 0.5), (3.5, 1.0)] {
        let ratio = scaled.sigma(scale * z, theta) / sigma.sigma(z, theta) / scale;
        assert!((ratio - 1.0).abs() < 1e-9, "{z} m, {theta} rad: {ratio}");
    }
    scaled
}

fn value(finding: &Finding, key: &str) -> [f64; 2] {
    ["value", "std_error"].map(|k| finding.parameters[key][k].as_f64().expect("a number"))
}

/// A centred bowl is unchanged when mirrored, transposed, or in a world twice as large.
#[test]
fn the_bowl_of_a_turned_recording_is_the_turned_bowl() {
    let folder = folder();
    let root = folder.path().join("plain");
    with_effect(&root, "radial-disparity-bias:k_px=0.1");
    let plain = first_finding(&io::open(&root, &Default::default()).expect("a recording"), 1.0);
    assert_eq!(plain.effect, Some("radial-disparity-bias"));
    let [k, error] = value(&plain, "k_px");
    assert!((k - 0.1).abs() < 0.02, "{k} px");
    for (turn, scale) in [(Turn::Mirrored, 1.0), (Turn::Transposed, 1.0), (Turn::Doubled, 2.0)] {
        let to = folder.path().join("turned");
        let turned = first_finding(&turn.recording(&root, &to), scale);
        fs::remove_dir_all(&to).expect("removed");
        assert_eq!(turned.effect, plain.effect);
        let [other, _] = value(&turned, "k_px");
        // Patches lie elsewhere in the transformed image: the same data, divided differently.
        assert!((other - k).abs() < error, "{other} px, not {k} +- {error}");
    }
}

/// Anisotropic noise swaps its axes when transposed.
#[test]
fn the_tilt_axis_of_a_transposed_recording_is_the_other_one() {
    let folder = folder();
    let root = folder.path().join("plain");
    with_effect(&root, "tilt-axis-anisotropy:ratio=2");
    let plain = first_finding(&io::open(&root, &Default::default()).expect("a recording"), 1.0);
    let turned = first_finding(&Turn::Transposed.recording(&root, &folder.path().join("t")), 1.0);
    let name = Some("tilt-axis-anisotropy");
    assert_eq!((plain.effect, turned.effect), (name, name));
    let ([a, error_a], [b, error_b]) = (value(&plain, "ratio"), value(&turned, "ratio"));
    let relative = (error_a / a).hypot(error_b / b);
    assert!((a.ln() - 2f64.ln()).abs() < 0.2, "{a}");
    assert!((a * b).ln().abs() < relative, "{a} and {b}");
}

/// Files of `out` after a run on `recording`, which has the same name each time.
fn results(
    folder: &Path,
    command: &[&str],
    environment: &[(&str, &str)],
) -> Vec<(PathBuf, Vec<u8>)> {
    let out = folder.join("out");
    let run = kinoise()
        .current_dir(folder)
        .args(command)
        .args(["-o", "out"])
        .envs(environment.iter().copied())
        .output()
        .expect("the program runs");
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let mut files = tree(&out);
    files.push(("stderr".into(), run.stderr));
    fs::remove_dir_all(&out).expect("removed");
    files
}

#[track_caller]
fn same(a: &[(PathBuf, Vec<u8>)], b: &[(PathBuf, Vec<u8>)]) {
    assert_eq!(a.len(), b.len());
    for ((name, a), (other, b)) in a.iter().zip(b) {
        assert!(name == other && a == b, "{} differs", name.display());
    }
}

/// Folders list their files in order of creation, in reverse, or by a hash.
#[test]
fn files_written_in_another_order_give_the_same_bytes() {
    let folder = folder();
    let root = folder.path().join("rec");
    let mut files = tree(good());
    let mut first = None;
    for turn in 0..3 {
        for (file, bytes) in &files {
            let path = root.join(file);
            fs::create_dir_all(path.parent().expect("a folder")).expect("made");
            fs::write(path, bytes).expect("written");
        }
        let found = results(folder.path(), &["calibrate", "rec"], &[]);
        same(first.get_or_insert_with(|| found.clone()), &found);
        fs::remove_dir_all(&root).expect("removed");
        match turn {
            0 => files.reverse(),
            // In arbitrary order: by the hash of their content.
            _ => files.sort_by_key(|(_, bytes)| io::sha256_hex(bytes)),
        }
    }
}

/// Sums over views agree in any order.
#[test]
fn views_in_another_order_give_the_same_model() {
    let mut recording = io::open(good(), &Default::default()).expect("a recording");
    let plain = sigma_of(&recording);
    recording.views.reverse();
    recording.views.swap(2, 7);
    let shuffled = sigma_of(&recording);
    for (z, theta) in [(1.0, 0.0), (2.0, 0.5), (3.0, 0.0), (1.5, 1.0)] {
        let ratio = shuffled.sigma(z, theta) / plain.sigma(z, theta);
        assert!((ratio - 1.0).abs() < 1e-9, "{z} m, {theta} rad: {ratio}");
    }
}

#[test]
fn threads_languages_and_time_zones_change_no_byte() {
    let folder = folder();
    copy_tree(good(), &folder.path().join("rec"));
    for command in ["calibrate", "diagnose"] {
        let plain = results(folder.path(), &[command, "rec", "--threads", "1"], &[]);
        let elsewhere = [
            ("LC_ALL", "de_DE.UTF-8"),
            ("LANG", "tr_TR.UTF-8"),
            ("LC_NUMERIC", "fr_FR.UTF-8"),
            ("TZ", "Asia/Kathmandu"),
        ];
        same(&plain, &results(folder.path(), &[command, "rec", "--threads", "2"], &elsewhere));
    }
}

/// A view stored twice is one measurement: the coefficients are no more certain for it.
#[test]
fn a_copy_of_a_view_is_no_other_view() {
    let folder = tempfile::tempdir().expect("a folder");
    copy_tree(good(), folder.path());
    let calibrated = || {
        let recording = io::open(folder.path(), &io::Assumed::default()).expect("a recording");
        let options = CalibrateOptions::default();
        let measured =
            measure_recording(&recording, &options.measure, &|_, _| ()).expect("measured");
        let model = model_of(&recording, &measured, &options).expect("a model");
        (measured.excluded, model.fit)
    };
    let (none, once) = calibrated();
    for view in ["0003", "0007"] {
        copy_tree(&folder.path().join(view), &folder.path().join(format!("9{view}")));
    }
    let (copies, twice) = calibrated();
    assert!(none.is_empty());
    let told: Vec<String> = copies.iter().map(|e| format!("{}: {}", e.view, e.reason)).collect();
    let same = |view: &str| format!("9{view}: it has the same frames as view {view}");
    assert_eq!(told, ["0003", "0007"].map(same));
    assert_eq!(once, twice);
}

/// A driver that delivers frames twice makes neither the measurement nor the diagnosis more certain, and its
/// copies are not taken for frozen noise.
#[test]
fn a_frame_stored_twice_is_one_frame() {
    let recording = io::open(good(), &io::Assumed::default()).expect("a recording");
    let mut doubled = recording.clone();
    for view in &mut doubled.views {
        view.depth = view.depth.iter().flat_map(|frame| [frame.clone(), frame.clone()]).collect();
    }
    let judged = |recording: &Recording| {
        let options = CalibrateOptions::default();
        let measured =
            measure_recording(recording, &options.measure, &|_, _| ()).expect("measured");
        let fit = model_of(recording, &measured, &options).expect("a model").model.fit;
        let (model, options) = (NoiseModel::paper(), DiagnoseOptions::default());
        let told = diagnose(recording, &model, &options, &|_, _| ()).expect("diagnosed").diagnosis;
        let findings = serde_json::to_string(&told.findings).expect("findings");
        (fit, findings, told.remarks)
    };
    let [(once, found, _), (twice, found_twice, remarks)] = [&recording, &doubled].map(judged);
    assert_eq!(once, twice);
    assert_eq!(found, found_twice);
    let frames: usize = recording.views.iter().map(|v| v.depth.len()).sum();
    let told =
        format!("{frames} of {} frames were left out: word for word the frame before", 2 * frames);
    assert!(remarks.contains(&told), "{remarks:?}");
}

/// They are frames of their own, numbered as in the view, also beside one that cannot be read.
#[test]
fn frames_that_are_all_alike_keep_their_numbers() {
    let recording = io::open(good(), &io::Assumed::default()).expect("a recording");
    let mut view = recording.views[0].clone();
    let frame = view.depth[0].clone();
    let lost = FrameRef::file(frame.timestamp, "lost.png".into());
    view.depth = vec![frame.clone(), lost, frame.clone(), frame];
    let bench = Workbench::new(&recording.sensor, MeasureOptions::default());
    let (_, frames) = TargetFrames::of(&view, &bench).expect("a target");
    assert_eq!(frames.map(|(number, _)| number).collect::<Vec<usize>>(), [0, 2, 3]);
}

/// A frame left from the previous view, as drivers deliver when a recording begins, is not temporal noise.
#[test]
fn a_stale_frame_is_left_out_of_the_diagnosis_and_told() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    // Among only two or three frames it is unknown which one is stale.
    shots(grid(&[1.0, 1.5, 2.0, 3.0], &[0.0, 30.0, 60.0]), 4, 1)
        .write(folder.path(), &|_, _| ())
        .expect("written");
    let recording = io::open(folder.path(), &io::Assumed::default()).expect("a recording");
    let mut stale = recording.clone();
    for view in [3, 7] {
        let frames = &mut stale.views[view].depth;
        frames[0] = FrameRef {
            timestamp: frames[0].timestamp,
            ..recording.views[view - 1].depth[0].clone()
        };
    }
    let judged = |recording: &Recording| {
        let (model, options) = (NoiseModel::paper(), DiagnoseOptions::default());
        let told = diagnose(recording, &model, &options, &|_, _| ()).expect("diagnosed").diagnosis;
        let names: Vec<_> = told.findings.iter().map(|f| (f.status, f.effect, f.axis)).collect();
        (told.verdict, names, told.remarks)
    };
    let [(right, names, _), (verdict, same, remarks)] = [&recording, &stale].map(judged);
    assert_eq!((verdict, same), (right, names));
    let told =
        remarks.iter().find(|r| r.contains("not where the other first frames")).expect("a remark");
    assert!(told.starts_with("2 of "), "{told}");
}
