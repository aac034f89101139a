//! The camera path: once around the desks, or a recorded trajectory resampled to the sensor's frame rate
//! and fitted into the room by a rigid motion that keeps the vertical.

use std::f64::consts::TAU;

use nalgebra::{
    Isometry3, Matrix2, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector2, Vector3,
};

use super::body::Room;
use super::office::CEILING_M;
use crate::error::{Error, Result};
use crate::simulate::RATE_HZ;
use crate::trajectory::Pose;

/// Time for one round, s: 0.28 m/s, between freiburg2_desk (0.19) and freiburg1_desk (0.41 m/s).
const ROUND_S: f64 = 40.0;
/// Distance from the desks' middle and height, m, each with mean and amplitude: a person walks and holds
/// the sensor at shoulder height.
const RADIUS_M: [f64; 2] = [1.8, 0.2];
const HEIGHT_M: [f64; 2] = [1.4, 0.12];
/// Oscillations per round, whole numbers so that the path closes.
const RADIUS_CHANGES: f64 = 3.0;
const HEIGHT_CHANGES: f64 = 5.0;
/// Gaze target, m: the desk tops' middle, and how far the gaze wanders from it.
const GAZE: Vector3<f64> = Vector3::new(0.0, 0.0, 0.55);
const WANDER_M: f64 = 0.25;

/// Path around the desks at 30 Hz from 0 s, in the room's frame.
pub fn around_the_desks() -> Vec<Pose> {
    let frames = (ROUND_S * RATE_HZ) as usize;
    (0..frames).map(|k| walk(k as f64 / RATE_HZ)).collect()
}

fn walk(stamp: f64) -> Pose {
    let turn = TAU * stamp / ROUND_S;
    let radius = RADIUS_M[0] + RADIUS_M[1] * (RADIUS_CHANGES * turn).sin();
    let height = HEIGHT_M[0] + HEIGHT_M[1] * (HEIGHT_CHANGES * turn).sin();
    // Starts at the seat of the first desk, on the -y side.
    let eye = Vector3::new(radius * turn.sin(), -radius * turn.cos(), height);
    let wander = Vector3::new((4.0 * turn).sin(), (3.0 * turn).cos(), 0.5 * (5.0 * turn).cos());
    Pose { stamp, world_from_camera: looking(eye, GAZE + WANDER_M * wander) }
}

/// Camera pose without roll, from `eye` towards `target`: z forward, y down.
pub fn looking(eye: Vector3<f64>, target: Vector3<f64>) -> Isometry3<f64> {
    let forward = (target - eye).normalize();
    let right = forward.cross(&Vector3::z()).normalize();
    let down = forward.cross(&right);
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[right, down, forward]));
    Isometry3::from_parts(Translation3::from(eye), UnitQuaternion::from_rotation_matrix(&rotation))
}

/// Poses at 30 Hz, and the lengths of the gaps that were interpolated across.
#[derive(Debug, Clone, PartialEq)]
pub struct Resampled {
    pub poses: Vec<Pose>,
    pub gaps_s: Vec<f64>,
}

/// Longest interval that is no gap, s: six frames, so a trajectory sampled at 5 Hz or more has no gaps.
const GAP_S: f64 = 0.2;
/// Span of a finite difference, s; over less it is mostly the tracker's noise (0.1 mm at 300 Hz).
const SPEED_SPAN_S: f64 = 0.03;
/// An hour of frames; more means that the timestamps are not in seconds.
const MAX_FRAMES: f64 = 3600.0 * RATE_HZ;

/// Resamples poses at arbitrary times to 30 Hz, from the first sample to the last; at most `limit`.
///
/// Translation: cubic Hermite between the neighbouring samples; rotation: slerp. Across a gap the end
/// speeds are limited to the gap's mean speed, so that the camera moves smoothly: a cubic with end speeds v
/// leaves the chord by at most 4/27 of v times the duration.
///
/// # Panics
/// When `samples` is empty; [`crate::trajectory::read_trajectory`] returns at least one.
pub fn resample(samples: &[Pose], limit: Option<usize>) -> Result<Resampled> {
    let (start, end) = (samples[0].stamp, samples[samples.len() - 1].stamp);
    // A rounding error of the stamps must not cost the last frame.
    let whole = ((end - start) * RATE_HZ + 1e-6).floor() + 1.0;
    let frames = limit.map_or(whole, |n| whole.min(n as f64));
    if frames > MAX_FRAMES {
        return Err(Error::Argument {
            what: format!("the trajectory lasts {:.0} s: {whole:.0} frames", end - start),
            remedy: "give --frames, or time stamps in seconds",
        });
    }
    let last = start + (frames - 1.0) / RATE_HZ;
    let gaps_s = samples
        .windows(2)
        .filter(|w| w[0].stamp < last)
        .map(|w| w[1].stamp - w[0].stamp)
        .filter(|gap_s| *gap_s > GAP_S)
        .collect();
    let poses =
        (0..frames as usize).map(|k| interpolate(samples, start + k as f64 / RATE_HZ)).collect();
    Ok(Resampled { poses, gaps_s })
}

