use nalgebra::{Isometry3, Translation3};
use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::rng::Seed;

/// A camera that looks around, with a pose every `interval` s; each pose is turned by `noise` rad.
fn looking_about(interval: f64, offset: f64, noise: f64, seed: u64) -> Vec<Pose> {
    let mut rng = Seed(seed).stream("offset");
    let count = (30.0 / interval) as usize;
    let pose = |i: usize| {
        let t = i as f64 * interval;
        let angles = [0.5 * (0.9 * t).sin(), 0.4 * (1.7 * t + 1.0).sin(), 0.3 * (2.3 * t).cos()];
        let shake = Vector3::from_fn(|_, _| {
            let unit: f64 = StandardNormal.sample(&mut rng);
            noise * unit
        });
        let rotation = UnitQuaternion::from_euler_angles(angles[0], angles[1], angles[2])
            * UnitQuaternion::from_scaled_axis(shake);
        let place = Translation3::new((0.5 * t).sin(), 0.0, 0.2 * t);
        Pose {
            stamp: 1000.0 + t - offset,
            world_from_camera: Isometry3::from_parts(place, rotation),
        }
    };
    (0..count).map(pose).collect()
}

/// To a millisecond, and within the stated error.
#[test]
fn a_known_offset_comes_back() {
    let truth = looking_about(0.01, 0.0, 0.0, 0);
    let mut inside = 0;
    for seed in 0..20 {
        let offset = 0.04 * (seed as f64 / 10.0 - 1.0);
        let found = clock_offset(&truth, &looking_about(1.0 / 30.0, offset, 0.002, seed)).unwrap();
        assert!((found.seconds - offset).abs() < 0.001, "{offset}: {found:?}");
        inside += usize::from((found.seconds - offset).abs() < 1.96 * found.std_error_s);
        assert_eq!(found.is_significant(), offset.abs() > 0.0015, "{offset}: {found:?}");
    }
    assert!(inside >= 15, "{inside} of 20 within two standard errors");
}

/// For any frame of the truth's marker and any start of the estimate.
#[test]
fn frames_do_not_matter() {
    let marker = UnitQuaternion::from_euler_angles(0.3, -1.2, 2.0);
    let begin = UnitQuaternion::from_euler_angles(1.0, 0.5, -0.7);
    let mut truth = looking_about(0.01, 0.0, 0.0, 0);
    let mut estimate = looking_about(1.0 / 30.0, 0.03, 0.001, 1);
    truth.iter_mut().for_each(|p| p.world_from_camera.rotation *= marker);
    for p in &mut estimate {
        p.world_from_camera.rotation = begin * p.world_from_camera.rotation;
    }
    let found = clock_offset(&truth, &estimate).unwrap();
    assert!((found.seconds - 0.03).abs() < 0.001, "{found:?}");
}

/// Some wrong offset within reach always fits better than its neighbours.
#[test]
fn an_offset_out_of_reach_is_not_told_as_another() {
    let truth = looking_about(0.01, 0.0, 0.0, 0);
    for (seed, offset) in (0..).zip([-5.0, -2.0, -0.7, 0.7, 1.5, 2.0, 3.0, 5.0]) {
        let found = clock_offset(&truth, &looking_about(1.0 / 30.0, offset, 0.002, seed));
        assert_eq!(found, None, "{offset}");
    }
}

#[test]
fn what_does_not_turn_says_nothing() {
    let still = |interval: f64| -> Vec<Pose> {
        let mut poses = looking_about(interval, 0.0, 0.0, 0);
        poses.iter_mut().for_each(|p| p.world_from_camera.rotation = UnitQuaternion::identity());
        poses
    };
    assert_eq!(clock_offset(&still(0.01), &still(0.033)), None);
    assert_eq!(clock_offset(&[], &[]), None);
    let short = looking_about(0.01, 0.0, 0.0, 0);
    assert_eq!(clock_offset(&short, &short[..20]), None);
}
