//! `simulate --like`: the views of a recording simulated again, and calibrated to the same model.

use kinoise::io::{Assumed, open};
use kinoise::measure::MeasureOptions;
use kinoise::simulate::{Physics, Shoot, plan_like};
use kinoise::{CalibrateOptions, Calibration, Form, Measurements, Recording, Seed, SigmaModel};

use crate::common;

fn calibrated(recording: &Recording) -> (Measurements, Calibration) {
    let options = CalibrateOptions {
        measure: MeasureOptions { seed: Seed(1), ..MeasureOptions::default() },
        form: Some(Form::Paper),
        ..CalibrateOptions::default()
    };
    let views =
        kinoise::measure_recording(recording, &options.measure, &|_, _| ()).expect("measured");
    let calibration = kinoise::model_of(recording, &views, &options).expect("fitted");
    (views, calibration)
}

fn shot_again(
    recording: &Recording,
    sigma: &SigmaModel,
    seed: u64,
) -> (tempfile::TempDir, Recording) {
    let (views, excluded) = plan_like(recording, 0.0, Seed(seed));
    assert!(excluded.is_empty(), "{excluded:?}");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let root = folder.path().join("twin");
    let shoot = Shoot {
        sensor: recording.sensor.clone(),
        views,
        physics: Physics::Formula { sigma: sigma.clone(), effects: Vec::new() },
        infrared: false,
        seed: Seed(seed),
    };
    shoot.write(&root, &|_, _| ()).expect("written");
    let twin = open(&root, &Assumed::default()).expect("opens");
    (folder, twin)
}

/// The real Herrera recording: all 39 views come back with their planes, regions, stamps and pixels, and
/// calibrate to the model they were simulated with.
///
/// The surface is compared at 20 points inside the views' range with the twin's own 95 % intervals: if each
/// covers the truth 95 % of the time and the points are correlated (three free parameters), fewer than 12
/// of 20 have a false alarm probability below 1 %; here the seed is fixed.
#[test]
fn a_real_recording_shot_again_calibrates_to_its_model() {
    let Some(data) = common::data("herrera-kinect-v1/recording") else { return };
    let recording = open(&data, &Assumed::default()).expect("opens");
    let (views, calibration) = calibrated(&recording);
    let truth = &calibration.model.sigma;
    let (_folder, twin) = shot_again(&recording, truth, 3);
    assert_eq!(twin.views.len(), 39);
    for (a, b) in recording.views.iter().zip(&twin.views) {
        assert_eq!((&a.name, &a.notes.region), (&b.name, &b.notes.region));
        let stamps = |v: &kinoise::View| v.depth.iter().map(|f| f.timestamp).collect::<Vec<_>>();
        assert_eq!(stamps(a), stamps(b));
    }
    let (again, fitted) = calibrated(&twin);
    assert!(again.excluded.is_empty(), "{:?}", again.excluded);
    for (a, b) in views.views.iter().zip(&again.views) {
        let off = (a.axis_distance_m - b.axis_distance_m).abs();
        assert!(off < 0.001 + 0.001 * a.axis_distance_m, "{}: {off} m", a.name);
        // The real planes were fitted to bent residuals; the difference is less than the bend.
        assert!((a.theta_rad - b.theta_rad).abs() < 0.005, "{}", a.name);
    }
    let mut inside = 0;
    for z in [0.6, 1.0, 1.5, 2.2, 3.0] {
        for theta in [0.0, 0.3, 0.6, 0.9] {
            let [low, high] = fitted.model.sigma.interval(z, theta, 0.95);
            let sigma = truth.sigma(z, theta);
            inside += u32::from((low..=high).contains(&sigma));
            assert!((fitted.model.sigma.sigma(z, theta) / sigma - 1.0).abs() < 0.02, "{z} {theta}");
        }
    }
    assert!(inside >= 12, "{inside} of 20 inside the 95 % interval");
}

/// A reference distance of the twin is that of its own plane, not of the real one.
#[test]
fn a_twin_has_reference_distances_of_its_own_planes() {
    let Some(data) = common::data("herrera-kinect-v1/recording") else { return };
    let recording = open(&data, &Assumed::default()).expect("opens");
    let (views, _) = plan_like(&recording, 0.0, Seed(1));
    let given = |v: &&kinoise::View| v.notes.reference_distance_m.is_some();
    let wanted = recording.views.iter().filter(given).count();
    let with: Vec<_> = views.iter().filter(|v| v.notes.reference_distance_m.is_some()).collect();
    assert_eq!(with.len(), wanted);
    for view in with {
        let own = view.bench.plane.depth(0.0, 0.0);
        assert_eq!(view.notes.reference_distance_m, Some(own), "{}", view.name);
    }
}

/// The layout refuses an uncertainty that is not below its distance: a twin drops both rather than one, and a
/// recording without references has none to write again.
#[test]
fn a_twin_has_a_distance_above_its_uncertainty_or_neither() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let simulated = |arguments: &str| {
        let mut command = common::kinoise();
        command.current_dir(folder.path()).arg("simulate").args(arguments.split(' '));
        let done = command.output().expect("started");
        let said = String::from_utf8_lossy(&done.stderr).into_owned();
        assert!(done.status.success(), "{said}");
        said
    };
    simulated("wall --wall-target --distances 1 --tilts 0 --shrink 4");
    let said = simulated("again --like wall --reference-error 0.01");
    assert!(said.contains("--reference-error has no effect"), "{said}");
    let mut recording = open(&folder.path().join("wall"), &Assumed::default()).expect("opens");
    let notes = &mut recording.views[0].notes;
    (notes.reference_distance_m, notes.reference_uncertainty_m) = (Some(1.0), Some(0.9));
    let kept = (0..20).filter(|&seed| {
        let (views, _) = plan_like(&recording, 1.0, Seed(seed));
        let notes = &views[0].notes;
        let [distance, uncertainty] = [notes.reference_distance_m, notes.reference_uncertainty_m];
        assert_eq!(distance.is_some(), uncertainty.is_some(), "seed {seed}");
        assert!(distance.is_none_or(|d| d > 0.9), "seed {seed}: {distance:?}");
        distance.is_some()
    });
    // Half of the readings of 1 m, off by a metre, are above 0.9 m.
    let kept = kept.count();
    assert!((1..20).contains(&kept), "{kept} of 20");
}
