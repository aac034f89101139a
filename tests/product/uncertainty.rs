//! Uncertainty budgets: numbers recomputed from the formulas of the GUM, and coverage of the intervals.

use std::path::Path;

use kinoise::io::{Assumed, open, write_recording_file, write_view_notes};
use kinoise::measure::MeasureOptions;
use kinoise::scene::Target;
use kinoise::simulate::{Grid, Shoot, kinect_v1};
use kinoise::view::{IntrinsicsUncertainty, TargetSize, ViewNotes};
use kinoise::{Seed, SigmaModel, measure_recording};
use serde_json::{Value, json};

use crate::common::{copy_tree, good, kinoise};

const REFERENCE_U_M: f64 = 1e-3;
const FLATNESS_M: f64 = 4e-4;
const FOCAL_U_PX: f64 = 0.5;
const CENTRE_U_PX: [f64; 2] = [0.8, 0.6];

fn json_of(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).expect("read")).expect("JSON")
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("{key} of {value}"))
}

fn near(value: f64, expected: f64, what: &str) {
    assert!(
        (value - expected).abs() <= 1e-9 * expected.abs() + 1e-15,
        "{what}: {value} for {expected}"
    );
}

/// Calibrates the good recording with all uncertainties stated; returns the JSON result and stderr.
fn stated(folder: &Path, more: impl Fn(&mut Value)) -> (Value, String) {
    let recording = folder.join("recording");
    copy_tree(good(), &recording);
    let about = recording.join("recording.json");
    let mut sensor = json_of(&about);
    sensor["intrinsics_uncertainty"] =
        json!({"fx": FOCAL_U_PX, "fy": FOCAL_U_PX, "cx": CENTRE_U_PX[0], "cy": CENTRE_U_PX[1]});
    std::fs::write(&about, sensor.to_string()).expect("written");
    for entry in std::fs::read_dir(&recording).expect("read").flatten() {
        let path = entry.path().join("view.json");
        if entry.path().is_dir() {
            let text = std::fs::read_to_string(&path).unwrap_or("{}".into());
            let mut notes: Value = serde_json::from_str(&text).expect("JSON");
            notes["target"] = json!({"width_m": 1.0, "height_m": 0.8, "flatness_m": FLATNESS_M});
            notes["reference_distance_m"] = json!(1.99);
            notes["reference_uncertainty_m"] = json!(REFERENCE_U_M);
            notes["temperature_c"] = json!(21.5);
            more(&mut notes);
            std::fs::write(&path, notes.to_string()).expect("written");
        }
    }
    let out = folder.join("out");
    let run = kinoise().args(["calibrate", "--json"]).arg(&recording).arg("-o").arg(&out).output();
    let run = run.expect("started");
    let said = String::from_utf8_lossy(&run.stderr).into_owned();
    assert!(run.status.success(), "{said}");
    (serde_json::from_slice(&run.stdout).expect("JSON"), said)
}

