//! How a correction changes distances, judged by references, if any, and by planes alone.

use std::path::Path;

use serde_json::Value;

use crate::common::kinoise;

/// Frontal and tilted views of a board that reaches beyond the image in the nearest of them.
const VIEWS: [&str; 14] = [
    "--shrink",
    "4",
    "--frames",
    "8",
    "--reference-error",
    "0.001",
    "--azimuths",
    "0,90",
    "--tilts",
    "0,30,50",
    "--distances",
    "0.9,1.2,1.6,2,2.6,3.2",
    "--board",
    "1.6,1.2",
];

#[track_caller]
fn run(folder: &Path, arguments: &[&str]) {
    let output = kinoise().current_dir(folder).args(arguments).output().expect("the program runs");
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code().is_some_and(|code| code < 2), "{arguments:?}: {stderr}");
}

fn findings(folder: &Path) -> Vec<Value> {
    let text = std::fs::read(folder.join("told/diagnosis.json")).expect("written");
    let mut diagnosis: Value = serde_json::from_slice(&text).expect("JSON");
    let findings = diagnosis["findings"].take();
    let told = |f: &Value| f["status"] != "not-identifiable";
    findings.as_array().expect("a list").iter().filter(|f| told(f)).cloned().collect()
}

/// Root mean square of measured minus reference distance, m.
fn off(folder: &Path, recording: &str) -> f64 {
    run(folder, &["calibrate", recording, "-o", "measured", "--force", "-q"]);
    let path = folder.join("measured/measurements.csv");
    let mut table = csv::Reader::from_path(path).expect("a table");
    let headers = table.headers().expect("a header").clone();
    let column = |name: &str| headers.iter().position(|h| h == name).expect("a column");
    let [view, measured, reference] =
        ["view", "axis_distance_m", "reference_distance_m"].map(column);
    let mut views = std::collections::BTreeMap::new();
    for row in table.records().map(|r| r.expect("a row")) {
        let number = |k: usize| row[k].parse::<f64>().expect("a number");
        views.insert(row[view].to_string(), number(measured) - number(reference));
    }
    (views.values().map(|o| o * o).sum::<f64>() / views.len() as f64).sqrt()
}

fn diagnosed(seed: &str, effects: &[&str]) -> (tempfile::TempDir, Vec<Value>) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut arguments = vec!["simulate", "shot", "--seed", seed, "-q"];
    arguments.extend(VIEWS);
    arguments.extend(effects.iter().flat_map(|e| ["--effect", e]));
    run(folder.path(), &arguments);
    run(folder.path(), &["diagnose", "shot", "-o", "told", "-q"]);
    let found = findings(folder.path());
    (folder, found)
}

/// Planes cannot determine a bowl's constant. References can, so that a corrected recording agrees with them.
#[test]
fn a_corrected_bowl_leaves_references_where_they_are() {
    let (folder, found) = diagnosed("5", &["radial-disparity-bias:k_px=0.2"]);
    let names: Vec<&Value> = found.iter().map(|f| &f["effect"]).collect();
    assert_eq!(names, ["radial-disparity-bias"]);
    run(folder.path(), &["correct", "shot", "-m", "told/model.json", "-o", "corrected", "-q"]);
    let [before, after] = ["shot", "corrected"].map(|name| off(folder.path(), name));
    assert!(before > 0.006, "the bowl moves the planes: {before} m");
    assert!(after < 0.002, "{before} m before, {after} m after");
}

/// The same together with a scale error, which the bowl's undetermined constant must not hide.
#[test]
fn a_scale_is_told_beside_a_bowl() {
    let effects = ["radial-disparity-bias:k_px=0.2", "depth-scale:scale=1.01"];
    let (folder, found) = diagnosed("6", &effects);
    let scale = found.iter().find(|f| f["effect"] == "depth-scale").expect("told");
    let value = scale["parameters"]["scale"]["value"].as_f64().expect("a number");
    assert!((value - 1.01).abs() < 0.002, "{value}");
    run(folder.path(), &["correct", "shot", "-m", "told/model.json", "-o", "corrected", "-q"]);
    let [before, after] = ["shot", "corrected"].map(|name| off(folder.path(), name));
    assert!(before > 0.008 && after < 0.002, "{before} m before, {after} m after");
}

/// The plane of a bent board is off its measured centre: that is no law of the distance.
#[test]
fn a_bent_board_is_no_wrong_scale() {
    let (_folder, found) = diagnosed("7", &["target-bow"]);
    assert_eq!(found[0]["effect"], "target-bow");
    for law in ["depth-scale", "disparity-offset", "thermal-drift"] {
        assert!(found.iter().all(|f| f["effect"] != law), "{law}");
    }
}

/// No loss of pixels is found where the board's edge leaves the image at an angle.
#[test]
fn a_board_beyond_the_picture_loses_nothing() {
    for seed in ["8", "9", "10"] {
        let (_folder, found) = diagnosed(seed, &[]);
        assert_eq!(found, [] as [Value; 0], "seed {seed}");
    }
}
