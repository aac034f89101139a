//! Relative pose error over a fixed interval, as evaluate_rpe.py with `--fixed_delta`.

use std::fmt::{Display, Formatter};

use nalgebra::Isometry3;

use super::{Spread, too_few};
use crate::error::{Error, Result};
use crate::stats::median;
use crate::trajectory::Pose;
use crate::units::counted;

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Delta {
    Seconds(f64),
    Frames(usize),
}

impl Display for Delta {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        match self {
            Delta::Seconds(s) => write!(f, "{s} s"),
            Delta::Frames(n) => f.write_str(&counted(*n, "frame")),
        }
    }
}

/// Relative pose error: motions of the estimate against the true ones.
#[derive(Debug, Clone, PartialEq)]
pub struct Rpe {
    /// m.
    pub translation: Spread,
    /// rad.
    pub rotation: Spread,
    /// Stamp at the start of the motion, s, and its error, m.
    pub each: Vec<(f64, f64)>,
}

/// Relative error of poses in time order.
/// Fails if fewer than two motions have true poses at both ends.
pub fn relative(truth: &[Pose], estimate: &[Pose], delta: Delta) -> Result<Rpe> {
    if truth.len() < 2 || estimate.len() < 2 {
        return Err(too_few(truth, estimate, truth.len().min(estimate.len())));
    }
    let limit = max_difference(truth);
    let true_pose = |stamp: f64| {
        let nearest = truth[nearest(truth.len(), |i| truth[i].stamp, stamp)];
        ((nearest.stamp - stamp).abs() <= limit).then_some(nearest.world_from_camera)
    };
    let mut each = Vec::new();
    let mut turns = Vec::new();
    for (i, from) in estimate.iter().enumerate() {
        let j = partner(estimate, i, delta);
        // The script skips motions that end at the last pose, because the interval may extend beyond it.
        if j == estimate.len() - 1 {
            continue;
        }
        let to = &estimate[j];
        if let (Some(a), Some(b)) = (true_pose(from.stamp), true_pose(to.stamp)) {
            let error =
                motion(&to.world_from_camera, &from.world_from_camera).inverse() * motion(&b, &a);
            each.push((from.stamp, error.translation.vector.norm()));
            turns.push(error.rotation.angle());
        }
    }
    let shifts: Vec<f64> = each.iter().map(|e| e.1).collect();
    match (Spread::of(&shifts), Spread::of(&turns)) {
        (Some(translation), Some(rotation)) if each.len() >= 2 => {
            Ok(Rpe { translation, rotation, each })
        }
        _ => {
            let shared = estimate.iter().filter(|p| true_pose(p.stamp).is_some()).count();
            Err(if shared < 2 { too_few(truth, estimate, shared) } else { too_short(delta) })
        }
    }
}

fn too_short(delta: Delta) -> Error {
    Error::NotEnough {
        what: format!("the estimate has no two motions of {delta} with true poses at their ends"),
        remedy: "compare over a shorter interval (--delta), or give more of the sequence".into(),
    }
}

/// Whether most intervals are so short that they end at the pose where they begin: motions without an error.
pub(super) fn is_too_short(estimate: &[Pose], delta: Delta) -> bool {
    let none = (0..estimate.len()).filter(|&i| partner(estimate, i, delta) == i);
    2 * none.count() > estimate.len()
}

/// Index of the pose at the end of the interval that starts with pose `i`.
fn partner(estimate: &[Pose], i: usize, delta: Delta) -> usize {
    match delta {
        Delta::Seconds(s) => nearest(estimate.len(), |k| estimate[k].stamp, estimate[i].stamp + s),
        Delta::Frames(n) => nearest(estimate.len(), |k| k as f64, (i + n) as f64),
    }
}

/// Largest distance of a true pose from a stamp, s: twice the usual interval; anything farther is a gap.
fn max_difference(truth: &[Pose]) -> f64 {
    let mut intervals: Vec<f64> = truth.windows(2).map(|w| w[1].stamp - w[0].stamp).collect();
    2.0 * median(&mut intervals)
}

fn motion(to: &Isometry3<f64>, from: &Isometry3<f64>) -> Isometry3<f64> {
    to.inverse() * from
}

/// Index of the value nearest to `wanted` in ascending values, by the script's bisection, which decides ties.
fn nearest(len: usize, value: impl Fn(usize) -> f64, wanted: f64) -> usize {
    let mut best = 0;
    let mut difference = (value(0) - wanted).abs();
    let (mut begin, mut end) = (0, len);
    while begin < end {
        let middle = usize::midpoint(begin, end);
        let here = value(middle);
        if (here - wanted).abs() < difference {
            difference = (here - wanted).abs();
            best = middle;
        }
        if here == wanted {
            return middle;
        } else if here > wanted {
            end = middle;
        } else {
            begin = middle + 1;
        }
    }
    best
}
