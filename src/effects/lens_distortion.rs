//! A pixel's ray is not the pinhole's.

use super::{Bounds, Card, Draw, Effect, Estimate, Exposure, Fitted, Known, Parameter, Settings, Smallest, Stage, slope_in_square};
use crate::camera::Camera;
use crate::sensors::SensorKind;
use crate::terms::{Basis, Coordinate, Modulation, Term};

pub struct LensDistortion;

pub(super) static CARD: Card = Card {
    id: "lens-distortion",
    title: "uncorrected lens distortion",
    stage: Stage::Optics,
    summary: "the lens bends rays, so that a pixel looks elsewhere than the pinhole says, which tilted planes show; a matcher that looks through it also finds its shifts against the reference stretched",
    parameters: &[Parameter {
        name: "k1",
        range: [-0.2, 0.2],
        typical: -0.05,
        summary: "radial coefficient of Brown and Conrady that the calibration lacks",
    }],
    statistic: "bias",
    axis: "radius",
    confused_with: "radial-disparity-bias, which is as large along rows as along columns; target-bow, which stays with the board",
    reference: "Brown 1966; Burrus, Kinect calibration: k1 = -0.26 before correction",
    formula_error: 0.03,
    // Residual k1 of a calibrated depth picture (Khoshelham and Elberink 2012, table 1: 0.003; Smisek,
    // Jancosek and Pajdla 2011: 0.01 to 0.05).
    usual: 0.02,
    ..Card::BASE
};

impl Effect for LensDistortion {
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let k1 = settings.at(0);
        for i in 0..exposure.pixels() {
            let true_ray = undistorted(exposure.rays.at(i), k1);
            exposure.depth[i] = exposure.meet(i, true_ray, 0.0) as f32;
        }
    }

    fn shapes(&self, bounds: &Bounds) -> Vec<Basis> {
        let mut all: Vec<Basis> =
            [1, 2, 4].map(|orders| bent(bounds.camera, orders)).into();
        if bounds.kind.is_none_or(|k| k == SensorKind::StructuredLight) {
            // The reference was recorded within the sensor's working range.
            let [low, high] = bounds.reach.disparity;
            for reference_px in [low, (low * high).sqrt(), high] {
                all.extend([1, 2, 4].map(|orders| matched(bounds.camera, reference_px, orders)));
            }
        }
        all
    }

    fn estimates(&self, fit: &Fitted) -> Vec<Estimate> {
        // c1 r^2 + c2 r^4 + .. of the ray, expressed as k1 r^2.
        let radial =
            |b: &[f64], r: f64| b.iter().rev().fold(0.0, |sum, c| (sum + c) * r * r);
        vec![fit.estimate("k1", &|b| slope_in_square(|r| radial(b, r), 0.6))]
    }

    fn term(&self, known: Known, camera: &Camera) -> Option<Term> {
        Some(Term::bias(bent(camera, 1), vec![known("k1")?]))
    }

    fn smallest(&self, bounds: &Bounds) -> Option<Smallest> {
        let shape = bent(bounds.camera, 1);
        Some(Smallest { parameter: "k1", shape, unit: vec![1.0], of: |a| a })
    }
}

/// The ray that a lens with `k1` images at (x, y), by Newton's method, which approaches the radius from one
/// side. NaN where there is none: a lens with k1 < 0 images no ray beyond 2 / (3 sqrt(-3 k1)).
fn undistorted((xd, yd): (f64, f64), k1: f64) -> (f64, f64) {
    let imaged = xd.hypot(yd);
    if k1 < 0.0 && imaged > 2.0 / (3.0 * (-3.0 * k1).sqrt()) {
        return (f64::NAN, f64::NAN);
    }
    let mut r = imaged;
    for _ in 0..ITERATIONS {
        let square = k1 * r * r;
        r -= (r * (1.0 + square) - imaged) / (1.0 + 3.0 * square).max(f64::MIN_POSITIVE);
    }
    let radial = 1.0 + k1 * r * r;
    (xd / radial, yd / radial)
}

/// At the fold itself each iteration halves the error, elsewhere it squares it.
const ITERATIONS: usize = 20;

/// Like [`bent`], where a matcher looks through the lens: it finds the shift between two spots that are
/// both displaced, and a larger shift is stretched more.
fn matched(camera: &Camera, reference_px: f64, orders: usize) -> Basis {
    Basis::Lens { fx: camera.fx, fy: camera.fy, reference_px, orders }
}

/// Rays shifted along the radius, seen through the slope of the target.
fn bent(camera: &Camera, orders: usize) -> Basis {
    let times = Modulation::RadialSlope { fx: camera.fx, fy: camera.fy };
    Basis::powers(Coordinate::RaySquared, orders, times)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With k1 = -0.2 no ray is imaged beyond 0.861.
    #[test]
    fn beyond_the_fold_of_a_lens_there_is_no_ray() {
        for angle in [0.0f64, 0.7, 2.0] {
            let at = |r: f64| undistorted((r * angle.cos(), r * angle.sin()), -0.2);
            let (x, y) = at(0.69);
            let r2 = x * x + y * y;
            assert!((r2.sqrt() * (1.0 - 0.2 * r2) - 0.69).abs() < 1e-6, "{x} {y}");
            let wide = undistorted((2.4 * angle.cos(), 2.4 * angle.sin()), 0.2);
            let r2 = wide.0 * wide.0 + wide.1 * wide.1;
            assert!((r2.sqrt() * (1.0 + 0.2 * r2) - 2.4).abs() < 1e-9, "{wide:?}");
            for r in [0.9, 1.0, 1.08, 1.3] {
                assert!(at(r).0.is_nan(), "{r}: {:?}", at(r));
            }
        }
    }
}
