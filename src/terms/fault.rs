//! Checks of a term that comes from a file.

use std::f64::consts::FRAC_PI_2;

use super::basis::{Basis, TABLE};
use super::coordinate::Coordinate;
use super::modulation::Modulation;
use super::{Statistic, Term};
use crate::frame::FARTHEST_M;
use crate::units::shortest;

/// Most nodes along one axis, and harmonics or orders of a series: more than any fit has. A file that asks
/// for more is damaged, and believing it would cost memory.
const MAX_NODES: usize = 4096;
const MAX_ORDERS: usize = 16;
/// Degrees of a polynomial of two coordinates.
const DEGREES: std::ops::RangeInclusive<usize> = 2..=4;

/// Largest end or period of an axis, in its unit: four months in s, more than any other axis has.
const MAX_END: f64 = 1e7;
/// Smallest period or width; a finer one lies between two samples of any axis.
const MIN_PERIOD: f64 = 1e-4;
/// Largest coefficient of a series, in the units of its order. Fits reach some thousands.
const MAX_COEFFICIENT: f64 = 1e6;
/// Depths for a shape's pivot or unit, m.
const PIVOT_M: [f64; 2] = [1e-2, FARTHEST_M];
const BLUR_PX: [f64; 2] = [1e-6, 1e4];
/// Of the room's light: a sensor that sees nothing else at a thousandth of an office's.
const MAX_AMBIENT: f64 = 1e6;
const MAX_POWER: f64 = 16.0;
const FOCAL_PX: [f64; 2] = [1.0, 1e6];
const PICTURE_PX: [f64; 2] = [2.0, 65_536.0];

/// Largest bias, px: wider than any image.
const MAX_BIAS_PX: f64 = 1e4;
/// A standard deviation three million times as large.
const MAX_NEPERS: f64 = 30.0;

impl Term {
    /// Returns what is wrong with it, if anything.
    pub fn fault(&self) -> Option<String> {
        if !matches!(self.statistic, Statistic::Bias | Statistic::Variance) {
            return Some("a shape is a bias or a variance".into());
        }
        let wrong = self.basis.fault();
        let (given, needed) = (self.coefficients.len(), || self.basis.count());
        wrong
            .or_else(|| {
                (given != needed())
                    .then(|| format!("{given} coefficients where its basis has {}", needed()))
            })
            .or_else(|| finite("a coefficient", &self.coefficients))
            .or_else(|| self.absurd())
    }

    /// Checks the size of the coefficients; values at nodes are errors of disparity or logarithms of a
    /// variance.
    fn absurd(&self) -> Option<String> {
        let (max, unit) = match self.statistic {
            _ if !self.basis.has_nodes() => (MAX_COEFFICIENT, "in its units"),
            Statistic::Bias => (MAX_BIAS_PX, "px"),
            _ => (MAX_NEPERS, "nepers of variance"),
        };
        let off = self.coefficients.iter().find(|c| c.abs() > max)?;
        Some(format!("a coefficient of {} is not within {max} {unit}", shortest(*off)))
    }
}

impl Basis {
    fn has_nodes(&self) -> bool {
        use Basis::{Curve, Level, Map, Pair, Ring, Spline, Table};
        matches!(
            self,
            Curve { .. }
                | Level
                | Map { .. }
                | Pair { .. }
                | Ring { .. }
                | Spline { .. }
                | Table { .. }
        )
    }

    /// Returns what is wrong with its parameters, if anything.
    pub fn fault(&self) -> Option<String> {
        let places = self.over().into_iter().flatten().find_map(Coordinate::fault);
        places.or_else(|| self.times().fault()).or_else(|| self.own_fault())
    }

