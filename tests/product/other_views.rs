//! Diagnosis against a model learnt from other views of the sensor: an unchanged sensor is no mismatch, and a
//! changed one is.

use kinoise::diagnose::{DiagnoseOptions, Finding, Verdict, diagnose};
use kinoise::effects::Active;
use kinoise::scene::{PATCH_SIDE_M, Print, Target, WHITE};
use kinoise::simulate::{Grid, Physics, Scenery, Shoot, kinect_v1, plan_grid};
use kinoise::terms::Axis;
use kinoise::{
    CalibrateOptions, NoiseModel, Recording, Seed, SigmaModel, io, measure_recording, model_of,
};
use tempfile::TempDir;

/// A bowl three times the noise of so small a sensor: with a deeper one the wall is not flat.
const SENSOR: [&str; 2] = ["radial-disparity-bias:k_px=0.05", "vignetting:growth=0.4"];

/// Fifteen views of a white wall by a small Kinect with these effects.
fn views(effects: &[&str], seed: u64) -> (TempDir, Recording) {
    views_of(Print::Plain(WHITE), effects, seed)
}

/// Same of a wall with this print.
fn views_of(print: Print, effects: &[&str], seed: u64) -> (TempDir, Recording) {
    let folder = tempfile::tempdir().expect("a folder");
    let distances_m = vec![1.0, 1.4, 2.0, 2.8, 4.0];
    let poses = Grid { distances_m, tilts_rad: vec![0.0, 0.3, 0.6] }.views();
    let sigma = SigmaModel::paper();
    let scenery = Scenery { print, ..Scenery::bare(Target::Wall) };
    let effects = effects.iter().map(|e| Active::parse(e).expect("an effect")).collect();
    let shoot = Shoot {
        sensor: kinect_v1(4),
        views: plan_grid(&poses, &scenery, 4, true, Seed(seed)),
        physics: Physics::Formula { sigma, effects },
        infrared: matches!(print, Print::Patches(_)),
        seed: Seed(seed),
    };
    shoot.write(folder.path(), &|_, _| ()).expect("written");
    let recording = io::open(folder.path(), &io::Assumed::default()).expect("opened");
    (folder, recording)
}

/// A model calibrated and extended by a diagnosis on views of the sensor.
fn learnt() -> NoiseModel {
    let (_folder, recording) = views(&SENSOR, 1);
    let options = CalibrateOptions::default();
    let measured = measure_recording(&recording, &options.measure, &|_, _| ()).expect("measured");
    let model = model_of(&recording, &measured, &options).expect("a fit").model;
    let here = DiagnoseOptions { calibrated_here: true, ..DiagnoseOptions::default() };
    let found = diagnose(&recording, &model, &here, &|_, _| ()).expect("diagnosed");
    assert!(found.model.effects.iter().any(|e| e.id == "radial-disparity-bias"));
    let shaped = || found.model.effects.iter().filter(|e| !e.shape.is_empty());
    assert!(shaped().all(|e| e.between_views.len() == e.shape.len()));
    // These views come from one sensor that never changes: the injected effects are the same in all.
    let first = |e: &kinoise::model::Effect| e.between_views[0];
    let injected = shaped().filter(|e| SENSOR.iter().any(|s| s.starts_with(&e.id)));
    let scatter: Vec<_> = injected.map(|e| (e.id.clone(), first(e))).collect();
    assert!(scatter.iter().all(|(_, share)| *share < 0.3), "{scatter:?}");
    let searched = found.model.fit.searched.expect("told");
    assert_eq!((searched.views, searched.references), (15, 0));
    found.model
}

#[test]
fn a_sensor_is_itself_and_a_changed_one_is_not() {
    let model = learnt();
    let judge = |effects: &[&str], seed| {
        let (_folder, recording) = views(effects, seed);
        let options = DiagnoseOptions::default();
        let told = diagnose(&recording, &model, &options, &|_, _| ()).expect("diagnosed");
        (told.diagnosis.verdict, told.diagnosis.findings)
    };
    for seed in 2..5 {
        let (verdict, found) = judge(&SENSOR, seed);
        let names: Vec<_> = found.iter().map(|f| (f.effect, f.statistic, f.axis)).collect();
        assert_eq!(verdict, Verdict::Match, "seed {seed}: {names:?}");
    }
    let [bowl, vignetting] = SENSOR;
    for (change, effects) in [
        ("radial-disparity-bias", vec!["radial-disparity-bias:k_px=0.075", vignetting]),
        ("vignetting", vec![bowl, "vignetting:growth=0.8"]),
        ("row-noise", vec![bowl, vignetting, "row-noise:sigma_px=0.03"]),
        ("spatial-correlation", vec![bowl, vignetting, "spatial-correlation:length_px=3"]),
    ] {
        let (verdict, found) = judge(&effects, 7);
        assert_eq!(verdict, Verdict::Mismatch, "{change}");
        let names: Vec<_> = found.iter().filter_map(|f| f.effect).collect();
        assert!(names.contains(&change), "{change}: {names:?}");
    }
}

/// What follows the light of a printed target is known again, though the light is known only once all views are
/// read.
#[test]
fn noise_that_follows_the_print_is_known_again() {
    let paper = NoiseModel::paper();
    let dark = ["intensity-dependent-noise:exponent=0.5"];
    let judge = |model: &NoiseModel, effects: &[&str], seed| {
        let (_folder, recording) = views_of(Print::Patches(PATCH_SIDE_M), effects, seed);
        let options = DiagnoseOptions::default();
        diagnose(&recording, model, &options, &|_, _| ()).expect("diagnosed")
    };
    let named = |found: &[Finding]| found.iter().filter_map(|f| f.effect).collect::<Vec<_>>();
    let first = judge(&paper, &dark, 1);
    assert!(named(&first.diagnosis.findings).contains(&"intensity-dependent-noise"));
    for seed in 2..5 {
        let again = judge(&first.model, &dark, seed).diagnosis;
        assert_eq!(again.verdict, Verdict::Match, "seed {seed}: {:?}", named(&again.findings));
    }
    let changed = judge(&first.model, &[], 5).diagnosis;
    assert_eq!(changed.verdict, Verdict::Mismatch);
    assert_eq!(changed.findings[0].axis, Axis::Intensity);
}

/// Against a model whose sigma is too large, only sigma is off: views are weighted relative to it, and after
/// a refit white noise is white. Regression test: unadjusted weights made views count four times too much.
#[test]
fn a_sigma_that_was_too_large_leaves_nothing_once_it_is_refitted() {
    let paper = NoiseModel::paper();
    let parameters = paper.sigma.parameters.iter().enumerate();
    let twice =
        parameters.map(|(k, p)| if matches!(k, 0 | 1 | 3) { 2.0 * p } else { *p }).collect();
    let model =
        NoiseModel { sigma: SigmaModel { parameters: twice, ..paper.sigma.clone() }, ..paper };
    for seed in 2..5 {
        let (_folder, recording) = views(&[], seed);
        let options = DiagnoseOptions::default();
        let told = diagnose(&recording, &model, &options, &|_, _| ()).expect("diagnosed").diagnosis;
        let names: Vec<_> = told.findings.iter().map(|f| (f.status, f.axis)).collect();
        assert_eq!(told.verdict, Verdict::Mismatch, "seed {seed}: {names:?}");
        let remains: Vec<_> = told.after.remaining.iter().map(|r| &r.words).collect();
        assert_eq!(told.after.verdict, Verdict::Match, "seed {seed}: {remains:?}");
    }
}
