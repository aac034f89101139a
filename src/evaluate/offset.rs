//! Estimates the offset between two trajectories' clocks from their rotations.
//!
//! Both clocks see the same angular motion, shifted in time. Positions would do less well: they drift, and a
//! constant velocity hides a shift.

use nalgebra::{UnitQuaternion, Vector3};

use super::nearest_rotation;
use crate::stats::{MAD_TO_SIGMA, TUKEY, median};
use crate::trajectory::Pose;

/// The offset to add to the estimate's stamps, s, with its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClockOffset {
    pub seconds: f64,
    pub std_error_s: f64,
}

impl ClockOffset {
    /// Whether it exceeds chance and the truth's own sampling.
    pub fn is_significant(&self) -> bool {
        self.seconds.abs() > (SURE * self.std_error_s).max(MIN_S)
    }
}

/// Threshold in standard errors: 0.3 % false alarms for Gaussian errors.
const SURE: f64 = 3.0;
/// Smallest significant offset, s: a tenth of the 10 ms between motion-capture poses, which resolve no less.
const MIN_S: f64 = 0.001;
/// Interval of the motions, s: over a single frame a mapper's noise is as large as its rotation.
const INTERVAL_S: f64 = 0.1;
/// Range of the offsets that are tried, s, and their step, a tenth of the interval.
const REACH_S: f64 = 0.5;
const STEP_S: f64 = 0.01;
/// Largest median residual, as a share of the median rotation, that is a fit. Four estimates of TUM films have .15
/// to .23 at the right offset, and 1.0 and more at the best of the wrong ones where the right one is out of reach.
const FITS: f64 = 0.5;
/// Fewest motions for an estimate.
const MIN_MOTIONS: usize = 30;
/// Longest gap over which true poses are interpolated, s.
const MAX_GAP_S: f64 = 0.1;
/// Number of parts for the standard error: neighbouring motions have correlated errors, parts do not.
const PARTS: usize = 16;
/// Half the step of the numerical derivative, s.
const HALF_STEP_S: f64 = 0.005;

/// A rotation of the estimate, in the camera's frame at its start.
struct Turn {
    from: f64,
    to: f64,
    vector: Vector3<f64>,
}

/// Estimates the clock offset. `None` if the trajectories turn too little or share too few moments, or if no
/// offset within half a second explains how both turn.
pub fn clock_offset(truth: &[Pose], estimate: &[Pose]) -> Option<ClockOffset> {
    let turns = turns(estimate);
    let steps = (REACH_S / STEP_S) as i32;
    let tried: Vec<(f64, f64)> = (-steps..=steps)
        .filter_map(|k| {
            let offset = STEP_S * f64::from(k);
            Some((offset, Fit::at(truth, &turns, offset)?.misfit()))
        })
        .collect();
    let best = (0..tried.len()).min_by(|&a, &b| tried[a].1.total_cmp(&tried[b].1))?;
    if best == 0 || best + 1 == tried.len() {
        return None;
    }
    let start = tried[best].0;
    let mut seconds = start;
    for _ in 0..8 {
        let (score, information, _) = Fit::at(truth, &turns, seconds)?.equations(truth);
        let step = score / information;
        if !step.is_finite() || (seconds - step - start).abs() > 2.0 * STEP_S {
            return None;
        }
        seconds -= step;
    }
    let fit = Fit::at(truth, &turns, seconds)?;
    if fit.misfit() > FITS * fit.turned(truth) {
        return None;
    }
    let (_, information, scatter) = fit.equations(truth);
    let std_error_s = scatter.sqrt() / information;
    std_error_s.is_finite().then_some(ClockOffset { seconds, std_error_s })
}

fn turns(estimate: &[Pose]) -> Vec<Turn> {
    let mut turns = Vec::new();
    let mut end = 0;
    for from in estimate {
        while end < estimate.len() && estimate[end].stamp < from.stamp + INTERVAL_S {
            end += 1;
        }
        let Some(to) = estimate.get(end) else { break };
        if to.stamp - from.stamp < 2.0 * INTERVAL_S {
            let back = from.world_from_camera.rotation.inverse();
            let vector = (back * to.world_from_camera.rotation).scaled_axis();
            turns.push(Turn { from: from.stamp, to: to.stamp, vector });
        }
    }
    turns
}