/// Every row of a budget from the pose and the statements, by the GUM's formulas.
#[test]
fn budgets_are_the_gums() {
    let folder = tempfile::tempdir().expect("a folder");
    let (told, said) = stated(folder.path(), |_| ());
    assert!(!said.contains("unknown key"), "{said}");
    let model = json_of(&folder.path().join("out/model.json"));
    let about = json_of(&folder.path().join("recording/recording.json"));
    assert_eq!(model["sensor"]["intrinsics_uncertainty"], about["intrinsics_uncertainty"]);
    let uncertainty = &model["uncertainty"];
    assert!(uncertainty["statement"].as_str().expect("words").contains("ISO 10360-13"));
    assert_eq!(uncertainty["not_stated"], json!([]));
    assert_eq!(uncertainty["conditions"]["temperature_c"], json!([21.5, 21.5]));
    assert!(uncertainty["conditions"]["ambient_lux"].is_null());
    let (fx, fy) = (number(&about, "fx"), number(&about, "fy"));
    let views = uncertainty["views"].as_array().expect("views");
    let measured = told["views"].as_array().expect("views");
    assert_eq!(views.len(), measured.len());
    let mut tilted = 0;
    for (view, m) in views.iter().zip(measured) {
        assert_eq!(view["view"], m["view"]);
        let budget = &view["distance_error"];
        let rows = budget["components"].as_array().expect("rows");
        let kinds: Vec<&str> = rows.iter().map(|r| r["type"].as_str().expect("a type")).collect();
        assert_eq!(kinds, ["A", "B", "B", "B", "B"]);
        let z = number(m, "axis_distance_m");
        let (theta, azimuth) = (number(m, "theta_rad"), number(m, "azimuth_rad"));
        let parts: Vec<f64> = rows.iter().map(|r| number(r, "contribution_m")).collect();
        near(number(budget, "value_m"), z - 1.99, "the error");
        near(parts[1], REFERENCE_U_M, "reference");
        near(parts[2], FLATNESS_M / 12f64.sqrt(), "flatness");
        // Steps of 0.2 mm under noise of millimetres.
        assert!(parts[3] < 1e-9, "{parts:?}");
        let [du, dv] = [CENTRE_U_PX[0] / fx * azimuth.cos(), CENTRE_U_PX[1] / fy * azimuth.sin()];
        near(parts[4], z * theta.tan() * (du * du + dv * dv).sqrt(), "principal point");
        tilted += usize::from(parts[4] > 1e-3);
        let combined = parts.iter().map(|u| u * u).sum::<f64>().sqrt();
        near(number(budget, "combined_m"), combined, "u");
        near(number(budget, "expanded_m"), 2.0 * combined, "U");
        // Only the scatter has finite degrees of freedom: nu u^4/u_A^4.
        let freedom = number(&rows[0], "degrees_of_freedom") * (combined / parts[0]).powi(4);
        near(number(budget, "degrees_of_freedom"), freedom, "Welch and Satterthwaite");
        near(number(m, "off_reference_expanded_m"), 2.0 * combined, "the summary");

        let sigma = number(m, "sigma_m");
        let budget = &view["sigma"];
        let parts: Vec<f64> = budget["components"]
            .as_array()
            .expect("rows")
            .iter()
            .map(|r| number(r, "contribution_m"))
            .collect();
        near(number(budget, "value_m"), sigma, "sigma");
        near(parts[0], sigma / (2.0 * number(m, "n_effective")).sqrt(), "scatter");
        let flat = (sigma * sigma - FLATNESS_M * FLATNESS_M / 12.0).sqrt();
        near(parts[1], (sigma - flat) / 3f64.sqrt(), "flatness");
        let tilt = &budget["components"][2];
        let [across, down] = [azimuth.cos().powi(2) / fx, azimuth.sin().powi(2) / fy];
        let u = FOCAL_U_PX * theta.sin() * theta.cos() * (across * across + down * down).sqrt();
        near(number(tilt, "standard_uncertainty"), u, "tilt");
        near(parts[2], (u * number(tilt, "sensitivity")).abs(), "tilt");
    }
    assert!(tilted > 0, "no view is tilted enough to show the principal point");
    let page = std::fs::read_to_string(folder.path().join("out/report.html")).expect("a page");
    for says in ["Uncertainty", "reference distance (B)", "VDI/VDE 2634", "21.5 °C"] {
        assert!(page.contains(says), "{says}");
    }
    let table =
        std::fs::read_to_string(folder.path().join("out/measurements.csv")).expect("a table");
    let (header, rows) = table.split_once('\n').expect("a header");
    let column = header.split(',').position(|c| c == "distance_error_expanded_m").expect("there");
    let first = rows.lines().next().expect("a row").split(',').nth(column).expect("a field");
    near(first.parse().expect("a number"), number(&views[0]["distance_error"], "expanded_m"), "U");
}

