//! Absolute trajectory error: evaluate_ate.py.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::spread::{Spread, too_few};
use crate::error::Result;
use crate::trajectory::{Pose, associate};

/// Distances of associated positions after alignment.
#[derive(Debug, Clone, PartialEq)]
pub struct Ate {
    /// m.
    pub error: Spread,
    /// What was aligned: the estimate's world in the true one.
    pub truth_from_estimate: Isometry3<f64>,
    /// Stamp of the estimate, s, and its distance, m.
    pub each: Vec<(f64, f64)>,
}

/// Fewer positions determine no rotation.
const MIN_PAIRS: usize = 3;
/// Stamps of one moment differ by less, s (the scripts' `max_difference`).
const MAX_DIFFERENCE_S: f64 = 0.02;

/// Of poses in time order.
///
/// # Errors
/// When fewer than three of them belong to the same moments.
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

/// The rigid motion that brings the second points nearest to the first, in the least squares sense
/// (Horn 1987; by singular values as in the script). `None` of fewer than three pairs.
pub fn align(pairs: &[(Vector3<f64>, Vector3<f64>)]) -> Option<Isometry3<f64>> {
    if pairs.len() < MIN_PAIRS {
        return None;
    }
    let n = pairs.len() as f64;
    let to = pairs.iter().map(|p| p.0).sum::<Vector3<f64>>() / n;
    let from = pairs.iter().map(|p| p.1).sum::<Vector3<f64>>() / n;
    let spread: Matrix3<f64> = pairs.iter().map(|p| (p.0 - to) * (p.1 - from).transpose()).sum();
    let svd = spread.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    // A reflection fits better than any rotation: turn the least certain axis over.
    let hand = if u.determinant() * v_t.determinant() < 0.0 { -1.0 } else { 1.0 };
    let turn = u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, hand)) * v_t;
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turn));
    Some(Isometry3::from_parts(Translation3::from(to - rotation * from), rotation))
}
