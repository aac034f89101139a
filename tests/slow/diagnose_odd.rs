//! Small and odd recordings through the real program: it claims no more than it can, gives one message where
//! it can claim nothing, and the same bytes for the same seed.

use std::fs;
use std::path::{Path, PathBuf};

use kinoise::model::{FitSummary, Provenance};
use kinoise::scene::Target;
use kinoise::simulate::{Shoot, kinect_v1};
use kinoise::{NoiseModel, Seed};
use serde_json::{Value, json};

use crate::common;
use crate::common::kinoise;
use crate::rays::{OnDisk, edit, nulls, on_disk, order, repaint, views, well_formed};
use crate::raytraced::Cell;

/// A finished run.
struct Run {
    code: Option<i32>,
    stderr: String,
    out: PathBuf,
}

impl Run {
    /// Asserts a diagnosis: exit code and verdict agree, and the files are there.
    #[track_caller]
    fn said(&self) -> Value {
        let text = fs::read_to_string(self.out.join("diagnosis.json")).unwrap_or_default();
        let json: Value = serde_json::from_str(&text)
            .unwrap_or_else(|e| panic!("exit {:?}, {e}: {}", self.code, self.stderr));
        well_formed(&json);
        assert!(nulls(&json).is_empty(), "no numbers: {:?}", nulls(&json));
        let expected = i32::from(json["verdict"] == "mismatch");
        assert_eq!(self.code, Some(expected), "{} with {}", json["verdict"], self.stderr);
        for file in ["model.json", "report.html"] {
            assert!(self.out.join(file).metadata().is_ok_and(|m| m.len() > 500), "{file}");
        }
        kinoise::NoiseModel::read(&self.out.join("model.json")).expect("a model that reads");
        json
    }

    /// Asserts a failure with a single message that contains all of `needles`, and no results.
    #[track_caller]
    fn fails(&self, needles: &[&str]) {
        assert_eq!(self.code, Some(2), "{}", self.stderr);
        assert!(!self.stderr.contains("panicked"), "{}", self.stderr);
        for needle in needles {
            assert!(self.stderr.contains(needle), "\"{needle}\" is not in: {}", self.stderr);
        }
        let told = self.stderr.lines().filter(|l| l.starts_with("kinoise: ")).count();
        assert_eq!(told, 1, "one message: {}", self.stderr);
        for file in ["diagnosis.json", "model.json"] {
            assert!(!self.out.join(file).exists(), "{file} is half a result");
        }
    }
}

fn diagnose(recording: &Path, out: PathBuf, options: &[&str]) -> Run {
    let output = kinoise()
        .arg("diagnose")
        .arg(recording)
        .arg("-o")
        .arg(&out)
        .args(options)
        .output()
        .expect("the program runs");
    Run { code: output.status.code(), stderr: String::from_utf8_lossy(&output.stderr).into(), out }
}

fn with(disk: &OnDisk, options: &[&str]) -> Run {
    let taken = fs::read_dir(disk.folder.path()).expect("a folder").count();
    let out = disk.folder.path().join(format!("out{taken}"));
    let model = disk.model.to_str().expect("a plain path");
    diagnose(&disk.recording, out, &[options, &["--model", model]].concat())
}

fn run(disk: &OnDisk) -> Run {
    with(disk, &[])
}

fn clean(seed: u64, views: usize, frames: usize) -> OnDisk {
    on_disk(order(Cell::Null, "", seed, views, frames))
}

fn bowl(views: usize, frames: usize) -> OnDisk {
    on_disk(order(Cell::Single, "radial-disparity-bias", 5, views, frames))
}

#[track_caller]
fn claims_nothing(said: &Value) {
    assert_ne!(said["verdict"], "mismatch", "{:#}", said["findings"]);
}

#[test]
fn three_views_claim_nothing_that_is_not_there() {
    for seed in 31..34 {
        claims_nothing(&run(&clean(seed, 3, 3)).said());
    }
    run(&bowl(3, 3)).said();
}

#[test]
fn two_views_are_refused_with_a_remedy() {
    run(&clean(31, 2, 2)).fails(&["2 of 2 views", "at least three views"]);
}

