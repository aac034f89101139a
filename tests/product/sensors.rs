//! Kinds of cameras: presets of `--sensor`, and which effects a diagnosis considers for which.

use kinoise::diagnose::{DiagnoseOptions, diagnose};
use kinoise::effects::{Active, CATALOGUE};
use kinoise::io::{Assumed, open};
use kinoise::scene::Target;
use kinoise::sensors::{PRESETS, SensorKind};
use kinoise::simulate::{Grid, Physics, Shoot, kinect_v1};
use kinoise::{NoiseModel, Seed, SigmaModel};
use serde_json::Value;

use crate::common::kinoise;

/// diagnosis.json of a wall with disparity steps of an eighth of a pixel and pixel locking of 0.05 px, by a
/// camera declared to be of this kind.
fn diagnosed(kind: Option<SensorKind>) -> String {
    let folder = tempfile::tempdir().expect("a folder");
    let poses =
        Grid { distances_m: vec![1.0, 1.5, 2.2, 3.0], tilts_rad: vec![0.0, 0.4, 0.7] }.views();
    let mut sigma = SigmaModel::paper();
    sigma.parameters[0] *= 0.3;
    sigma.parameters[1] *= 0.3;
    let mut sensor = kinect_v1(4);
    sensor.kind = kind;
    let mut shoot = Shoot::plain(sensor, Target::Wall, &poses, 2, sigma.clone(), Seed(6));
    let effects = ["disparity-quantisation:step_px=0.125", "pixel-locking:amplitude_px=0.05"]
        .map(|e| Active::parse(e).expect("an effect"));
    shoot.physics = Physics::Formula { sigma: sigma.clone(), effects: effects.into() };
    shoot.write(folder.path(), &|_, _| ()).expect("written");
    let recording = open(folder.path(), &Assumed::default()).expect("a recording");
    assert_eq!(recording.sensor.kind, kind);
    let model = NoiseModel { sigma, ..NoiseModel::paper() };
    let found = diagnose(&recording, &model, &DiagnoseOptions::default(), &|_, _| ());
    serde_json::to_string(&found.expect("diagnosed").diagnosis).expect("JSON")
}

#[test]
fn a_time_of_flight_camera_has_no_disparity() {
    let matched = diagnosed(Some(SensorKind::StructuredLight));
    assert!(matched.contains("disparity-quantisation"), "{matched}");
    let flown = diagnosed(Some(SensorKind::TimeOfFlight));
    let impossible = CATALOGUE.iter().map(|e| e.card());
    let impossible =
        impossible.filter(|c| !c.applies_to(Some(SensorKind::TimeOfFlight))).map(|c| c.id);
    for id in impossible.chain(["disparity-phase"]) {
        assert!(!flown.contains(&format!("\"{id}\"")), "{id}: {flown}");
    }
}

/// A plain folder of a Kinect's images, without a description, read with `--sensor`.
#[test]
fn a_preset_stands_for_what_a_folder_does_not_say() {
    let folder = tempfile::tempdir().expect("a folder");
    let made = folder.path().join("made");
    let grid = Grid { distances_m: vec![1.0, 1.5, 2.0, 3.0], tilts_rad: vec![0.0, 0.5] };
    let sensor = kinect_v1(4);
    let shoot = Shoot::plain(sensor, Target::Wall, &grid.views(), 1, SigmaModel::paper(), Seed(2));
    shoot.write(&made, &|_, _| ()).expect("written");
    let images = folder.path().join("images");
    std::fs::create_dir(&images).expect("made");
    for view in &shoot.views {
        let from = made.join(&view.name).join("depth");
        let image = std::fs::read_dir(from).expect("read").flatten().next().expect("an image");
        std::fs::copy(image.path(), images.join(format!("{}.png", view.name))).expect("copied");
    }
    let out = folder.path().join("out");
    let mut command = kinoise();
    command.args(["calibrate", "--sensor", "kinect-v1", "--units-per-metre", "5000"]);
    let run = command.arg(&images).arg("-o").arg(&out).output().expect("started");
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let model: Value =
        serde_json::from_slice(&std::fs::read(out.join("model.json")).expect("read"))
            .expect("JSON");
    let sensor = &model["sensor"];
    assert_eq!((sensor["fx"].as_f64(), sensor["baseline_m"].as_f64()), (Some(145.0), Some(0.075)));
    assert_eq!(sensor["kind"], "structured-light");
    assert_eq!(sensor["sensor"], "Kinect for Xbox 360");
    // Sigma in px is sigma f b/z^2 of the cell.
    let table = std::fs::read_to_string(out.join("measurements.csv")).expect("read");
    let mut lines = table.lines().map(|l| l.split(',').collect::<Vec<_>>());
    let header = lines.next().expect("a header");
    let column = |name: &str| header.iter().position(|c| *c == name).expect("a column");
    let columns = ["sigma_px", "sigma_m", "z_m"].map(column);
    let mut rows = 0;
    for line in lines {
        let [px, sigma, z] = columns.map(|c| line[c].parse::<f64>().expect("a number"));
        let expected = sigma * 145.0 * 0.075 / (z * z);
        assert!((px / expected - 1.0).abs() < 1e-9, "{px} {expected}");
        rows += 1;
    }
    assert!(rows > 0);

    // A recording that describes itself is not overridden.
    let run = kinoise().args(["calibrate", "--sensor", "kinect-v1", "-o", "x"]).arg(&made).output();
    let run = run.expect("started");
    let said = String::from_utf8_lossy(&run.stderr).into_owned();
    assert!(!run.status.success() && said.contains("--sensor"), "{said}");
    let run =
        kinoise().args(["calibrate", "--sensor", "kinect-v3", "-o", "x"]).arg(&images).output();
    let said = String::from_utf8_lossy(&run.expect("started").stderr).into_owned();
    assert!(PRESETS.iter().all(|p| said.contains(p.id)), "{said}");
}
