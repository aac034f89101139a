//! A pixel's ray is not the pinhole's.

use super::{Bounds, Card, Draw, Effect, Estimate, Exposure, Fitted, Parameter, Settings, Smallest, Stage, slope_in_square};
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
        // A unit camera, whose pixel coordinates are the normalised ones.
        let lens = Camera { distortion: Some([k1, 0.0, 0.0, 0.0, 0.0]), ..Camera::centred(1, 1, 1.0) };
        for i in 0..exposure.pixels() {
            let (x, y) = exposure.rays.at(i);
            exposure.depth[i] = exposure.meet(i, lens.ray(x, y), 0.0) as f32;
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

    fn term(&self, settings: &Settings, camera: &Camera) -> Option<Term> {
        Some(Term::bias(bent(camera, 1), vec![settings.at(0)]))
    }

    fn smallest(&self, bounds: &Bounds) -> Option<Smallest> {
        let shape = bent(bounds.camera, 1);
        Some(Smallest { parameter: "k1", shape, unit: vec![1.0], of: |a| a })
    }
}

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