#[test]
fn one_frame_a_view_claims_nothing_and_still_sees_a_bowl() {
    for seed in 41..44 {
        let said = run(&clean(seed, 10, 1)).said();
        claims_nothing(&said);
    }
    let said = run(&bowl(12, 1)).said();
    assert_eq!(said["findings"][0]["effect"], "radial-disparity-bias", "{:#}", said["findings"]);
}

/// Diagnosis of walls at given poses, 320 x 240 px, with the noise of Eq. 1 and nothing else.
fn posed(distances_m: &[f64], tilts_deg: &[f64]) -> Value {
    let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("a temporary folder");
    let recording = folder.path().join("recording");
    let poses = common::grid(distances_m, tilts_deg).views();
    let (sensor, seed) = (kinect_v1(2), Seed(4));
    Shoot::plain(sensor, Target::Wall, &poses, 3, common::truth(), seed)
        .write(&recording, &|_, _| ())
        .expect("written");
    let model = folder.path().join("model.json");
    NoiseModel {
        sensor: None,
        sigma: common::truth(),
        effects: Vec::new(),
        uncertainty: None,
        fit: FitSummary::default(),
        provenance: Provenance::default(),
    }
    .write(&model)
    .expect("written");
    let model = model.to_str().expect("a plain path");
    diagnose(&recording, folder.path().join("out"), &["--model", model]).said()
}

/// Asserts that nothing is found but quantisation steps, which the model does not know.
#[track_caller]
fn only_steps(said: &Value) {
    for f in said["findings"].as_array().expect("findings") {
        let steps = f["effect"] == "disparity-quantisation";
        assert!(steps || f["status"] == "not-identifiable", "{f:#}");
    }
}

#[test]
fn one_distance_claims_nothing_about_distance() {
    only_steps(&posed(&[1.2], &[0.0, 15.0, 30.0, 40.0, 50.0]));
}

#[test]
fn views_square_to_the_axis_claim_nothing_about_tilt() {
    only_steps(&posed(&[0.8, 1.2, 1.6, 2.0, 2.5, 3.0], &[0.0]));
}

/// A target of 60 x 60 px in every view.
#[test]
fn a_tiny_target_claims_nothing() {
    let disk = clean(51, 8, 3);
    for view in views(&disk.recording) {
        let notes = json!({"roi": [130, 90, 189, 149]});
        fs::write(view.join("view.json"), notes.to_string()).expect("written");
    }
    claims_nothing(&run(&disk).said());
}

/// Two of eight views have no depth: they are reported by name and the rest is used.
#[test]
fn views_without_depth_are_left_out_and_said_so() {
    let disk = clean(52, 8, 3);
    repaint(&disk.recording, |view, frame| {
        if view == 2 || view == 5 {
            frame.raw.fill(0);
        }
    });
    let said = run(&disk).said();
    claims_nothing(&said);
    assert_eq!(said["views"].as_array().expect("views").len(), 6);
    let remarks = said["remarks"].to_string();
    for view in [2, 5] {
        let path = &views(&disk.recording)[view];
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        assert!(remarks.contains(&name), "{name} is not in {remarks}");
    }
    repaint(&disk.recording, |_, frame| frame.raw.fill(0));
    run(&disk).fails(&["0 of 8 views", "at least three views"]);
}

#[test]
fn a_model_without_numbers_is_refused() {
    for (number, needle) in [("\"nothing\"", "a"), ("null", "a"), ("1e999", "model")] {
        let disk = clean(53, 3, 1);
        edit(&disk.model, |text| {
            let mut json: Value = serde_json::from_str(text).expect("JSON");
            json["sigma"]["parameters"]["a"]["value"] = "HERE".into();
            json.to_string().replace("\"HERE\"", number)
        });
        run(&disk).fails(&[needle]);
    }
}

/// A sigma of zero cannot be compared with: it is refused, or everything is a mismatch; no panic and no NaN.
#[test]
fn a_model_without_noise_is_refused_or_everything_is_amiss() {
    let disk = clean(53, 6, 2);
    edit(&disk.model, |text| {
        let mut json: Value = serde_json::from_str(text).expect("JSON");
        for name in ["a", "b", "d"] {
            json["sigma"]["parameters"][name]["value"] = 0.0.into();
        }
        format!("{json:#}\n")
    });
    let run = run(&disk);
    if run.code == Some(2) {
        run.fails(&["sigma"]);
    } else {
        assert_eq!(run.said()["verdict"], "mismatch");
    }
}

