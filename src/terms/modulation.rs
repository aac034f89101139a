//! Factors that a shape is multiplied by.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::needs::Needs;
use super::place::PixelContext;

/// Disparity at which a term that grows with a power of the disparity is in px: a Kinect at 1.1 m.
pub const DISPARITY_UNIT_PX: f64 = 40.0;

/// A factor that changes from place to place.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Modulation {
    One,
    /// The disparity, px.
    Disparity,
    /// The square of the disparity in units of 40 px: a constant error of depth's own shape.
    DisparitySquared,
    /// Another power of it, in the same units.
    DisparityPower(f64),
    /// Disparity over the plane's distance: a lift of the surface along its normal, m.
    Lift,
    /// Sine of the tilt: what a frontal plane does not show.
    Tilt,
    /// Its powers.
    TiltPower(i32),
    /// Square of the target's slope, tan(tilt)^2, no further than anything is seen.
    SlopeSquared,
    /// By how much the target's disparity changes along the ray, off the optical axis, px.
    RadialSlope {
        fx: f64,
        fy: f64,
    },
}

/// Factor of a shape that grows with this power of the disparity, at a disparity in px.
pub(crate) fn disparity_power(power: f64, disparity: f64) -> f64 {
    let x = disparity / DISPARITY_UNIT_PX;
    if power == 2.0 { x * x } else { x.powf(power) }
}

impl Modulation {
    /// Largest squared slope, at 80 degrees: Nguyen, Izadi and Lovell 2012 see nothing beyond.
    pub const STEEPEST: f64 = 32.2;

    /// A power of the disparity.
    pub fn power(disparity_power: f64) -> Self {
        if disparity_power == 0.0 {
            Modulation::One
        } else {
            Modulation::DisparityPower(disparity_power)
        }
    }

    /// Same, with the square multiplied out.
    pub fn still(disparity_power: f64) -> Self {
        if disparity_power == 2.0 {
            Modulation::DisparitySquared
        } else {
            Modulation::power(disparity_power)
        }
    }

    pub(super) fn value(self, p: &PixelContext) -> f64 {
        match self {
            Modulation::One => 1.0,
            Modulation::Disparity => p.disparity,
            Modulation::DisparitySquared => disparity_power(2.0, p.disparity),
            Modulation::DisparityPower(power) => disparity_power(power, p.disparity),
            Modulation::Lift => p.disparity / p.rho,
            Modulation::Tilt => p.theta.sin(),
            Modulation::TiltPower(power) => p.theta.sin().powi(power),
            Modulation::SlopeSquared => p.theta.tan().powi(2).min(Self::STEEPEST),
            Modulation::RadialSlope { fx, fy } => -(p.slope[0] * p.x * fx + p.slope[1] * p.y * fy),
        }
    }

    pub(super) fn needs(self) -> Needs {
        match self {
            Modulation::One => Needs::PIXEL,
            Modulation::Disparity
            | Modulation::DisparitySquared
            | Modulation::DisparityPower(_) => Needs::DEPTH,
            Modulation::Lift
            | Modulation::Tilt
            | Modulation::TiltPower(_)
            | Modulation::SlopeSquared => Needs::SURFACE,
            Modulation::RadialSlope { .. } => Needs { slope: true, ..Needs::PIXEL },
        }
    }

    /// Power of the disparity that it is, in its units.
    pub fn power_of_disparity(self) -> Option<f64> {
        match self {
            Modulation::One => Some(0.0),
            Modulation::DisparitySquared => Some(2.0),
            Modulation::DisparityPower(power) => Some(power),
            _ => None,
        }
    }
}