fn interpolate(samples: &[Pose], stamp: f64) -> Pose {
    let next = samples.partition_point(|s| s.stamp <= stamp);
    if next == 0 || next == samples.len() {
        let end = samples[next.saturating_sub(1)];
        return Pose { stamp, ..end };
    }
    let (a, b) = (&samples[next - 1], &samples[next]);
    let span = b.stamp - a.stamp;
    let u = (stamp - a.stamp) / span;
    let chord = (position(b) - position(a)) / span;
    let limited = |speed: Vector3<f64>| {
        let fast = span > GAP_S && speed.norm() > chord.norm();
        if fast { speed * (chord.norm() / speed.norm()) } else { speed }
    };
    let (leave, arrive) = (limited(speed(samples, next - 1)), limited(speed(samples, next)));
    let place = hermite(u, [position(a), position(b)], [leave * span, arrive * span]);
    let turn = a.world_from_camera.rotation.slerp(&b.world_from_camera.rotation, u);
    Pose { stamp, world_from_camera: Isometry3::from_parts(Translation3::from(place), turn) }
}

fn position(pose: &Pose) -> Vector3<f64> {
    pose.world_from_camera.translation.vector
}

fn hermite(u: f64, ends: [Vector3<f64>; 2], tangents: [Vector3<f64>; 2]) -> Vector3<f64> {
    let (square, cube) = (u * u, u * u * u);
    let rise = 3.0 * square - 2.0 * cube;
    ends[0] * (1.0 - rise)
        + ends[1] * rise
        + tangents[0] * (cube - 2.0 * square + u)
        + tangents[1] * (cube - square)
}

/// Velocity at a sample, m/s: finite difference over its neighbours on both sides, but not across a gap.
fn speed(samples: &[Pose], i: usize) -> Vector3<f64> {
    let (mut first, mut last) = (i, i);
    let seconds = |i: usize, j: usize| samples[j].stamp - samples[i].stamp;
    while first > 0 && seconds(first - 1, first) <= GAP_S && seconds(first, i) < SPEED_SPAN_S {
        first -= 1;
    }
    let end = samples.len() - 1;
    while last < end && seconds(last, last + 1) <= GAP_S && seconds(i, last) < SPEED_SPAN_S {
        last += 1;
    }
    if first == last {
        return Vector3::zeros();
    }
    let (a, b) = (&samples[first], &samples[last]);
    (position(b) - position(a)) / (b.stamp - a.stamp)
}

/// Least distance of the sensor from everything, m: half the width of a Kinect (0.28 m).
pub const CLEARANCE_M: f64 = 0.14;

/// Number of orientations tried about the vertical.
const TURNS: usize = 24;
/// Heights of a hand-held sensor, m; a path outside was not measured from the floor.
const HELD_M: [f64; 2] = [0.4, 2.2];
/// Shoulder height, m: the middle of such a path is moved here.
const SHOULDER_M: f64 = 1.45;
/// Assumed distance of the gaze point when the path does not determine it, m ahead.
const AHEAD_M: f64 = 1.3;
/// Farthest gaze point from the path's middle, m: one more than a room away is rejected.
const GAZE_REACH_M: f64 = 4.0;

/// Places a path with z up so that its gaze point is at the desks, or else so that its middle is the
/// room's. Returns `room_from_world` and the path's least distance from furniture and walls, m; an error
/// when every placement comes too near to them.
pub fn place(room: &Room, poses: &[Pose]) -> Result<(Isometry3<f64>, f64)> {
    let mut reached = f64::NEG_INFINITY;
    for anchor in anchors(poses) {
        let placed = (0..TURNS).map(|k| turned(room, poses, anchor, k));
        let widest = placed.max_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((room_from_world, clearance_m)) = widest {
            if clearance_m >= CLEARANCE_M {
                return Ok((room_from_world, clearance_m));
            }
            reached = reached.max(clearance_m);
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

fn turned(room: &Room, poses: &[Pose], anchor: Vector2<f64>, turn: usize) -> (Isometry3<f64>, f64) {
    let turn = Vector3::z() * (TAU * turn as f64 / TURNS as f64);
    let to_middle = Isometry3::translation(-anchor.x, -anchor.y, lift(poses));
    let room_from_world = Isometry3::new(Vector3::zeros(), turn) * to_middle;
    let along = poses.iter().map(|p| {
        let position = room_from_world * p.world_from_camera;
        room.clearance(&position.translation.vector).0
    });
    (room_from_world, along.fold(f64::INFINITY, f64::min))
}

/// Vertical shift of the path, m: zero where its heights are those of a hand-held sensor.
fn lift(poses: &[Pose]) -> f64 {
    let (low, high) = bounds(poses);
    let held = low.z >= HELD_M[0] && high.z <= HELD_M[1].min(CEILING_M);
    if held { 0.0 } else { SHOULDER_M - 0.5 * (low.z + high.z) }
}

/// Points of the path's floor plan that may become the room's middle, best first.
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

/// Eigenvalue ratio below which lines of sight count as parallel: 0.02 is a spread of some 8 degrees.
const PARALLEL: f64 = 0.02;

/// Least-squares intersection of all lines of sight in the floor plan; `None` if they are parallel.
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