/// A model states its camera: one of 640 x 480 px does not apply to 320 x 240.
#[test]
fn a_model_of_another_resolution_is_refused_or_told_of() {
    let disk = clean(54, 6, 2);
    edit(&disk.model, |text| {
        let mut json: Value = serde_json::from_str(text).expect("JSON");
        for key in ["width", "height", "fx", "fy", "cx", "cy"] {
            let n = &mut json["sensor"][key];
            *n = match n.as_u64() {
                Some(whole) => (2 * whole).into(),
                None => (2.0 * n.as_f64().expect("a number")).into(),
            };
        }
        format!("{json:#}\n")
    });
    let run = run(&disk);
    if run.code == Some(2) {
        run.fails(&["640"]);
    } else {
        let said = run.said();
        let told = format!("{}{}", said["remarks"], run.stderr);
        assert!(told.contains("640"), "nobody says that the model is of 640 px: {told}");
    }
}

/// Without a baseline that of a Kinect is assumed, or the recording is refused; no panic.
#[test]
fn without_a_baseline_it_is_said_what_is_assumed() {
    let disk = clean(55, 6, 2);
    let bare = |text: &str| {
        let mut json: Value = serde_json::from_str(text).expect("JSON");
        let sensor = if json["sensor"].is_object() { &mut json["sensor"] } else { &mut json };
        sensor.as_object_mut().expect("an object").remove("baseline_m");
        format!("{json:#}\n")
    };
    edit(&disk.recording.join("recording.json"), bare);
    edit(&disk.model, bare);
    let run = run(&disk);
    if run.code == Some(2) {
        run.fails(&["baseline"]);
    } else {
        let said = run.said();
        let told = format!("{}{}", said["remarks"], run.stderr);
        assert!(told.contains("baseline"), "nobody says which baseline is assumed: {told}");
    }
}

/// One set with something in every layer.
#[test]
fn the_same_seed_gives_the_same_bytes_on_one_thread_and_two() {
    let disk = bowl(8, 3);
    let bytes = |threads: &str, seed: &str| {
        let run = with(&disk, &["--threads", threads, "--seed", seed]);
        assert_eq!(run.code, Some(1), "{}", run.stderr);
        ["diagnosis.json", "model.json"].map(|f| fs::read(run.out.join(f)).expect("written"))
    };
    let one = bytes("1", "7");
    assert!(one == bytes("2", "7"), "two threads differ from one");
    assert!(one == bytes("2", "7"), "the same seed differs from itself");
    let effect = |bytes: &[u8]| -> Value {
        serde_json::from_slice::<Value>(bytes).expect("JSON")["findings"][0]["effect"].clone()
    };
    assert_eq!(effect(&one[0]), effect(&bytes("2", "8")[0]), "the seed decides no name");
}

#[test]
fn exit_codes_are_nought_one_and_two() {
    assert_eq!(run(&clean(31, 8, 3)).code, Some(0));
    assert_eq!(run(&bowl(8, 3)).code, Some(1));
    let nowhere = PathBuf::from("/nowhere/at/all");
    let out = tempfile::tempdir().expect("a temporary folder");
    diagnose(&nowhere, out.path().join("out"), &[]).fails(&["/nowhere/at/all"]);
}

/// The extended model can be simulated from and corrected with.
#[test]
fn the_extended_model_simulates_and_corrects() {
    for effect in ["radial-disparity-bias", "column-banding", "vignetting", "seam"] {
        let cell = if effect == "seam" { Cell::Outside } else { Cell::Single };
        let disk = on_disk(order(cell, effect, 5, 10, 2));
        let found = run(&disk);
        assert_eq!(found.said()["verdict"], "mismatch", "{effect}");
        let model = found.out.join("model.json");
        let folder = disk.folder.path();
        let recording = disk.recording.to_str().expect("a plain path");
        for (command, arguments) in [("simulate", vec!["--like", recording]), ("correct", vec![])] {
            let out = folder.join(command);
            let mut program = kinoise();
            program.arg(command);
            if command == "simulate" {
                program.arg(&out);
            } else {
                program.arg(recording).arg("-o").arg(&out);
            }
            let output = program.args(arguments).arg("--model").arg(&model).output().expect("runs");
            let told = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "{effect}, {command}: {told}");
            assert_eq!(views(&out).len(), 10, "{effect}, {command}");
        }
    }
}
