//! Coordinates that a shape runs over: numbers of the measured place.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::needs::Needs;
use super::place::{Axis, FLATTEST, PixelContext};

/// A number of a place.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Coordinate {
    Column,
    Row,
    Radius,
    RadiusSquared,
    /// Of the ray, off the optical axis.
    RaySquared,
    /// Depth over the length of the ray, less one.
    Foreshortening,
    Z,
    LogZ,
    /// Logarithm of the depth over this one, m.
    LogRatio(f64),
    /// Depth in units of `unit_m`, to a power.
    DepthPower {
        unit_m: f64,
        power: f64,
    },
    Disparity,
    Right,
    Down,
    /// From the origin of the target's own coordinates, m^2.
    TargetRadiusSquared,
    Edge,
    Theta,
    Azimuth,
    /// Along the direction in which depth grows, from the optical axis, in rays' units.
    Along,
    /// From one where the tilt is along the baseline to minus one across it.
    Alignment,
    /// From one where the tilt is along the baseline to zero across it.
    AlongBaseline,
    /// Variance that a blur of the place by so many px brings through the slope, over the model's.
    Blur(f64),
    /// The same by the depth and the tilt alone: z tan(theta) of every ray, where the slope of a plane is that of
    /// its middle on all of them (Nguyen, Izadi and Lovell 2012).
    TiltBlur(f64),
    Session,
    Temperature,
    Light,
    LogLight,
    /// Light of the room over the pattern's, where it is this in an office at 1 m.
    Ambient(f64),
}

/// Illuminance on an office desk (EN 12464-1), lx: the unit of the room's light.
pub const ROOM_LUX: f64 = 500.0;
/// Darkest surface, relative to the recording's median.
pub const DARKEST: f64 = 1e-2;

impl Coordinate {
    pub fn value(self, p: &PixelContext) -> f64 {
        match self {
            Coordinate::Column => p.u,
            Coordinate::Row => p.v,
            Coordinate::Radius => p.radius,
            Coordinate::RadiusSquared => p.radius * p.radius,
            Coordinate::RaySquared => p.x * p.x + p.y * p.y,
            Coordinate::Foreshortening => 1.0 / (1.0 + p.x * p.x + p.y * p.y).sqrt() - 1.0,
            Coordinate::Z => p.z,
            Coordinate::LogZ => p.z.ln(),
            Coordinate::LogRatio(pivot_m) => (p.z / pivot_m).ln(),
            Coordinate::DepthPower { unit_m, power } => (p.z / unit_m).powf(power),
            Coordinate::Disparity => p.disparity,
            Coordinate::Right => p.right,
            Coordinate::Down => p.down,
            Coordinate::TargetRadiusSquared => p.right * p.right + p.down * p.down,
            Coordinate::Edge => p.edge,
            Coordinate::Theta => p.theta,
            Coordinate::Azimuth => p.azimuth,
            Coordinate::Along => p.x * p.azimuth.cos() + p.y * p.azimuth.sin(),
            Coordinate::Alignment => (2.0 * p.azimuth).cos(),
            Coordinate::AlongBaseline => p.azimuth.cos().powi(2),
            Coordinate::Blur(lateral_px) => {
                let slope2 = p.slope[0].powi(2) + p.slope[1].powi(2);
                lateral_px * lateral_px * slope2 / p.variance
            }
            Coordinate::TiltBlur(lateral_px) => {
                let middle = p.rho / p.theta.cos().max(FLATTEST);
                Coordinate::Blur(lateral_px).value(p) * (middle / p.z).powi(2)
            }
            Coordinate::Session => p.session_s,
            Coordinate::Temperature => p.temperature_c,
            Coordinate::Light => p.light,
            Coordinate::LogLight => p.light.max(DARKEST).ln(),
            Coordinate::Ambient(ratio) => ratio * p.ambient / ROOM_LUX * p.pattern_fall_off(),
        }
    }

    pub fn axis(self) -> Axis {
        match self {
            Coordinate::Column => Axis::Column,
            Coordinate::Row => Axis::Row,
            Coordinate::Radius | Coordinate::RadiusSquared => Axis::Radius,
            Coordinate::RaySquared | Coordinate::Foreshortening => Axis::Radius,
            Coordinate::Z | Coordinate::LogZ | Coordinate::LogRatio(_) => Axis::Z,
            Coordinate::Disparity | Coordinate::DepthPower { .. } => Axis::Z,
            Coordinate::Right | Coordinate::Down => Axis::TargetPosition,
            Coordinate::TargetRadiusSquared => Axis::TargetPosition,
            Coordinate::Edge => Axis::EdgeDistance,
            Coordinate::Theta | Coordinate::Blur(_) | Coordinate::TiltBlur(_) => Axis::Theta,
            Coordinate::Azimuth | Coordinate::Along => Axis::Azimuth,
            Coordinate::Alignment | Coordinate::AlongBaseline => Axis::Azimuth,
            Coordinate::Session => Axis::SessionTime,
            Coordinate::Temperature => Axis::Temperature,
            Coordinate::Light | Coordinate::LogLight | Coordinate::Ambient(_) => Axis::Intensity,
        }
    }

    pub(super) fn needs(self) -> Needs {
        match self {
            Coordinate::Column | Coordinate::Row => Needs::PIXEL,
            Coordinate::Radius | Coordinate::RadiusSquared => Needs::PIXEL,
            Coordinate::RaySquared | Coordinate::Foreshortening => Needs::PIXEL,
            Coordinate::Z | Coordinate::LogZ | Coordinate::LogRatio(_) => Needs::DEPTH,
            Coordinate::Disparity | Coordinate::DepthPower { .. } => Needs::DEPTH,
            Coordinate::Theta | Coordinate::Azimuth | Coordinate::Along => Needs::SURFACE,
            Coordinate::Alignment | Coordinate::AlongBaseline => Needs::SURFACE,
            Coordinate::Blur(_) | Coordinate::TiltBlur(_) => Needs::SURFACE,
            Coordinate::Ambient(_) => Needs::SURFACE,
            Coordinate::Right | Coordinate::Down | Coordinate::Edge => Needs::BOARD,
            Coordinate::TargetRadiusSquared => Needs::BOARD,
            Coordinate::Session => Needs { session: true, ..Needs::PIXEL },
            Coordinate::Temperature => Needs { temperature: true, ..Needs::PIXEL },
            Coordinate::Light | Coordinate::LogLight => Needs { light: true, ..Needs::PIXEL },
        }
    }

    /// Whether a shape over it is fixed in the picture. What follows the ray is geometry, and the same for
    /// every camera.
    pub(super) fn is_of_picture(self) -> bool {
        matches!(
            self,
            Coordinate::Column | Coordinate::Row | Coordinate::Radius | Coordinate::RadiusSquared
        )
    }

    /// Whether it is depth or tilt, which sigma is a function of.
    pub(super) fn is_of_sigma(self) -> bool {
        matches!(self, Coordinate::Theta | Coordinate::TiltBlur(_))
            || matches!(self.alone(), Some(Coordinate::Disparity))
            || matches!(self, Coordinate::LogRatio(_) | Coordinate::DepthPower { .. })
    }

    /// Coordinate by which samples of one value are grouped.
    pub(super) fn alone(self) -> Option<Coordinate> {
        match self {
            Coordinate::Column | Coordinate::Row | Coordinate::Edge => Some(self),
            Coordinate::Disparity | Coordinate::Z | Coordinate::LogZ => Some(Coordinate::Disparity),
            _ => None,
        }
    }
}
