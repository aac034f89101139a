//! Fitting a path that was filmed elsewhere into the room, by a rigid motion that keeps its
//! vertical.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Matrix2, Vector2, Vector3};

use super::body::Room;
use super::office::CEILING_M;
use crate::error::{Error, Result};
use crate::trajectory::Pose;

/// The sensor keeps this far from everything, m: half the width of a Kinect (0.28 m).
pub const CLEARANCE_M: f64 = 0.14;

/// Where a path lies in the room.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    pub room_from_world: Isometry3<f64>,
    /// Least distance of the path from furniture and walls, m.
    pub clearance_m: f64,
}

impl Placement {
    /// The path in the room's frame.
    pub fn apply(&self, poses: &[Pose]) -> Vec<Pose> {
        let moved = |p: &Pose| Pose {
            stamp: p.stamp,
            world_from_camera: self.room_from_world * p.world_from_camera,
        };
        poses.iter().map(moved).collect()
    }
}

/// Directions that are tried, all round.
const TURNS: usize = 24;
/// Heights at which a hand holds a sensor, m; a path outside was not measured from the floor.
const HELD_M: [f64; 2] = [0.4, 2.2];
/// Shoulder height: where the middle of such a path goes, m.
const SHOULDER_M: f64 = 1.45;
/// Where a sensor that is carried on looks when its path does not say, m ahead.
const AHEAD_M: f64 = 1.3;
/// A point that is looked at from more than a room away is none, m.
const GAZE_REACH_M: f64 = 4.0;

/// Place a path with z up so that what it looks at is the desks, or else so that its middle is the
/// room's.
///
/// # Errors
/// When it comes too near to furniture or walls however it is placed.
pub fn place(room: &Room, poses: &[Pose]) -> Result<Placement> {
    let mut reached = f64::NEG_INFINITY;
    for anchor in anchors(poses) {
        let placed = (0..TURNS).map(|k| turned(room, poses, anchor, k));
        let widest = placed.max_by(|a, b| a.clearance_m.total_cmp(&b.clearance_m));
        if let Some(found) = widest {
            if found.clearance_m >= CLEARANCE_M {
                return Ok(found);
            }
            reached = reached.max(found.clearance_m);
        }
    }
    let (low, high) = bounds(poses);
    let size = high - low;
    Err(Error::Argument {
        what: format!(
            "the path ({:.1} x {:.1} m, {:.1} m up and down) does not fit into the room: at best it comes within {reached:.2} m of something, {CLEARANCE_M} m are needed",
            size.x, size.y, size.z
        ),
        remedy: "give a part of it (--frames), or a path in metres with z up around a desk",
    })
}

fn turned(room: &Room, poses: &[Pose], anchor: Vector2<f64>, turn: usize) -> Placement {
    let turn = Vector3::z() * (TAU * turn as f64 / TURNS as f64);
    let to_middle = Isometry3::translation(-anchor.x, -anchor.y, lift(poses));
    let room_from_world = Isometry3::new(Vector3::zeros(), turn) * to_middle;
    let along = poses.iter().map(|p| {
        let position = room_from_world * p.world_from_camera;
        room.clearance(&position.translation.vector).0
    });
    Placement { room_from_world, clearance_m: along.fold(f64::INFINITY, f64::min) }
}

/// How far the path is lifted: not at all where its heights are a hand's.
fn lift(poses: &[Pose]) -> f64 {
    let (low, high) = bounds(poses);
    let held = low.z >= HELD_M[0] && high.z <= HELD_M[1].min(CEILING_M);
    if held { 0.0 } else { SHOULDER_M - 0.5 * (low.z + high.z) }
}

/// Points of the path's floor plan that may become the room's middle, the best first.
fn anchors(poses: &[Pose]) -> Vec<Vector2<f64>> {
    let (low, high) = bounds(poses);
    let middle = 0.5 * (low + high).xy();
    let gaze = looked_at(poses).filter(|p| (p - middle).norm() < GAZE_REACH_M);
    let ahead: Vector2<f64> = poses.iter().map(level_gaze).sum();
    let ahead = ahead.try_normalize(1e-9).map(|d| middle + AHEAD_M * d);
    gaze.into_iter().chain(ahead).chain([middle]).collect()
}

fn level_gaze(pose: &Pose) -> Vector2<f64> {
    (pose.world_from_camera.rotation * Vector3::z()).xy()
}

/// Eigenvalue ratio below which the lines of sight are parallel and meet nowhere: 0.02 is a spread
/// of some 8 degrees.
const PARALLEL: f64 = 0.02;

/// The point of the floor plan nearest to all lines of sight.
fn looked_at(poses: &[Pose]) -> Option<Vector2<f64>> {
    let (mut matrix, mut vector) = (Matrix2::zeros(), Vector2::zeros());
    for pose in poses {
        if let Some(sight) = level_gaze(pose).try_normalize(1e-9) {
            let across = Matrix2::identity() - sight * sight.transpose();
            matrix += across;
            vector += across * pose.world_from_camera.translation.vector.xy();
        }
    }
    let spread = matrix.symmetric_eigenvalues();
    let meets = spread.min() > PARALLEL * spread.max();
    meets.then(|| matrix.try_inverse()).flatten().map(|inverse| inverse * vector)
}

fn bounds(poses: &[Pose]) -> (Vector3<f64>, Vector3<f64>) {
    let places = poses.iter().map(|p| p.world_from_camera.translation.vector);
    let none = Vector3::repeat(f64::INFINITY);
    places.fold((none, -none), |(low, high), p| (low.inf(&p), high.sup(&p)))
}