    fn own_fault(&self) -> Option<String> {
        match self {
            Basis::Level | Basis::Log1p { .. } | Basis::Affine { .. } => None,
            Basis::Powers { orders, .. } => some_orders(*orders),
            Basis::Lens { reference_px, orders, .. } => {
                within("reference_px", &[*reference_px], [0.0, MAX_BIAS_PX])
                    .or_else(|| some_orders(*orders))
            }
            Basis::Polynomial { degree, .. } => {
                (!DEGREES.contains(degree)).then(|| format!("degree = {degree} is not from 2 to 4"))
            }
            Basis::Waves { period, harmonics, .. } => {
                within("period", &[*period], [MIN_PERIOD, MAX_END])
                    .or_else(|| some_orders(*harmonics))
            }
            Basis::Decay { width, .. } => within("width", &[*width], [MIN_PERIOD, MAX_END]),
            Basis::Table { z_m, theta_rad, columns } => rising(z_m[0], z_m[1])
                .or_else(|| rising(theta_rad[0], theta_rad[1]))
                .or_else(|| within("z_m", z_m, [0.0, FARTHEST_M]))
                .or_else(|| within("theta_rad", theta_rad, [0.0, FRAC_PI_2]))
                .or_else(|| columns.iter().find_map(|column| table(column))),
            Basis::Curve { low, high, nodes, .. } => {
                rising(*low, *high).or_else(|| some_nodes(&[*nodes]))
            }
            Basis::Ring { period, nodes, .. } => {
                within("period", &[*period], [MIN_PERIOD, MAX_END])
                    .or_else(|| some_nodes(&[*nodes]))
            }
            Basis::Map { width, height, across, down, .. } => {
                picture(*width, *height, [*across, *down])
            }
            Basis::Spline { width, height, across, down, .. } => {
                picture(*width, *height, [*across, *down]).or_else(|| {
                    (*across < 4 || *down < 4).then(|| "a cubic spline has 4 nodes or more".into())
                })
            }
            Basis::Pair { low, high, nodes, .. } => rising(low[0], high[0])
                .or_else(|| rising(low[1], high[1]))
                .or_else(|| some_nodes(nodes)),
        }
    }
}

impl Coordinate {
    fn fault(self) -> Option<String> {
        match self {
            Coordinate::LogRatio(pivot_m) => within("its pivot", &[pivot_m], PIVOT_M),
            Coordinate::DepthPower { unit_m, power } => {
                within("its unit of depth", &[unit_m], PIVOT_M)
                    .or_else(|| within("its power of the depth", &[power], [-MAX_POWER, MAX_POWER]))
            }
            Coordinate::Blur(lateral_px) | Coordinate::TiltBlur(lateral_px) => {
                within("its blur", &[lateral_px], BLUR_PX)
            }
            Coordinate::Ambient(ratio) => {
                within("its share of the room's light", &[ratio], [0.0, MAX_AMBIENT])
            }
            _ => None,
        }
    }
}

impl Modulation {
    fn fault(self) -> Option<String> {
        match self {
            Modulation::DisparityPower(power) => {
                within("its power of the disparity", &[power], [-MAX_POWER, MAX_POWER])
            }
            Modulation::TiltPower(power) => (!(0..=MAX_ORDERS as i32).contains(&power))
                .then(|| format!("its power of the tilt, {power}, is not from 0 to {MAX_ORDERS}")),
            Modulation::RadialSlope { fx, fy } => within("fx or fy", &[fx, fy], FOCAL_PX),
            _ => None,
        }
    }
}

fn finite(name: &str, values: &[f64]) -> Option<String> {
    values.iter().any(|v| !v.is_finite()).then(|| format!("{name} is not finite"))
}

fn within(name: &str, values: &[f64], [low, high]: [f64; 2]) -> Option<String> {
    let off = values.iter().find(|v| !(low..=high).contains(*v))?;
    Some(format!("{name} = {} is not from {low} to {high}", shortest(*off)))
}

fn rising(low: f64, high: f64) -> Option<String> {
    within("low or high", &[low, high], [-MAX_END, MAX_END]).or_else(|| {
        (low >= high).then(|| "its axis must rise from a lower to a higher end".to_string())
    })
}

fn some_orders(orders: usize) -> Option<String> {
    (!(1..=MAX_ORDERS).contains(&orders))
        .then(|| format!("{orders} orders or harmonics are not from 1 to {MAX_ORDERS}"))
}

fn some_nodes(nodes: &[usize]) -> Option<String> {
    let bad = nodes.iter().find(|n| !(2..=MAX_NODES).contains(*n))?;
    Some(format!("{bad} nodes are not from 2 to {MAX_NODES}"))
}

fn picture(width: f64, height: f64, nodes: [usize; 2]) -> Option<String> {
    within("width or height", &[width, height], PICTURE_PX).or_else(|| some_nodes(&nodes))
}

fn table(column: &[f64]) -> Option<String> {
    let (given, needed) = (column.len(), TABLE * TABLE);
    (given != needed)
        .then(|| format!("a table of {given} numbers where {needed} are needed"))
        .or_else(|| finite("a number of a table", column))
}
