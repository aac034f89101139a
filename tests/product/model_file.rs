//! Models that must be refused, and what a model states about its own reliability.

use std::path::Path;

use kinoise::measure::{Cell, SigmaRow, SigmaTable};
use kinoise::model::{Direction, PAPER_EQ1, compare_forms, sort_out};
use kinoise::simulate::Physics;
use kinoise::{Form, NoiseModel, Seed, SigmaModel};
use rand_distr::{Distribution, StandardNormal};
use serde_json::{Value, json};

use crate::common;

/// A valid model.json, fitted by the program to a table.
fn model_json(folder: &Path) -> Value {
    let table = folder.join("table.csv");
    let rows = (0..20).map(|i| {
        let z = 1.0 + 0.15 * f64::from(i);
        format!("{z},0.2,{}\n", truth(z, 0.2) * (1.0 + 0.02 * f64::from(i % 3 - 1)))
    });
    let text: String = std::iter::once("z_m,theta_rad,sigma_m\n".to_string()).chain(rows).collect();
    std::fs::write(&table, text).expect("written");
    let out = folder.join("out");
    let run = common::kinoise().arg("fit").arg(&table).arg("-o").arg(&out).output().expect("runs");
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let text = std::fs::read_to_string(out.join("model.json")).expect("read");
    serde_json::from_str(&text).expect("JSON")
}

fn truth(z: f64, theta: f64) -> f64 {
    Form::Paper.spec().sigma(&PAPER_EQ1, z, theta)
}

/// A single wrong value in an otherwise valid file; the message names the file and the fault.
#[test]
fn a_model_with_one_lie_is_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let good = model_json(folder.path());
    let path = folder.path().join("lie.json");
    let write = |value: &Value| std::fs::write(&path, value.to_string()).expect("written");
    write(&good);
    NoiseModel::read(&path).expect("the good model is read");
    let lies: [(&str, Value, &str); 13] = [
        // Positive at both ends of the range, negative in between.
        ("/sigma/parameters/c/value", json!(2.5), "not positive"),
        ("/sigma/parameters/a/value", json!(-1.0), "not positive"),
        ("/sigma/parameters/d/value", json!(-1.0), "not positive"),
        ("/sigma/parameters/e/value", json!(1e6), "not positive"),
        ("/sigma/parameters/f/value", json!(0.1), "pole"),
        ("/sigma/covariance/0/0", json!(-1e-9), "semi-definite"),
        ("/sigma/covariance/0/1", json!(1.0), "semi-definite"),
        ("/sigma/parameters/b/std_error", json!(-1.0), "std_error"),
        ("/fit/degrees_of_freedom", json!(0.5), "degrees_of_freedom"),
        ("/fit/degrees_of_freedom", json!(-10.0), "degrees_of_freedom"),
        ("/fit/residual", json!("sideways"), "sideways"),
        ("/sigma/valid/z_m", json!([3.0, 1.0]), "valid range"),
        ("/sigma/valid/theta_rad", json!([0.0, 1.58]), "pi/2"),
    ];
    for (pointer, lie, says) in lies {
        let mut value = good.clone();
        if pointer.ends_with("c/value") {
            value["sigma"]["parameters"]["a"]["value"] = json!(-1e-5);
        }
        *value.pointer_mut(pointer).unwrap_or_else(|| panic!("{pointer}")) = lie;
        write(&value);
        let message = NoiseModel::read(&path).expect_err(pointer).to_string();
        assert!(message.contains("lie.json") && message.contains(says), "{pointer}: {message}");
    }
}

/// A fit does not dip below zero between two distances either.
#[test]
fn a_fit_stays_positive_between_its_distances() {
    let sigma = |z: f64| (0.004 * (z - 2.5).powi(2) - 0.0005).max(1e-4);
    let rows = [1.0, 1.3, 1.6, 3.4, 3.7, 4.0]
        .into_iter()
        .flat_map(|z| [0.0, 0.1].map(|theta_rad| (z, theta_rad)))
        .enumerate()
        .map(|(view, (z_m, theta_rad))| SigmaRow {
            z_m,
            theta_rad,
            sigma_m: sigma(z_m),
            n_effective: Some(500.0),
            view,
        })
        .collect();
    let table = SigmaTable { rows };
    for form in [Form::Paper, Form::Nguyen] {
        let fitted = sort_out(&table).fit(form).expect("fitted");
        assert_eq!(fitted.model().fault(), None, "{form}");
        assert!(fitted.remarks.join("\n").contains("a is held"), "{form}: {:?}", fitted.remarks);
    }
}

/// The depth noise of a perpendicular model is 1/cos(theta) times its sigma.
#[test]
fn a_perpendicular_model_gives_axial_noise() {
    let axial = SigmaModel::paper();
    let across = SigmaModel { direction: Direction::Perpendicular, ..SigmaModel::paper() };
    for theta in [0.0f64, 0.5, 1.0, 1.3] {
        let ratio = across.axial_sigma(2.0, theta) / axial.axial_sigma(2.0, theta);
        assert!((ratio * theta.cos() - 1.0).abs() < 1e-12, "{theta}");
        assert_eq!(axial.axial_sigma(2.0, theta), axial.sigma(2.0, theta));
    }
    // Beyond the domain it is held at the edge, and finite.
    assert_eq!(across.axial_sigma(2.0, 1.57), across.axial_sigma(2.0, across.domain.theta_rad[1]));
}