/// Without the reference's uncertainty there is no budget of the error; without any statement, no budget.
#[test]
fn what_is_not_stated_is_listed() {
    let folder = tempfile::tempdir().expect("a folder");
    let forget = |notes: &mut Value| {
        notes.as_object_mut().expect("an object").remove("reference_uncertainty_m");
    };
    stated(folder.path(), forget);
    let uncertainty = &json_of(&folder.path().join("out/model.json"))["uncertainty"];
    assert_eq!(uncertainty["not_stated"], json!(["reference_uncertainty_m"]));
    assert!(uncertainty["views"][0]["distance_error"].is_null());
    assert!(uncertainty["views"][0]["sigma"]["expanded_m"].as_f64().expect("a number") > 0.0);

    let out = folder.path().join("bare");
    let run = kinoise().arg("calibrate").arg(good()).arg("-o").arg(&out).output().expect("started");
    assert!(run.status.success());
    assert!(json_of(&out.join("model.json")).get("uncertainty").is_none());
}

/// Eighty walls with a tape of 0.5 mm: the planes scatter by their standard errors, and U with k = 2 covers
/// the error of a sensor without bias.
#[test]
fn the_intervals_hold_the_truth() {
    const VIEWS: usize = 80;
    const TAPE_M: f64 = 0.0005;
    let folder = tempfile::tempdir().expect("a folder");
    // Tilted off the axis, so that the plane's distance on the axis is not the mean depth.
    let grid = Grid { distances_m: vec![2.0; VIEWS / 2], tilts_rad: vec![0.0, 0.5] };
    let mut sensor = kinect_v1(8);
    sensor.intrinsics_uncertainty =
        Some(IntrinsicsUncertainty { cx: Some(1e-6), ..Default::default() });
    let shoot =
        Shoot::plain(sensor.clone(), Target::Wall, &grid.views(), 3, SigmaModel::paper(), Seed(17));
    shoot.write(folder.path(), &|_, _| ()).expect("written");
    write_recording_file(folder.path(), &sensor).expect("written");
    let mut rng = Seed(4).stream("tape");
    for view in &shoot.views {
        let off: f64 = rand_distr::Distribution::sample(&rand_distr::StandardNormal, &mut rng);
        let notes = ViewNotes {
            reference_distance_m: Some(2.0 + TAPE_M * off),
            reference_uncertainty_m: Some(TAPE_M),
            ..ViewNotes::default()
        };
        write_view_notes(&folder.path().join(&view.name), &notes).expect("written");
    }
    let recording = open(folder.path(), &Assumed::default()).expect("a recording");
    let measured =
        measure_recording(&recording, &MeasureOptions::default(), &|_, _| ()).expect("measured");
    assert_eq!(measured.views.len(), VIEWS);
    let scaled: Vec<f64> =
        measured.views.iter().map(|v| (v.axis_distance_m - 2.0) / v.axis_std_error_m).collect();
    let chi = (scaled.iter().map(|e| e * e).sum::<f64>() / VIEWS as f64).sqrt();
    // One standard error of the root of a chi-square over 80 is 8 %.
    assert!((0.76..1.24).contains(&chi), "the planes scatter by {chi} of their standard errors");
    let held = measured.views.iter().filter(|v| {
        let budget = v.distance_budget.as_ref().expect("a budget");
        budget.value_m.abs() < budget.expanded_m
    });
    // 95 % of 80; fewer than 70 have a probability of 1 in 400.
    let held = held.count();
    assert!(held >= 70, "{held} of {VIEWS}");
    assert!(held < VIEWS, "intervals that always hold are too wide");
}

#[test]
fn statements_are_written_and_read_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let notes = ViewNotes {
        target: Some(TargetSize { flatness_m: Some(2e-4), ..TargetSize::of(0.6, 0.4) }),
        reference_distance_m: Some(1.2),
        reference_uncertainty_m: Some(3e-4),
        ..ViewNotes::default()
    };
    copy_tree(good(), folder.path());
    write_view_notes(&folder.path().join("0000"), &notes).expect("written");
    let recording = open(folder.path(), &Assumed::default()).expect("a recording");
    let back = recording.views.iter().find(|v| v.name == "0000").expect("the view");
    assert_eq!(back.notes, notes);
}
