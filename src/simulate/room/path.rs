//! The path that is filmed when none is given: once around the desks.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::Pose;
use crate::simulate::RATE_HZ;

/// For one round, s: 0.28 m/s, between freiburg2_desk (0.19) and freiburg1_desk (0.41 m/s).
const ROUND_S: f64 = 40.0;
/// Mean distance from the desks' middle and height, m, with their slow changes: a person walks
/// and holds the sensor at shoulder height.
const RADIUS_M: [f64; 2] = [1.8, 0.2];
const HEIGHT_M: [f64; 2] = [1.4, 0.12];
/// Whole numbers of changes a round, so that the path closes.
const RADIUS_CHANGES: f64 = 3.0;
const HEIGHT_CHANGES: f64 = 5.0;
/// What is looked at, m: the desk tops' middle, and how far the gaze wanders from it.
const GAZE: Vector3<f64> = Vector3::new(0.0, 0.0, 0.55);
const WANDER_M: f64 = 0.25;

/// At 30 Hz from 0 s, in the room's frame.
pub fn around_the_desks() -> Vec<Pose> {
    let frames = (ROUND_S * RATE_HZ) as usize;
    (0..frames).map(|k| k as f64 / RATE_HZ).map(|stamp| Pose { stamp, ..at(stamp) }).collect()
}

fn at(stamp: f64) -> Pose {
    let turn = TAU * stamp / ROUND_S;
    let radius = RADIUS_M[0] + RADIUS_M[1] * (RADIUS_CHANGES * turn).sin();
    let height = HEIGHT_M[0] + HEIGHT_M[1] * (HEIGHT_CHANGES * turn).sin();
    // Begins at the first desk's user, on the -y side.
    let eye = Vector3::new(radius * turn.sin(), -radius * turn.cos(), height);
    let wander = Vector3::new((4.0 * turn).sin(), (3.0 * turn).cos(), 0.5 * (5.0 * turn).cos());
    Pose { stamp, world_from_camera: looking(eye, GAZE + WANDER_M * wander) }
}

/// Level, from `eye` towards `target`: z forward, y down.
pub fn looking(eye: Vector3<f64>, target: Vector3<f64>) -> Isometry3<f64> {
    let forward = (target - eye).normalize();
    let right = forward.cross(&Vector3::z()).normalize();
    let down = forward.cross(&right);
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[right, down, forward]));
    Isometry3::from_parts(Translation3::from(eye), UnitQuaternion::from_rotation_matrix(&rotation))
}
