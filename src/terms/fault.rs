//! What can be wrong with a term that comes from a file.

use super::basis::{Basis, TABLE};
use super::{Statistic, Term};

/// Nodes along one axis, and harmonics or orders of a family: more than any fit has; a file that
/// asks for more is damaged, and would be believed with memory.
const MOST_NODES: usize = 4096;
const MOST_ORDERS: usize = 16;
/// Powers of right and down that a board's shape knows.
const BOW_DEGREES: std::ops::RangeInclusive<usize> = 2..=4;

impl Term {
    /// What is wrong with it, if anything.
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
    }
}

impl Basis {
    /// What is wrong with the numbers that settle it, if anything.
    pub fn fault(&self) -> Option<String> {
        match self {
            Basis::Bowl { disparity_power, orders } => {
                finite("disparity_power", &[*disparity_power]).or_else(|| some_orders(*orders))
            }
            Basis::Lens { fx, fy, orders } => {
                positive("fx and fy", &[*fx, *fy]).or_else(|| some_orders(*orders))
            }
            Basis::Vignetting { orders } => some_orders(*orders),
            Basis::Bow { degree } => (!BOW_DEGREES.contains(degree))
                .then(|| format!("degree = {degree} is not from 2 to 4")),
            Basis::Locking { period_px, .. } => positive("period_px", &[*period_px]),
            Basis::Banding { period_px, harmonics } => {
                positive("period_px", &[*period_px]).or_else(|| some_orders(*harmonics))
            }
            Basis::EdgeMixing { width_px } => positive("width_px", &[*width_px]),
            Basis::RangeExponent { pivot_m, .. } => positive("pivot_m", &[*pivot_m]),
            Basis::SlopeNoise { lateral_px } => positive("lateral_px", &[*lateral_px]),
            Basis::TiltAxis { tilt_power } => (!(0..=MOST_ORDERS as i32).contains(tilt_power))
                .then(|| format!("tilt_power = {tilt_power} is not from 0 to {MOST_ORDERS}")),
            Basis::Ambient { ratio } => (!(ratio.is_finite() && *ratio >= 0.0))
                .then(|| "ratio must not be negative".to_string()),
            Basis::Recalibrate { z_m, theta_rad, columns } => rising(z_m[0], z_m[1])
                .or_else(|| rising(theta_rad[0], theta_rad[1]))
                .or_else(|| columns.iter().find_map(|column| table(column))),
            Basis::Curve { low, high, nodes, .. } => {
                rising(*low, *high).or_else(|| some_nodes(&[*nodes]))
            }
            Basis::Ring { period, nodes, .. } => {
                positive("period", &[*period]).or_else(|| some_nodes(&[*nodes]))
            }
            Basis::Map { width, height, across, down, .. } => [width, height]
                .iter()
                .any(|side| !(side.is_finite() && **side >= 2.0))
                .then(|| "width and height must be 2 px or more".to_string())
                .or_else(|| some_nodes(&[*across, *down])),
            Basis::Spline { width, height, across, down, .. } => [width, height]
                .iter()
                .any(|side| !(side.is_finite() && **side >= 2.0))
                .then(|| "width and height must be 2 px or more".to_string())
                .or_else(|| some_nodes(&[*across, *down]))
                .or_else(|| {
                    (*across < 4 || *down < 4).then(|| "a cubic spline has 4 nodes or more".into())
                }),
            Basis::Affine { disparity_power } => finite("disparity_power", &[*disparity_power]),
            Basis::Pair { low, high, nodes, .. } => rising(low[0], high[0])
                .or_else(|| rising(low[1], high[1]))
                .or_else(|| some_nodes(nodes)),
            Basis::RangeNotDepth | Basis::Intensity { .. } | Basis::Level => None,
        }
    }
}

fn finite(name: &str, values: &[f64]) -> Option<String> {
    values.iter().any(|v| !v.is_finite()).then(|| format!("{name} is not finite"))
}

fn positive(name: &str, values: &[f64]) -> Option<String> {
    let good = values.iter().all(|v| v.is_finite() && *v > 0.0);
    (!good).then(|| format!("{name} must be positive"))
}

fn rising(low: f64, high: f64) -> Option<String> {
    let good = low.is_finite() && high.is_finite() && low < high;
    (!good).then(|| "its axis must rise from a lower to a higher end".to_string())
}

fn some_orders(orders: usize) -> Option<String> {
    (!(1..=MOST_ORDERS).contains(&orders))
        .then(|| format!("{orders} orders or harmonics are not from 1 to {MOST_ORDERS}"))
}

fn some_nodes(nodes: &[usize]) -> Option<String> {
    let bad = nodes.iter().find(|n| !(2..=MOST_NODES).contains(*n))?;
    Some(format!("{bad} nodes are not from 2 to {MOST_NODES}"))
}

fn table(column: &[f64]) -> Option<String> {
    let (given, needed) = (column.len(), TABLE * TABLE);
    (given != needed)
        .then(|| format!("a table of {given} numbers where {needed} are needed"))
        .or_else(|| finite("a number of a table", column))
}