/// Noise simulated from a perpendicular model is measured as that model says.
#[test]
fn a_simulation_from_a_perpendicular_model_measures_as_one() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let root = folder.path().join("recording");
    let mut shots = common::shots(common::grid(&[1.5], &[60.0]), 4, 7);
    let Physics::Formula { sigma, .. } = &mut shots.physics else { panic!("by formula") };
    sigma.direction = Direction::Perpendicular;
    shots.write(&root, &|_, _| ()).expect("written");
    let recording = kinoise::io::open(&root, &Default::default()).expect("opens");
    let measured =
        kinoise::measure_recording(&recording, &Default::default(), &|_, _| ()).expect("measured");
    let view = &measured.views[0];
    let mean = |ratio: &dyn Fn(&Cell) -> f64| {
        view.cells.iter().map(ratio).sum::<f64>() / view.cells.len() as f64
    };
    let theta = 60f64.to_radians();
    let along = mean(&|c| c.spread.spatial_m * theta.cos() / truth(c.z_m, theta));
    // Across the plane, an error along the ray is cos(theta) of it on the axis, and z0/z times that where the
    // ray meets the plane at depth z (kinoise::residual).
    let across = mean(&|c| c.spread.perpendicular_m * (c.z_m / 1.5) / truth(c.z_m, theta));
    assert!((along - 1.0).abs() < 0.03 && (across - 1.0).abs() < 0.03, "{along} {across}");
}

/// Held-out distances are predicted as well as claimed: the mean squared error in units of the predicted
/// variance, which includes the surface's own uncertainty, is one.
#[test]
fn predictions_know_how_sure_they_are() {
    let mut rng = Seed(41).stream("held out");
    let mut chi2 = Vec::new();
    // The scatter is estimated from the table: if n explained it, the estimated excess over n could only err
    // upwards.
    for _ in 0..200 {
        let mut rows = Vec::new();
        for i in 0..8 {
            for theta_rad in [0.0, 0.2, 0.4, 0.6, 0.8, 1.0] {
                let z_m = 1.0 + 0.5 * f64::from(i);
                let draw: f64 = StandardNormal.sample(&mut rng);
                let sigma_m = truth(z_m, theta_rad) * (1.0 + 0.1 * draw);
                rows.push(SigmaRow {
                    z_m,
                    theta_rad,
                    sigma_m,
                    n_effective: Some(5000.0),
                    view: rows.len(),
                });
            }
        }
        let scores = compare_forms(&SigmaTable { rows });
        chi2.extend(scores.iter().filter(|s| s.form == Form::Nguyen).map(|s| s.chi2));
    }
    let mean = chi2.iter().sum::<f64>() / chi2.len() as f64;
    println!("chi2 of predictions {mean:.3} over {}", chi2.len());
    assert_eq!(chi2.len(), 200);
    assert!((0.85..1.15).contains(&mean), "{mean}");
}

#[test]
fn two_views_are_no_calibration() {
    let rows = (0..12)
        .map(|i| {
            let z_m = if i < 6 { 1.0 } else { 2.5 } + 0.1 * f64::from(i % 6);
            SigmaRow {
                z_m,
                theta_rad: 0.4,
                sigma_m: truth(z_m, 0.4),
                n_effective: Some(300.0),
                view: (i / 6) as usize,
            }
        })
        .collect();
    let fitted = sort_out(&SigmaTable { rows }).fit(Form::Paper).expect("fitted");
    let words = fitted.remarks.join("\n");
    assert!(words.contains("no calibration: a surface through 2 views"), "{words}");
}

/// A real recording (33 rooms and boards) whose sigmas follow no smooth surface.
#[test]
fn a_poor_fit_says_so_in_words() {
    let Some(root) = common::data("kinect-v1-second-unit") else { return };
    let out = tempfile::tempdir().expect("a temporary folder");
    let run = common::kinoise()
        .arg("calibrate")
        .arg(&root)
        .arg("-o")
        .arg(out.path())
        .args(["--intrinsics", "585,585,319.5,239.5", "--raw-disparity", "3.3309,-0.0030711"])
        .output()
        .expect("runs");
    let stderr = String::from_utf8_lossy(&run.stderr);
    println!("{stderr}");
    assert!(stderr.contains("the fit is poor"), "{stderr}");
    let page = std::fs::read_to_string(out.path().join("report.html")).expect("read");
    assert!(page.contains("The fit does not describe this sensor"));
}

/// Commands print folders, so users give folders.
#[test]
fn a_folder_stands_for_the_model_in_it() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("model.json");
    NoiseModel::paper().write(&file).expect("written");
    let both = [folder.path(), &file].map(|path| NoiseModel::read(path).expect("a model"));
    assert_eq!(both[0], both[1]);
    std::fs::remove_file(&file).expect("removed");
    let why = NoiseModel::read(folder.path()).expect_err("there is none").to_string();
    assert!(why.contains("model.json"), "{why}");
}
