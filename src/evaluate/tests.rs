use std::path::PathBuf;

use nalgebra::{Isometry3, Vector3};

use super::*;
use crate::trajectory::read_benchmark;

/// The folder of real trajectories, if it exists.
fn real() -> Option<PathBuf> {
    let data = std::env::var_os("KINOISE_DATA").map(PathBuf::from);
    let root = data
        .unwrap_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data")));
    let folder = root.join("tum_trajectories");
    if !folder.is_dir() {
        println!("skipped: {} is not here; set KINOISE_DATA", folder.display());
        return None;
    }
    Some(folder)
}

/// Every value that the scripts report, to the digits they print.
#[test]
fn the_scripts_figures_to_the_last_digit() {
    let Some(folder) = real() else { return };
    let expected = std::fs::read_to_string(folder.join("expected_metrics.txt")).unwrap();
    let mut compared = 0;
    for line in expected.lines().filter(|l| !l.starts_with('#')) {
        let words: Vec<&str> = line.split([' ', '|']).filter(|w| !w.is_empty()).collect();
        let poses = |kind: &str| {
            let file = folder.join(format!("{}_{kind}.txt", words[0]));
            read_benchmark(&file).expect("a trajectory")
        };
        let [truth, estimate] = ["groundtruth", words[1]].map(poses);
        let evaluated = |delta| evaluate(&truth, &estimate, delta).expect("they overlap");
        let second = evaluated(Delta::Seconds(1.0));
        let frame = evaluated(Delta::Frames(1));
        let figures = |rpe: &Rpe| {
            let degrees = rpe.rotation.rmse.to_degrees();
            format!("{} {:.6} {degrees:.6}", rpe.translation.pairs, rpe.translation.rmse)
        };
        let ours = format!(
            "{} {:.6} {} {}",
            second.ate.error.pairs,
            second.ate.error.rmse,
            figures(&second.rpe),
            figures(&frame.rpe)
        );
        assert_eq!(ours, words[2..].join(" "), "{line}");
        compared += 1;
    }
    assert_eq!(compared, 6);
}

fn path(n: usize) -> Vec<Pose> {
    let at = |k: usize| {
        let s = 0.1 * k as f64;
        Isometry3::new(Vector3::new(s.cos(), s.sin(), 0.1 * s), Vector3::new(0.1 * s, 0.0, s))
    };
    (0..n).map(|k| Pose { stamp: k as f64 / 30.0, world_from_camera: at(k) }).collect()
}

/// Neither measure depends on the origin of the world.
#[test]
fn a_moved_world_is_no_error() {
    let truth = path(90);
    let elsewhere = Isometry3::new(Vector3::new(3.0, -2.0, 1.0), Vector3::new(0.5, 1.0, -2.0));
    let moved: Vec<Pose> = truth
        .iter()
        .map(|p| Pose { world_from_camera: elsewhere * p.world_from_camera, ..*p })
        .collect();
    let found = evaluate(&truth, &moved, Delta::Seconds(1.0)).unwrap();
    assert!(found.ate.error.max < 1e-12, "{:?}", found.ate.error);
    assert!(found.rpe.translation.max < 1e-12 && found.rpe.rotation.max < 1e-7);
    let back = found.ate.truth_from_estimate * elsewhere;
    assert!(back.translation.vector.norm() < 1e-12 && back.rotation.angle() < 1e-12);
}

/// An estimate whose scale is 1 % too large has a relative error of 1 % of the path.
#[test]
fn a_wrong_scale_is_measured() {
    let straight = |scale: f64| -> Vec<Pose> {
        (0..121)
            .map(|k| {
                let x = scale * k as f64 / 30.0;
                let world_from_camera = Isometry3::translation(x, 0.0, 0.0);
                Pose { stamp: k as f64 / 30.0, world_from_camera }
            })
            .collect()
    };
    let found = evaluate(&straight(1.0), &straight(1.01), Delta::Seconds(1.0)).unwrap();
    assert!((found.rpe.translation.mean - 0.01).abs() < 1e-12);
    assert!(found.rpe.rotation.max < 1e-9);
    // Spread evenly over 4 s about the middle: RMS 0.01 * 4 / sqrt(12), except at the ends.
    assert!((found.ate.error.rmse - 0.01 * 4.0 / 12f64.sqrt()).abs() < 2e-4);
}

#[test]
fn no_common_time_is_an_error() {
    let late: Vec<Pose> = path(90).iter().map(|p| Pose { stamp: p.stamp + 100.0, ..*p }).collect();
    for (truth, estimate) in [(path(90), late), (path(90), path(1)), (path(2), path(90))] {
        let said = evaluate(&truth, &estimate, Delta::Seconds(1.0)).unwrap_err().to_string();
        assert!(said.contains("at their time"), "{said}");
    }
}

#[test]
fn reflections_are_never_taken_for_rotations() {
    let points = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 1.0, 1.0)];
    let pairs: Vec<_> =
        points.iter().map(|&(x, y, z)| (Vector3::new(x, y, z), Vector3::new(x, y, -z))).collect();
    let turn = align(&pairs).unwrap().rotation.to_rotation_matrix();
    assert!((turn.matrix().determinant() - 1.0).abs() < 1e-12);
}
