//! The file holds the ray length instead of the depth.

use super::{Bounds, Card, Draw, Effect, Estimate, Exposure, Fitted, Flat, Inverse, Parameter, Settings, Stage};
use crate::camera::Camera;
use crate::terms::{Basis, Coordinate, Modulation, Term};

pub struct RangeNotDepth;

pub(super) static CARD: Card = Card {
    id: "range-not-depth",
    title: "range stored as depth",
    stage: Stage::Driver,
    summary: "the file holds the length of the ray where depth along the axis is expected: a flat wall becomes a bowl",
    parameters: &[Parameter {
        name: "share",
        range: [0.0, 1.0],
        typical: 1.0,
        summary: "how much of the ray length over the depth is in the file",
    }],
    statistic: "bias",
    axis: "radius",
    confused_with: "radial-disparity-bias, which grows with z^2 and has any size: this one grows with z and is z r^2 / (2 f^2), no more and no less",
    reference: "geometry: 1 / cos of the angle off the axis; 5.8 % at 200 px from the middle of a Kinect",
    formula_error: 0.07,
    // A share: all of it or nothing.
    usual: 1.0,
    ..Card::BASE
};

impl Effect for RangeNotDepth {
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let share = settings.at(0);
        for i in 0..exposure.pixels() {
            let (x, y) = exposure.rays.at(i);
            let excess = (1.0 + x * x + y * y).sqrt() - 1.0;
            exposure.depth[i] *= (1.0 + share * excess) as f32;
        }
    }

    fn shapes(&self, _: &Bounds) -> Vec<Basis> {
        vec![RAY_FOR_DEPTH]
    }

    /// A share lies between 0 and 1, or is -1 where the model assumes all of it and the sensor has none.
    /// Anything else is another bowl.
    fn agrees_with(&self, _: Option<&Flat>, _: &Basis, coefficients: &[f64]) -> bool {
        coefficients.iter().all(|&share| {
            (-SHARE_ERROR..=1.0 + SHARE_ERROR).contains(&share) || (share + 1.0).abs() <= SHARE_ERROR
        })
    }

    fn estimates(&self, fit: &Fitted) -> Vec<Estimate> {
        vec![fit.estimate("share", &|b| b[0])]
    }

    fn term(&self, settings: &Settings, _: &Camera) -> Option<Term> {
        Some(Term::bias(RAY_FOR_DEPTH, vec![settings.at(0)]))
    }

    fn inverse(&self, settings: &Settings, _: &Camera) -> Option<Inverse> {
        Some(Inverse::AlongRay { share: settings.at(0) })
    }
}

/// Tolerance of a fitted share, for another cause fitted beside it or the formula's own error.
const SHARE_ERROR: f64 = 0.1;

/// Shortfall of the disparity where the ray length is taken for the depth.
pub const RAY_FOR_DEPTH: Basis = Basis::powers(Coordinate::Foreshortening, 1, Modulation::Disparity);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bowl_that_no_ray_makes_is_another() {
        let meant = |share| RangeNotDepth.agrees_with(None, &RAY_FOR_DEPTH, &[share]);
        assert!([0.05, 0.5, 1.0, 1.05, -1.0].into_iter().all(meant));
        assert!(![1.4, -0.5, -1.4].into_iter().any(meant));
    }
}
