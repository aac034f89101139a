//! What a model claims is tested against the recording: an effect that the recording lacks is a mismatch.

use std::path::Path;

use serde_json::{Value, json};

use crate::common::kinoise;

/// Boards in front of a wall, so that their edges are informative too.
const VIEWS: [&str; 13] = [
    "simulate",
    "--shrink",
    "4",
    "--frames",
    "8",
    "--wall",
    "1",
    "--reference-error",
    "0.001",
    "--distances",
    "0.8,1.2,1.6,2,2.5,3",
    "--tilts",
    "0,30,60",
];

fn run(folder: &Path, arguments: &[&str]) {
    let output = kinoise().current_dir(folder).args(arguments).output().expect("the program runs");
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code().is_some_and(|code| code < 2), "{arguments:?}: {stderr}");
}

/// Diagnoses a recording with the clean sensor's model plus this effect. Returns the verdict, and whether a
/// finding says that the model has too much.
fn told(folder: &Path, recording: &str, id: &str, parameters: &Value) -> (String, bool) {
    let text = std::fs::read(folder.join("calibrated/model.json")).expect("a model");
    let mut model: Value = serde_json::from_slice(&text).expect("JSON");
    model["effects"] = json!([{ "id": id, "parameters": parameters }]);
    std::fs::write(folder.join("model.json"), model.to_string()).expect("written");
    run(folder, &["diagnose", recording, "-m", "model.json", "-o", "told", "--force", "-q"]);
    let text = std::fs::read(folder.join("told/diagnosis.json")).expect("a diagnosis");
    let diagnosis: Value = serde_json::from_slice(&text).expect("JSON");
    let findings = diagnosis["findings"].as_array().expect("a list");
    let contradicted =
        |f: &Value| f["physics"].as_str().is_some_and(|p| p.contains("out of the model"));
    (diagnosis["verdict"].as_str().expect("a word").into(), findings.iter().any(contradicted))
}

/// Tests each claim on a recording without the effect, and on one with it.
#[test]
fn a_model_that_has_too_much_of_an_effect_is_contradicted_and_a_true_one_is_not() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = folder.path();
    run(at, &[&VIEWS[..], &["clean"]].concat());
    run(at, &["calibrate", "clean", "-o", "calibrated", "-q"]);
    let claims = [
        ("heavy-tails", json!({"fraction": 0.05, "scale": 8.0}), true),
        ("heavy-tails", json!({"fraction": 1.0, "scale": 100.0}), false),
        ("temporal-correlation", json!({"rho": 0.4}), true),
        ("frozen-noise", json!({"fraction": 0.4}), true),
        ("spatial-correlation", json!({"length_px": 7.0}), true),
        ("fixed-pattern-noise", json!({"sigma_px": 0.05}), true),
        ("row-noise", json!({"sigma_px": 0.05}), true),
        ("frame-jitter", json!({"sigma_px": 0.1}), true),
        ("disparity-quantisation", json!({"step_px": 0.125}), true),
        ("disparity-quantisation", json!({"step_px": 4.0}), false),
        ("depth-rounding", json!({"step_m": 0.01}), true),
        ("edge-mixing", json!({"width_px": 2.0}), true),
        ("edge-mixing", json!({"width_px": 32.0}), false),
        ("occlusion-shadow", json!({"share": 1.0}), true),
        ("range-dropout", json!({"share": 1.0, "z50_m": 2.8, "width_m": 0.2}), true),
        ("grazing-dropout", json!({"share": 1.0, "theta50_deg": 60.0, "width_deg": 4.0}), true),
        ("depth-scale", json!({"scale": 1.02}), true),
        ("depth-scale", json!({"scale": 2.0}), false),
        ("disparity-offset", json!({"offset_px": 1.0}), true),
    ];
    for (k, (id, parameters, usable)) in claims.iter().enumerate() {
        let clean = told(at, "clean", id, parameters);
        assert_eq!(clean, ("mismatch".into(), true), "{id} {parameters} on a clean recording");
        let values = parameters.as_object().expect("an object").iter();
        let values: Vec<String> = values.map(|(name, v)| format!("{name}={v}")).collect();
        let effect = format!("{id}:{}", values.join(","));
        // Where the effect leaves no visible plane there is nothing to compare.
        if *usable {
            let recording = format!("true{k}");
            run(at, &[&VIEWS[..], &[&recording, "--effect", &effect, "--seed", "5"]].concat());
            assert!(!told(at, &recording, id, parameters).1, "{effect} is in the recording");
        }
    }
}

