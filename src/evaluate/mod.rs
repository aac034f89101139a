//! Compares an estimated trajectory with the true one as the scripts of the TUM RGB-D benchmark do
//! (Sturm, Engelhard, Endres, Burgard, Cremers, "A benchmark for the evaluation of RGB-D SLAM systems",
//! IROS 2012).
//!
//! * ATE: distances of associated positions after the best rigid alignment ([`align`], no scale).
//! * RPE: estimated against true motion over a fixed interval; needs no alignment.

mod offset;
mod rpe;

pub use offset::{ClockOffset, clock_offset};
pub use rpe::{Delta, Rpe, relative};

use nalgebra::{
    Isometry3, Matrix3, Matrix4, Quaternion, SymmetricEigen, Translation3, UnitQuaternion, Vector3,
};

use serde_json::{Value, json};

use crate::error::{Error, Result};
use crate::stats::median;
use crate::trajectory::{Pose, associate};

#[derive(Debug, Clone, PartialEq)]
pub struct Evaluation {
    pub ate: Ate,
    pub rpe: Rpe,
    /// Offset to add to the estimate's stamps, where it can be determined.
    pub offset: Option<ClockOffset>,
    /// Remarks on anything unusual.
    pub remarks: Vec<String>,
}

/// Evaluates poses in time order.
/// Fails if too few of them belong to the same moments.
pub fn evaluate(truth: &[Pose], estimate: &[Pose], delta: Delta) -> Result<Evaluation> {
    let offset = clock_offset(truth, estimate);
    let told = offset.filter(ClockOffset::is_significant).map(|o| {
        let way = if o.seconds > 0.0 { "behind" } else { "ahead of" };
        format!(
            "the estimate's clock is {:.1} ± {:.1} ms {way} the truth's, by how both turn",
            1e3 * o.seconds.abs(),
            1e3 * o.std_error_s
        )
    });
    let short = rpe::is_too_short(estimate, delta).then(|| {
        "most intervals of --delta are shorter than half the time between two poses: a motion then ends where it begins, and counts as one without error; give a longer one"
            .to_string()
    });
    let remarks = swapped(truth, estimate).into_iter().chain(told).chain(short).collect();
    Ok(Evaluation {
        ate: absolute(truth, estimate)?,
        rpe: relative(truth, estimate, delta)?,
        offset,
        remarks,
    })
}

/// Remark if the two seem to be swapped. Estimates begin at the identity, as this program's do, or have a
/// pose per image; true trajectories are in laboratory coordinates and several times as dense.
fn swapped(truth: &[Pose], estimate: &[Pose]) -> Option<String> {
    let at_identity = |poses: &[Pose]| {
        poses.first().is_some_and(|pose| {
            let Isometry3 { translation, rotation } = pose.world_from_camera;
            translation.vector.norm() < AT_IDENTITY && rotation.angle() < AT_IDENTITY
        })
    };
    let interval_s = |poses: &[Pose]| {
        median(&mut poses.windows(2).map(|w| w[1].stamp - w[0].stamp).collect::<Vec<f64>>())
    };
    let (of_truth, of_estimate) = (interval_s(truth), interval_s(estimate));
    const ASK: &str = "are --truth and --estimate swapped?";
    if at_identity(truth) && !at_identity(estimate) {
        let sign =
            "the truth begins at the identity, as an estimate does, and the estimate does not";
        return Some(format!("{sign}: {ASK}"));
    }
    (!at_identity(estimate) && of_truth > DENSER * of_estimate).then(|| {
        let [truth, estimate] = [of_truth, of_estimate].map(|s| 1e3 * s);
        format!("the truth has a pose every {truth:.0} ms and the estimate every {estimate:.0} ms: {ASK}")
    })
}

/// Tolerance for a pose printed with six digits, m and rad.
const AT_IDENTITY: f64 = 1e-6;
/// Ratio of intervals that suggests a swap. Motion capture has 100 poses a second, images come 30 times: a
/// ratio of three.
const DENSER: f64 = 2.0;

/// Statistics of a list of errors, in their unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    pub rmse: f64,
    pub mean: f64,
    pub median: f64,
    /// Standard deviation of the population, divided by n.
    pub std: f64,
    pub min: f64,
    pub max: f64,
    pub pairs: usize,
}

impl Spread {
    /// The figures, their names ending in `suffix`, and the number of pairs.
    pub fn json(&self, suffix: &str) -> Value {
        let figures = self.figures().map(|(name, v)| (format!("{name}{suffix}"), json!(v)));
        figures.into_iter().chain([("pairs".into(), json!(self.pairs))]).collect()
    }

    /// `None` for an empty list.
    pub fn of(errors: &[f64]) -> Option<Self> {
        if errors.is_empty() {
            return None;
        }
        let n = errors.len() as f64;
        let mean = errors.iter().sum::<f64>() / n;
        let square = errors.iter().map(|e| e * e).sum::<f64>() / n;
        let variance = errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / n;
        Some(Spread {
            rmse: square.sqrt(),
            mean,
            median: median(&mut errors.to_vec()),
            std: variance.sqrt(),
            min: errors.iter().copied().fold(f64::INFINITY, f64::min),
            max: errors.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            pairs: errors.len(),
        })
    }

    pub fn scaled(&self, factor: f64) -> Self {
        let [rmse, mean, median, std, min, max] = self.figures().map(|(_, v)| v * factor);
        Spread { rmse, mean, median, std, min, max, pairs: self.pairs }
    }