/// The true rotation between two moments.
fn true_turn(truth: &[Pose], from: f64, to: f64) -> Option<Vector3<f64>> {
    let (from, to) = (rotation_at(truth, from)?, rotation_at(truth, to)?);
    Some((from.inverse() * to).scaled_axis())
}

fn rotation_at(truth: &[Pose], stamp: f64) -> Option<UnitQuaternion<f64>> {
    let after = truth.partition_point(|p| p.stamp < stamp);
    let (a, b) = (truth.get(after.checked_sub(1)?)?, truth.get(after)?);
    let gap = b.stamp - a.stamp;
    if gap > MAX_GAP_S {
        return None;
    }
    let share = (stamp - a.stamp) / gap;
    a.world_from_camera.rotation.try_slerp(&b.world_from_camera.rotation, share, 1e-9)
}

/// The rotations compared with the true ones at an offset.
struct Fit<'a> {
    offset: f64,
    turns: Vec<&'a Turn>,
    /// Residuals: true rotation minus the estimated one in the truth's frame.
    left: Vec<Vector3<f64>>,
}

impl<'a> Fit<'a> {
    fn at(truth: &[Pose], turns: &'a [Turn], offset: f64) -> Option<Self> {
        let pair = |t: &'a Turn| Some((t, true_turn(truth, t.from + offset, t.to + offset)?));
        let pairs: Vec<(&Turn, Vector3<f64>)> = turns.iter().filter_map(pair).collect();
        if pairs.len() < MIN_MOTIONS {
            return None;
        }
        // The frame of the truth's marker need not be the camera's.
        let spread = pairs.iter().map(|(t, w)| w * t.vector.transpose()).sum();
        let into = nearest_rotation(&spread)?;
        let left = pairs.iter().map(|(t, w)| w - into * t.vector).collect();
        Some(Fit { offset, turns: pairs.into_iter().map(|p| p.0).collect(), left })
    }

    /// Median residual, rad; robust against lost frames.
    fn misfit(&self) -> f64 {
        median(&mut self.left.iter().map(Vector3::norm).collect::<Vec<f64>>())
    }

    /// Median true rotation, rad.
    fn turned(&self, truth: &[Pose]) -> f64 {
        let of = |t: &&Turn| true_turn(truth, t.from + self.offset, t.to + self.offset);
        let all = self.turns.iter().filter_map(of).map(|w| w.norm());
        median(&mut all.collect::<Vec<f64>>())
    }

    /// Score and information of the offset, and the variance of the score from its scatter between the parts.
    fn equations(&self, truth: &[Pose]) -> (f64, f64, f64) {
        let scale = TUKEY * MAD_TO_SIGMA * self.misfit();
        let (mut information, mut parts) = (0.0, [0.0; PARTS]);
        for (i, (turn, left)) in self.turns.iter().zip(&self.left).enumerate() {
            let at = |shift: f64| {
                let offset = self.offset + shift;
                true_turn(truth, turn.from + offset, turn.to + offset)
            };
            let (Some(before), Some(after)) = (at(-HALF_STEP_S), at(HALF_STEP_S)) else { continue };
            let slope = (after - before) / (2.0 * HALF_STEP_S);
            let far = left.norm() / scale;
            let weight = if far < 1.0 { (1.0 - far * far).powi(2) } else { 0.0 };
            information += weight * slope.norm_squared();
            parts[i * PARTS / self.left.len()] += weight * slope.dot(left);
        }
        let score: f64 = parts.iter().sum();
        let mean = score / PARTS as f64;
        let scatter = parts.iter().map(|p| (p - mean).powi(2)).sum::<f64>();
        (score, information, scatter * PARTS as f64 / (PARTS - 1) as f64)
    }
}

#[cfg(test)]
#[path = "offset_tests.rs"]
mod tests;
