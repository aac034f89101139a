//! The path that is filmed: once around the desks, or a recorded one at the sensor's frame rate.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use crate::error::{Error, Result};
use crate::simulate::grid::RATE_HZ;
use crate::trajectory::Pose;

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
    (0..frames).map(|k| walk(k as f64 / RATE_HZ)).collect()
}

fn walk(stamp: f64) -> Pose {
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

/// A stretch without samples, s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gap {
    pub from: f64,
    pub to: f64,
}

impl Gap {
    pub fn seconds(&self) -> f64 {
        self.to - self.from
    }
}

/// Poses at 30 Hz, and the gaps that were glided through.
#[derive(Debug, Clone, PartialEq)]
pub struct Resampled {
    pub poses: Vec<Pose>,
    pub gaps: Vec<Gap>,
}

/// Six frames: a trajectory sampled at 5 Hz or more has no gaps.
const GAP_S: f64 = 0.2;
/// A finite difference over less is mostly the tracker's own noise (0.1 mm at 300 Hz), s.
const SPEED_SPAN_S: f64 = 0.03;
/// An hour's frames; more is stamps that are not in seconds.
const MAX_FRAMES: f64 = 3600.0 * RATE_HZ;

/// Poses at 30 Hz from poses at any times, from the first sample to the last; at most `limit`.
///
/// Translation: cubic Hermite between the neighbouring samples; rotation: slerp. Across a gap the
/// speed at its ends is kept no larger than the gap's own, so that the camera glides through: a
/// cubic with end speeds v leaves the chord by at most 4/27 of v times the time it has.
///
/// # Errors
/// When there would be more than an hour of frames.
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
    let gaps = samples
        .windows(2)
        .map(|w| Gap { from: w[0].stamp, to: w[1].stamp })
        .filter(|gap| gap.seconds() > GAP_S && gap.from < last)
        .collect();
    let poses =
        (0..frames as usize).map(|k| interpolate(samples, start + k as f64 / RATE_HZ)).collect();
    Ok(Resampled { poses, gaps })
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

/// Speed at a sample, m/s: over its neighbours on both sides, but not across a gap.
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
