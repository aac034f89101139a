//! Degenerate geometry: points on a line, one pixel, a plane seen edge on, no depth. The answer is an error,
//! `None`, or a finite number.

use std::f64::consts::{FRAC_PI_2, PI};
use std::fs;
use std::path::Path;

use kinoise::evaluate::{Delta, Spread, align, evaluate};
use kinoise::io::{self, encode_png16, write_recording_file};
use kinoise::plane::{Effort, Plane, Points, RansacOptions, fit_affine_robust, ransac_plane};
use kinoise::stats::{clopper_pearson, measure_correlation, median, quantile, student_quantile};
use kinoise::trajectory::Pose;
use kinoise::view::Region;
use kinoise::{
    Camera, DepthCode, Form, Frame, NoiseModel, Seed, Sensor, SigmaModel, measure_recording,
};
use nalgebra::{Isometry3, Vector3};
use proptest::prelude::*;

use crate::common::kinoise;

/// A plane seen edge on, or without a distance, has no depth: never a wrong one.
#[test]
fn a_plane_at_the_pole_is_finite_or_says_that_it_is_not() {
    for theta in [0.0, FRAC_PI_2 - 1e-12, FRAC_PI_2, FRAC_PI_2 + 1e-9, PI] {
        for z in [0.0, 1e-300, 1.0, 1e300] {
            let plane = Plane::tilted(z, theta, 0.3);
            if plane.is_finite() {
                let numbers = [plane.theta(), plane.azimuth(), plane.inverse_depth(0.1, -0.1)];
                assert!(numbers.iter().all(|v| v.is_finite()), "{z} m, {theta} rad: {numbers:?}");
                assert!((0.0..=FRAC_PI_2).contains(&plane.theta()));
            }
        }
    }
    assert!(!Plane::tilted(0.0, 0.0, 0.0).is_finite());
    assert!(!Plane::new(Vector3::zeros()).is_finite());
}

#[test]
fn every_sigma_is_a_number_everywhere() {
    let models = [SigmaModel::paper(), SigmaModel::nguyen(), SigmaModel::khoshelham()];
    for (model, z) in models.iter().flat_map(|m| [0.0, 1e-300, 1.0, 1e300].map(|z| (m, z))) {
        for theta in [0.0, 1.39, FRAC_PI_2, PI] {
            let all = [model.sigma(z, theta), model.axial_sigma(z, theta)];
            let [low, high] = model.interval(z, theta, 0.95);
            assert!(all.iter().all(|s| s.is_finite() && *s > 0.0), "{z} m, {theta} rad: {all:?}");
            assert!(low > 0.0 && high.is_finite() && low <= high, "{low} {high}");
        }
    }
}

#[test]
fn statistics_of_nothing_and_of_one_number() {
    assert_eq!(quantile(&mut [], 0.5), None);
    assert_eq!((median(&mut [3.0]), quantile(&mut [3.0], 1.0)), (3.0, Some(3.0)));
    assert!(Spread::of(&[]).is_none());
    for (k, n) in [(0, 0), (0, 1), (1, 1)] {
        let [low, high] = clopper_pearson(k, n, 0.95);
        assert!((0.0..=1.0).contains(&low) && low <= high && high <= 1.0, "{k}/{n}: {low} {high}");
    }
    for freedom in [1.0, 1e-3, 1e300] {
        assert!(student_quantile(0.95, freedom) > 0.0, "{freedom}");
    }
    for image in [vec![], vec![0.5], vec![f32::NAN; 9], vec![1.0; 9]] {
        let c = measure_correlation(&image, 3);
        assert!(c.sum_of_squares.is_finite() && c.sum_of_squares >= 1.0, "{image:?}");
    }
}

fn pose(stamp: f64, at: [f64; 3]) -> Pose {
    Pose { stamp, world_from_camera: Isometry3::translation(at[0], at[1], at[2]) }
}

/// A path along a line leaves the rotation about it undetermined; a standing one leaves all of it.
#[test]
fn trajectories_on_a_line_and_in_one_place_have_errors() {
    for step in [[0.0; 3], [0.1, 0.0, 0.0], [1e-200, 0.0, 0.0], [1e7, 1e7, 0.0]] {
        let path: Vec<Pose> =
            (0..9).map(|k| pose(f64::from(k) / 30.0, step.map(|s| s * f64::from(k)))).collect();
        let errors = evaluate(&path, &path, Delta::Frames(1)).expect("evaluated");
        let far = 1.0 + 8.0 * (step[0] + step[1]);
        assert!(errors.ate.error.rmse < 1e-7 * far, "{step:?}: {} m", errors.ate.error.rmse);
    }
}

