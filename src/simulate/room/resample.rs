//! Poses at the sensor's frame rate from poses at any times.
//!
//! Translation: cubic Hermite between the neighbouring samples; rotation: slerp. Across a gap the
//! speed at its ends is kept no larger than the gap's own, so that the camera glides through: a
//! cubic with end speeds v leaves the chord by at most 4/27 of v times the time it has.

use nalgebra::{Isometry3, Translation3, Vector3};

use super::Pose;
use crate::error::{Error, Result};
use crate::simulate::RATE_HZ;

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
pub const GAP_S: f64 = 0.2;
/// A finite difference over less is mostly the tracker's own noise (0.1 mm at 300 Hz), s.
const SPEED_SPAN_S: f64 = 0.03;
/// An hour's frames; more is stamps that are not in seconds.
const MAX_FRAMES: f64 = 3600.0 * RATE_HZ;

/// Every 1/30 s from the first sample to the last; at most `limit` frames.
///
/// # Errors
/// When there would be more than an hour of frames.
///
/// # Panics
/// When `samples` is empty; [`super::read_trajectory`] returns at least one.
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
    let poses = (0..frames as usize).map(|k| at(samples, start + k as f64 / RATE_HZ)).collect();
    Ok(Resampled { poses, gaps })
}

fn at(samples: &[Pose], stamp: f64) -> Pose {
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
    while first > 0 && near(samples, first - 1, first) && !spanned(samples, first, i) {
        first -= 1;
    }
    while last + 1 < samples.len() && near(samples, last, last + 1) && !spanned(samples, i, last) {
        last += 1;
    }
    if first == last {
        return Vector3::zeros();
    }
    let (a, b) = (&samples[first], &samples[last]);
    (position(b) - position(a)) / (b.stamp - a.stamp)
}

fn near(samples: &[Pose], i: usize, j: usize) -> bool {
    samples[j].stamp - samples[i].stamp <= GAP_S
}

fn spanned(samples: &[Pose], i: usize, j: usize) -> bool {
    samples[j].stamp - samples[i].stamp >= SPEED_SPAN_S
}