    /// The values with their names, in the order of the TUM scripts.
    pub fn figures(&self) -> [(&'static str, f64); 6] {
        let Spread { rmse, mean, median, std, min, max, .. } = *self;
        let names = ["rmse", "mean", "median", "std", "min", "max"];
        let figures = [rmse, mean, median, std, min, max];
        [0, 1, 2, 3, 4, 5].map(|k| (names[k], figures[k]))
    }
}

/// Error of two trajectories that share too few moments.
fn too_few(truth: &[Pose], estimate: &[Pose], pairs: usize) -> Error {
    let span = |poses: &[Pose]| match (poses.first(), poses.last()) {
        (Some(a), Some(b)) => format!("{:.2} to {:.2} s", a.stamp, b.stamp),
        _ => "nothing".into(),
    };
    Error::NotEnough {
        what: format!(
            "{pairs} poses of the estimate ({}) have a true one ({}) at their time",
            span(estimate),
            span(truth)
        ),
        remedy: "give the ground truth of this very sequence, in the same clock".into(),
    }
}

/// Absolute trajectory error: distances of associated positions after alignment.
#[derive(Debug, Clone, PartialEq)]
pub struct Ate {
    /// m.
    pub error: Spread,
    /// The alignment: the estimate's world in the true one.
    pub truth_from_estimate: Isometry3<f64>,
    /// Stamp of the estimate, s, and its distance from the truth, m.
    pub each: Vec<(f64, f64)>,
}

/// Fewest positions that determine a rotation.
const MIN_PAIRS: usize = 3;
/// Largest difference of associated stamps, s (the scripts' `max_difference`).
const MAX_DIFFERENCE_S: f64 = 0.02;

/// Absolute error of poses in time order.
/// Fails if fewer than three of them belong to the same moments.
pub fn absolute(truth: &[Pose], estimate: &[Pose]) -> Result<Ate> {
    let stamps = |poses: &[Pose]| poses.iter().map(|p| p.stamp).collect::<Vec<f64>>();
    let pairs = associate(&stamps(truth), &stamps(estimate), MAX_DIFFERENCE_S);
    let place = |pose: &Pose| pose.world_from_camera.translation.vector;
    let matched: Vec<(Vector3<f64>, Vector3<f64>)> =
        pairs.iter().map(|p| (place(&truth[p.first]), place(&estimate[p.second]))).collect();
    let Some(truth_from_estimate) = align(&matched) else {
        return Err(too_few(truth, estimate, pairs.len()));
    };
    let distance = |(t, e): &(Vector3<f64>, Vector3<f64>)| {
        (truth_from_estimate.rotation * e + truth_from_estimate.translation.vector - t).norm()
    };
    let errors: Vec<f64> = matched.iter().map(distance).collect();
    let error = Spread::of(&errors).ok_or_else(|| too_few(truth, estimate, 0))?;
    let each = pairs.iter().map(|p| estimate[p.second].stamp).zip(errors).collect();
    Ok(Ate { error, truth_from_estimate, each })
}

/// The rigid motion that maps the second points onto the first in the least-squares sense (Horn 1987). `None`
/// for fewer than three pairs.
pub fn align(pairs: &[(Vector3<f64>, Vector3<f64>)]) -> Option<Isometry3<f64>> {
    if pairs.len() < MIN_PAIRS {
        return None;
    }
    let n = pairs.len() as f64;
    let to = pairs.iter().map(|p| p.0).sum::<Vector3<f64>>() / n;
    let from = pairs.iter().map(|p| p.1).sum::<Vector3<f64>>() / n;
    let spread: Matrix3<f64> = pairs.iter().map(|p| (p.0 - to) * (p.1 - from).transpose()).sum();
    let rotation = nearest_rotation(&spread)?;
    Some(Isometry3::from_parts(Translation3::from(to - rotation * from), rotation))
}

/// Limit for the eigenvalue iteration, which converges in a few steps.
const MAX_ROUNDS: usize = 1000;

/// The rotation from the second vectors to the first, whose sum of outer products is `spread`, by Horn's
/// quaternion. nalgebra's 3 x 3 decomposition squares `spread`, which loses all precision for a path 10,000
/// times as long as it is wide. Also, a quaternion is never a reflection.
fn nearest_rotation(spread: &Matrix3<f64>) -> Option<UnitQuaternion<f64>> {
    let s = |to: usize, from: usize| spread[(to, from)];
    let odd = Vector3::new(s(2, 1) - s(1, 2), s(0, 2) - s(2, 0), s(1, 0) - s(0, 1));
    let trace = spread.trace();
    let even = spread + spread.transpose() - Matrix3::from_diagonal_element(trace);
    let mut horn = Matrix4::zeros();
    horn[(0, 0)] = trace;
    horn.fixed_view_mut::<3, 1>(1, 0).copy_from(&odd);
    horn.fixed_view_mut::<1, 3>(0, 1).copy_from(&odd.transpose());
    horn.fixed_view_mut::<3, 3>(1, 1).copy_from(&even);
    let eigen = SymmetricEigen::try_new(horn, f64::EPSILON, MAX_ROUNDS)?;
    let q = eigen.eigenvectors.column(eigen.eigenvalues.imax());
    Some(UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3])))
}

#[cfg(test)]
mod tests;