/// Kilometres along and centimetres across: the rotation about the path is still determined.
#[test]
fn a_long_straight_path_beside_itself_has_no_error() {
    let elsewhere = Isometry3::new(Vector3::new(3.0, -2.0, 1.0), Vector3::new(0.5, 1.0, -2.0));
    for (far, across) in [(2204.0, 0.1), (1e4, 0.02), (1e5, 1.0)] {
        let places = [[0.1, 0.2, 0.0], [0.8, 1.24, 0.0], [0.1, 0.9, 0.0], [0.5, 0.0, far]];
        let at = |p: [f64; 3]| [across * p[0], across * p[1], p[2]];
        let truth: Vec<Pose> = (0..).zip(places).map(|(k, p)| pose(f64::from(k), at(p))).collect();
        let moved = |p: &Pose| Pose { world_from_camera: elsewhere * p.world_from_camera, ..*p };
        let estimate: Vec<Pose> = truth.iter().map(moved).collect();
        let errors = evaluate(&truth, &estimate, Delta::Frames(1)).expect("evaluated");
        assert!(errors.ate.error.max < 1e-3 * across, "{far}: {} m", errors.ate.error.max);
    }
}

/// Writes a described recording of one view with two identical frames.
fn recording(root: &Path, sensor: &Sensor, frame: &Frame) {
    fs::create_dir_all(root.join("a")).expect("made");
    fs::write(root.join("a/0.png"), encode_png16(frame).expect("encoded")).expect("written");
    fs::write(root.join("a/depth.txt"), "0 0.png\n1 0.png\n").expect("written");
    write_recording_file(root, sensor).expect("written");
}

fn sensor(width: usize, height: usize) -> Sensor {
    Sensor {
        name: "tiny".into(),
        serial: None,
        mode: None,
        camera: Camera::centred(width, height, width.max(height) as f64),
        baseline_m: Some(0.075),
        code: DepthCode::Metric { units_per_metre: 1000.0, invalid: 0 },
        intrinsics_uncertainty: None,
        kind: None,
    }
}

#[test]
fn images_of_a_pixel_a_row_or_nothing_are_refused_by_every_command() {
    for (width, height) in [(1, 1), (640, 1), (1, 480), (2, 2), (3, 4)] {
        for raw in [0, 1500, u16::MAX] {
            let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("a folder");
            let frame = Frame { width, height, raw: vec![raw; width * height] };
            recording(&folder.path().join("rec"), &sensor(width, height), &frame);
            for line in ["calibrate rec -o out", "diagnose rec -o out", "metrics rec -o out"] {
                let run = kinoise()
                    .current_dir(folder.path())
                    .args(line.split(' '))
                    .timeout(std::time::Duration::from_secs(20))
                    .output()
                    .expect("the program runs");
                let stderr = String::from_utf8_lossy(&run.stderr);
                let what = format!("{line}, {width} x {height} of {raw}: {stderr}");
                assert_eq!(run.status.code(), Some(2), "{what}");
                assert!(
                    stderr.lines().last().is_some_and(|l| l.starts_with("kinoise: ")),
                    "{what}"
                );
                assert!(!folder.path().join("out").exists(), "{what}");
            }
        }
    }
}

/// A wall without noise: sigma is the rounding error, and dividing by it must not fail.
#[test]
fn a_wall_without_any_noise_is_measured_or_refused() {
    let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("a folder");
    let frame = Frame { width: 160, height: 120, raw: vec![1500; 160 * 120] };
    recording(folder.path(), &sensor(160, 120), &frame);
    let opened = io::open(folder.path(), &Default::default()).expect("a recording");
    let measured = measure_recording(&opened, &Default::default(), &|_, _| ()).expect("measured");
    for view in &measured.views {
        let cell = &view.whole;
        let numbers = [
            view.z_m,
            view.theta_rad,
            cell.spread.spatial_m,
            cell.spread.total_m,
            cell.std_error_m,
        ];
        assert!(numbers.iter().all(|v| v.is_finite()), "{numbers:?}");
        assert!((view.z_m - 1.5).abs() < 1e-6, "{}", view.z_m);
    }
}