/// The model calibrated on a recording.
fn calibrated(at: &Path, recording: &str) -> Value {
    run(at, &["calibrate", recording, "-o", "calibrated", "-q"]);
    let text = std::fs::read(at.join("calibrated/model.json")).expect("a model");
    serde_json::from_slice(&text).expect("JSON")
}

/// The model's file with another level of sigma.
fn with_sigma_times(model: &Value, factor: f64) -> String {
    let mut changed = model.clone();
    for name in ["a", "b"] {
        let value = &mut changed["sigma"]["parameters"][name]["value"];
        *value = json!(value.as_f64().expect("a number") * factor);
    }
    changed.to_string()
}

/// On few small views, too few for the search: a sigma far too small or too large, and errors of many times
/// the noise.
#[test]
fn a_model_that_is_far_off_is_no_match() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = folder.path();
    let views = ["--frames", "2", "--distances", "1,1.5,2,3", "--tilts", "0,30"];
    run(at, &[&["simulate", "clean", "--shrink", "8"], &views[..]].concat());
    let model = calibrated(at, "clean");
    for factor in [0.001, 0.01, 0.02, 0.05, 20.0, 1000.0] {
        let changed = with_sigma_times(&model, factor);
        std::fs::write(at.join("calibrated/model.json"), changed).expect("written");
        let (verdict, _) = told(at, "clean", "vignetting", &json!({"growth": 0.0}));
        assert_eq!(verdict, "mismatch", "sigma times {factor}");
    }
    std::fs::write(at.join("calibrated/model.json"), model.to_string()).expect("written");
    for (id, parameters) in [
        ("pixel-locking", json!({"amplitude_px": 0.5})),
        ("slope-noise", json!({"sigma_lateral_px": 10.0})),
    ] {
        assert_eq!(told(at, "clean", id, &parameters).0, "mismatch", "{id} {parameters}");
    }
    assert_eq!(told(at, "clean", "vignetting", &json!({"growth": 0.0})).0, "match");
}

/// Two of six views have eight times the noise, and nothing tells them from the others: no term of the extended
/// model takes the mismatch away.
#[test]
fn noise_without_a_law_is_a_mismatch_of_the_extended_model_too() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = folder.path();
    let views = ["--frames", "2", "--distances", "1,1.5,2", "--tilts", "0,30"];
    run(at, &[&["simulate", "first", "--shrink", "8"], &views[..]].concat());
    let noisy = with_sigma_times(&calibrated(at, "first"), 8.0);
    std::fs::write(at.join("noisy.json"), noisy).expect("written");
    run(at, &[&["simulate", "calm", "-m", "calibrated/model.json"], &views[..]].concat());
    run(at, &[&["simulate", "noisy", "-m", "noisy.json"], &views[..]].concat());
    for view in ["0000", "0003"] {
        std::fs::remove_dir_all(at.join("calm").join(view)).expect("removed");
        std::fs::rename(at.join("noisy").join(view), at.join("calm").join(view)).expect("moved");
    }
    let (verdict, _) = told(at, "calm", "vignetting", &json!({"growth": 0.0}));
    let text = std::fs::read(at.join("told/diagnosis.json")).expect("a diagnosis");
    let diagnosis: Value = serde_json::from_slice(&text).expect("JSON");
    assert_eq!([&verdict[..], diagnosis["after"]["verdict"].as_str().unwrap()], ["mismatch"; 2]);
}
