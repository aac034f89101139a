//! The paper's own measurement (Yamaguchi et al. 2016, section II), on the view's first frame:
//! RANSAC plane, z = mean depth of the inliers, theta = angle between optical axis and normal,
//! sigma = standard deviation of the inliers' point-to-plane distances.
//!
//! Its sigma is low by the cut of the tails (1.3 % at three standard deviations) and is measured
//! across the plane: cos(theta) times the axial one for noise along the axis.

use super::Workbench;
use crate::frame::Frame;
use crate::plane::{Plane, Points, RansacOptions, Target, ransac_plane};
use crate::view::View;

/// What the paper's method gives for a view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PaperResult {
    /// Total least squares over the inliers.
    pub plane: Plane,
    /// Mean depth of the inliers, m.
    pub z_m: f64,
    /// Between the optical axis and the plane's normal, rad.
    pub theta_rad: f64,
    /// Standard deviation of the inliers' distances to the plane, m.
    pub sigma_m: f64,
    /// Points within the threshold.
    pub inliers: usize,
    /// Greatest distance of an inlier from its plane, m.
    pub threshold_m: f64,
}

/// In robust standard deviations; the paper does not print its threshold.
const THRESHOLD_SIGMAS: f64 = 3.0;
const MIN_THRESHOLD_M: f64 = 0.001;
const CONFIDENCE: f64 = 0.999;

pub(super) fn measure(
    view: &View,
    bench: &Workbench<'_>,
    target: &Target,
    frame: &Frame,
    sigma_perpendicular_m: f64,
) -> Option<PaperResult> {
    let mut points = Points::default();
    for &i in &target.pixels {
        let i = i as usize;
        let z = bench.table.metres(frame.raw[i]);
        if z.is_finite() {
            points.push(bench.rays.x[i] * z, bench.rays.y[i] * z, z);
        }
    }
    let threshold_m = bench
        .options
        .ransac_threshold_m
        .unwrap_or((THRESHOLD_SIGMAS * sigma_perpendicular_m).max(MIN_THRESHOLD_M));
    let options = RansacOptions {
        threshold_m,
        iterations: bench.options.ransac_iterations,
        confidence: CONFIDENCE,
    };
    let mut rng = bench.options.seed.stream(&format!("ransac/{}", view.name));
    let found = ransac_plane(&points, &options, &mut rng)?;
    Some(PaperResult {
        plane: found.plane,
        z_m: found.z_m,
        theta_rad: found.plane.theta(),
        sigma_m: found.sigma_m,
        inliers: found.inliers,
        threshold_m,
    })
}