fn coordinate() -> impl Strategy<Value = f64> {
    prop_oneof![Just(0.0), Just(1.0), Just(-1e-300), -10.0f64..10.0, Just(1e8)]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Collinear, coplanar or identical points: a rigid motion, or `None`.
    #[test]
    fn alignments_are_motions(
        along in prop::array::uniform3(coordinate()), steps in prop::collection::vec(coordinate(), 0..12),
    ) {
        let pairs: Vec<_> = steps.iter().map(|s| Vector3::from(along) * *s).map(|p| (p, p)).collect();
        if let Some(motion) = align(&pairs) {
            prop_assert!((motion.rotation.coords.norm() - 1.0).abs() < 1e-9, "{:?}", motion);
            prop_assert!(motion.translation.vector.iter().all(|v| v.is_finite()), "{:?}", motion);
        } else {
            prop_assert!(pairs.len() < 3);
        }
    }

    /// Collinear points have a finite plane or `None`.
    #[test]
    fn planes_of_collinear_points(
        along in prop::array::uniform3(-2.0f32..2.0), from in prop::array::uniform3(0.0f32..2.0), n in 0usize..60, spread in 0.0f32..2.0,
    ) {
        let mut points = Points::default();
        for k in 0..n {
            let t = spread * k as f32 / n as f32;
            points.push(from[0] + t * along[0], from[1] + t * along[1], from[2] + t * along[2]);
        }
        let options = RansacOptions { threshold_m: 0.01, iterations: 50, confidence: 0.99 };
        if let Some(found) = ransac_plane(&points, &options, &mut Seed(1).stream("line")) {
            let numbers = [found.z_m, found.theta_rad, found.sigma_m];
            prop_assert!(found.plane.is_finite() && numbers.iter().all(|v| v.is_finite()), "{:?}", found);
        }
    }

    /// Inverse depths on one row, of one pixel, of none.
    #[test]
    fn planes_of_one_row(values in prop::collection::vec(prop_oneof![Just(f32::NAN), Just(0.5f32), 0.1f32..2.0], 1..60)) {
        let camera = Camera::centred(values.len(), 1, values.len() as f64);
        let pixels: Vec<u32> = (0..values.len() as u32).collect();
        let start = Plane::tilted(2.0, 0.0, 0.0);
        let fit = fit_affine_robust(&values, &camera.rays(), &pixels, &start, 1e-4, Effort::AllPixels);
        prop_assert!(fit.is_none_or(|f| f.plane.is_finite() && f.scale.is_finite()), "{:?}", fit);
    }

    /// Corners at one place or on a line enclose nothing, and need no square root.
    #[test]
    fn regions_of_any_corners(corners in prop::collection::vec([coordinate(), coordinate()], 3..8), u in coordinate(), v in coordinate()) {
        let flat: Vec<[f64; 2]> = corners.iter().map(|c| [c[0], 1.0]).collect();
        prop_assert!(!Region::Polygon(flat).contains(u, 1.5));
        let _ = Region::Polygon(corners).contains(u, v);
    }

    /// Any raw value has a positive finite depth or none, and the table agrees.
    #[test]
    fn raw_values_of_any_code(offset in coordinate(), slope in coordinate(), raw in any::<u16>()) {
        let code = DepthCode::Disparity { offset, slope, invalid: 2047 };
        prop_assert!(code.metres(raw).is_none_or(|z| z > 0.0 && z.is_finite()));
        prop_assert!(code.table().metres(raw).is_nan() == code.metres(raw).is_none());
    }

    /// The ray of any pixel of any camera without a fault projects back to it.
    #[test]
    fn rays_of_any_camera(
        width in 1usize..80, height in 1usize..60, f in 1.0f64..500.0, k in prop::array::uniform5(-0.5f64..0.5), u in 0.0f64..1.0, v in 0.0f64..1.0,
    ) {
        let camera = Camera { distortion: Some(k), ..Camera::centred(width, height, f) };
        if camera.fault().is_none() {
            let (u, v) = (u * (width - 1) as f64, v * (height - 1) as f64);
            let (x, y) = camera.ray(u, v);
            let (again_u, again_v) = camera.project(x, y);
            prop_assert!((again_u - u).abs() < 1e-4 && (again_v - v).abs() < 1e-4, "{} {} {} {}", u, v, again_u, again_v);
        }
    }
}

/// A model whose domain is a single point is valid, also when read from a file.
#[test]
fn a_model_of_one_place_is_a_model() {
    let mut model = NoiseModel::paper();
    model.sigma.domain.z_m = [2.0, 2.0];
    model.sigma.domain.theta_rad = [0.0, 0.0];
    assert_eq!(model.sigma.form, Form::Paper);
    let text = model.to_json().expect("written");
    let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("a folder");
    let path = folder.path().join("model.json");
    fs::write(&path, text).expect("written");
    let read = NoiseModel::read(&path).expect("read");
    assert_eq!(read.sigma.sigma(1.0, 0.5), read.sigma.sigma(2.0, 0.0));
}
