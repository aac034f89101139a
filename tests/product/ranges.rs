//! A sensor that stores the range as depth, in front of a board that fills most of a near image.

use std::path::Path;

use kinoise::calibrate::{CalibrateOptions, measure, model_of};
use kinoise::camera::Camera;
use kinoise::diagnose::{DiagnoseOptions, Diagnosed, Finding, Status, Verdict, diagnose};
use kinoise::effects::Active;
use kinoise::io::{Assumed, open};
use kinoise::model::Effect;
use kinoise::scene::{Board, Target};
use kinoise::sensors::SensorKind;
use kinoise::simulate::{Grid, Physics, Shoot, kinect_v1};
use kinoise::view::{Recording, Sensor};
use kinoise::{NoiseModel, Seed, SigmaModel};
use serde_json::json;

/// Fifteen near and far views of a board in front of a wall; `share` of the range replaces the depth.
fn recording(folder: &Path, share: f64) -> Recording {
    let poses =
        Grid { distances_m: vec![0.9, 1.0, 1.2, 2.4, 3.0], tilts_rad: vec![0.0, 0.4, 0.7] }.views();
    let sigma = SigmaModel::paper();
    let board = Target::Board(Board { width_m: 1.2, height_m: 0.9 });
    let mut shoot = Shoot::plain(kinect_v1(2), board, &poses, 3, sigma.clone(), Seed(5));
    shoot.views.iter_mut().for_each(|view| view.bench.wall_m = Some(4.5));
    let ranges = Active::parse(&format!("range-not-depth:share={share}")).expect("an effect");
    shoot.physics = Physics::Formula { sigma, effects: vec![ranges] };
    shoot.write(folder, &|_, _| ()).expect("written");
    open(folder, &Assumed::default()).expect("a recording")
}

fn diagnosis(recording: &Recording, model: &NoiseModel) -> Diagnosed {
    diagnose(recording, model, &DiagnoseOptions::default(), &|_, _| ()).expect("diagnosed")
}

/// Read as depths, most of the nine near views have no plane at all: the range bends the board by 15 % of its
/// distance towards its corners. Read as ranges all fifteen do, and nothing else is wrong with them.
#[test]
fn views_that_are_flat_as_ranges_alone_tell_ranges() {
    let folder = tempfile::tempdir().expect("a folder");
    let recording = recording(folder.path(), 1.0);
    let done = diagnosis(&recording, &NoiseModel::paper());
    let said = &done.diagnosis;
    // The simulated noise is that of the stored depth: a little larger than the model's.
    let large = |f: &&Finding| f.status != Status::NotIdentifiable && !f.minor;
    let told = said.findings.iter().filter(large);
    assert_eq!(told.map(|f| f.effect).collect::<Vec<_>>(), [Some("range-not-depth")]);
    assert_eq!(said.after.verdict, Verdict::Match, "{:?}", said.after.remaining);
    assert_eq!(said.views.len(), 15);
    // The held-out gain includes that of reading as ranges: the stored means are bent.
    let aside = said.heldout.as_ref().expect("views kept aside");
    assert!(aside.is_clear, "{:?}", aside.gain_interval);
    let nearest = &said.views[0];
    assert!(nearest.bowl_px_after < 0.1 * nearest.bowl_px_before, "{nearest:?}");
    // A model with the ranges finds the near boards, and no further findings.
    let again = diagnosis(&recording, &done.model).diagnosis;
    assert_eq!((again.verdict, again.views.len()), (Verdict::Match, 15), "{:?}", again.findings);
}

/// A wall keeps a plane in every view, however bent: it is read exactly, not by a formula about the stored depth,
/// which leaves a share of its own. A Kinect v2 by its name has no disparity to err in.
#[test]
fn a_wall_whose_views_all_have_a_plane_tells_ranges() {
    let folder = tempfile::tempdir().expect("a folder");
    let camera = Camera::centred(256, 212, 183.0);
    let sensor = Sensor { name: "kinect-v2".into(), camera, kind: None, ..kinect_v1(2) };
    let poses = Grid { distances_m: vec![0.9, 1.4, 2.0, 2.8], tilts_rad: vec![0.0, 0.4] }.views();
    let sigma = SigmaModel::paper();
    let mut shoot = Shoot::plain(sensor, Target::Wall, &poses, 3, sigma.clone(), Seed(6));
    let ranges = Active::parse("range-not-depth:share=1").expect("an effect");
    shoot.physics = Physics::Formula { sigma, effects: vec![ranges] };
    shoot.write(folder.path(), &|_, _| ()).expect("written");
    let recording = open(folder.path(), &Assumed::default()).expect("a recording");
    assert_eq!(recording.sensor.kind, Some(SensorKind::TimeOfFlight));
    let said = diagnosis(&recording, &NoiseModel::paper()).diagnosis;
    assert_eq!((said.views.len(), said.findings[0].effect), (8, Some("range-not-depth")));
    assert_eq!(said.after.verdict, Verdict::Match, "{:?}", said.after.remaining);
}

/// A model that takes depths for ranges is wrong in every view, but no view is lost.
#[test]
fn a_model_that_is_wrong_about_ranges_finds_all_targets() {
    let folder = tempfile::tempdir().expect("a folder");
    let recording = recording(folder.path(), 0.0);
    let share = json!({"share": 1.0}).as_object().cloned().expect("an object");
    let ranges = Effect { id: "range-not-depth".into(), parameters: share, ..Effect::default() };
    let model = NoiseModel { effects: vec![ranges], ..NoiseModel::paper() };
    let said = diagnosis(&recording, &model).diagnosis;
    assert_eq!((said.views.len(), said.findings[0].effect), (15, Some("range-not-depth")));
    let share = said.findings[0].value("share").expect("a share");
    assert!((share + 1.0).abs() < 0.1, "{share}");
}

/// `calibrate` reads depths, and says that the views it left out would be flat as ranges.
#[test]
fn a_calibration_says_what_its_views_are_flat_as() {
    let folder = tempfile::tempdir().expect("a folder");
    let recording = recording(folder.path(), 1.0);
    let options = CalibrateOptions::default();
    let measured = measure(&recording, &options.measure, &|_, _| ()).expect("measured");
    let warnings = model_of(&recording, &measured, &options).expect("a model").warnings;
    assert!(warnings[0].contains("taken for ranges"), "{warnings:?}");
}

/// A mixture of range and depth is reported with its share, from the views that are flat enough.
#[test]
fn a_part_of_the_range_is_no_range() {
    let folder = tempfile::tempdir().expect("a folder");
    let said = diagnosis(&recording(folder.path(), 0.8), &NoiseModel::paper()).diagnosis;
    assert_eq!(said.findings[0].effect, Some("range-not-depth"));
    let share = said.findings[0].value("share").expect("a share");
    assert!((share - 0.8).abs() < 0.1, "{share}");
}
