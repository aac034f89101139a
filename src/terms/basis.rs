//! Shapes of terms: a few kinds, each over coordinates and times a modulation.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::coordinate::Coordinate;
use super::modulation::Modulation;
use super::place::PixelContext;
use super::series::{
    bilinear, cubic, hat_without_line, interpolated, lens, node, on_ring, powers, waves,
};

/// Everything of a term but its linear coefficients. Terms of the bias are in px of disparity, those of the
/// variance in its natural logarithm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Basis {
    /// Constant.
    Level,
    /// Powers of a coordinate, from the first on; with `level`, a constant comes second.
    Powers { over: Coordinate, orders: usize, level: bool, times: Modulation },
    /// Monomials of two coordinates up to a degree, without the constant and linear ones.
    Polynomial { over: [Coordinate; 2], degree: usize, times: Modulation },
    /// Sine and cosine of a period, and their harmonics.
    Waves { over: Coordinate, period: f64, harmonics: usize, times: Modulation },
    /// Radial distortion, in orders of r^2, of the lens through which a matcher sees both the scene and its
    /// reference, which was recorded where the disparity is `reference_px`.
    #[serde(rename = "matched-lens")]
    Lens { fx: f64, fy: f64, reference_px: f64, orders: usize },
    /// Exponential decay from where the coordinate is zero.
    Decay { over: Coordinate, width: f64 },
    /// Logarithm of one plus the coordinate, which adds to a variance.
    Log1p { over: Coordinate },
    /// Tables over depth and tilt, one per coefficient.
    #[serde(rename = "recalibrate")]
    Table { z_m: [f64; 2], theta_rad: [f64; 2], columns: Vec<Vec<f64>> },
    /// Piecewise linear over an axis, between evenly spaced nodes. A lift over the target's own coordinates
    /// has its straight part removed.
    Curve { over: Coordinate, low: f64, high: f64, nodes: usize, times: Modulation },
    /// Piecewise linear on a circle.
    Ring { over: Coordinate, period: f64, nodes: usize, times: Modulation },
    /// A bilinear map over the picture.
    Map { width: f64, height: f64, across: usize, down: usize, times: Modulation },
    /// A smooth map over the picture: products of cubic B-splines.
    Spline { width: f64, height: f64, across: usize, down: usize, times: Modulation },
    /// 1, x and y of the ray: the part of a shape that planes absorb.
    #[serde(rename = "absorbed")]
    Affine { times: Modulation },
    /// A bilinear map over two axes.
    Pair { over: [Coordinate; 2], low: [f64; 2], high: [f64; 2], nodes: [usize; 2] },
}

/// Nodes of a table along z and along theta.
pub const TABLE: usize = 17;
/// Exponents of the monomials of two coordinates beyond the plane, by degree.
const BENT: [(usize, usize); 12] = [
    (2, 0),
    (0, 2),
    (1, 1),
    (3, 0),
    (2, 1),
    (1, 2),
    (0, 3),
    (4, 0),
    (3, 1),
    (2, 2),
    (1, 3),
    (0, 4),
];

/// Powers of `x` from 0 to 4.
fn to_fourth(x: f64) -> [f64; 5] {
    let square = x * x;
    [1.0, x, square, x * square, square * square]
}

impl Basis {
    /// A power series without a constant.
    pub const fn powers(over: Coordinate, orders: usize, times: Modulation) -> Self {
        Basis::Powers { over, orders, level: false, times }
    }

    pub const fn waves(over: Coordinate, period: f64, harmonics: usize) -> Self {
        Basis::Waves { over, period, harmonics, times: Modulation::One }
    }

    /// Surface of the target over its own coordinates, m along its normal.
    pub const fn relief(degree: usize) -> Self {
        let over = [Coordinate::Right, Coordinate::Down];
        Basis::Polynomial { over, degree, times: Modulation::Lift }
    }

    /// Surface of a target that is round about its middle, m along its normal.
    pub const fn dome(orders: usize) -> Self {
        Basis::powers(Coordinate::TargetRadiusSquared, orders, Modulation::Lift)
    }

    /// Number of linear coefficients.
    pub fn count(&self) -> usize {
        match self {
            Basis::Powers { orders, level, .. } => orders + usize::from(*level),
            Basis::Polynomial { degree, .. } => {
                BENT.iter().filter(|(i, j)| i + j <= *degree).count()
            }
            Basis::Waves { harmonics, .. } => 2 * harmonics,
            Basis::Table { columns, .. } => columns.len(),
            Basis::Curve { nodes, .. } | Basis::Ring { nodes, .. } => *nodes,
            Basis::Map { across, down, .. } | Basis::Spline { across, down, .. } => across * down,
            Basis::Lens { orders, .. } => *orders,
            Basis::Affine { .. } => 3,
            Basis::Pair { nodes, .. } => nodes[0] * nodes[1],
            Basis::Level | Basis::Decay { .. } | Basis::Log1p { .. } => 1,
        }
    }

    /// Same without the number of orders. Of two bases of one series, the columns of the one with fewer are
    /// the first ones of the other.
    pub fn series(&self) -> Self {
        let mut series = self.clone();
        match &mut series {
            Basis::Powers { orders: number, .. }
            | Basis::Lens { orders: number, .. }
            | Basis::Waves { harmonics: number, .. }
            | Basis::Polynomial { degree: number, .. } => *number = 0,
            _ => {}
        }
        series
    }

    /// Passes index and value of the columns that may be non-zero at a place to `see`.
    pub fn visit(&self, p: &PixelContext, mut see: impl FnMut(usize, f64)) {
        match *self {
            Basis::Level => see(0, 1.0),
            Basis::Powers { over, orders, level, times } => {
                powers([times.value(p), over.value(p)], orders, level, see);
            }
            Basis::Polynomial { over: [a, b], degree, times } => {
                let (scale, a, b) = (times.value(p), to_fourth(a.value(p)), to_fourth(b.value(p)));
                let powers = BENT.iter().filter(|(i, j)| i + j <= degree).enumerate();
                powers.for_each(|(k, (i, j))| see(k, scale * a[*i] * b[*j]));
            }
            Basis::Waves { over, period, harmonics, times } => {
                waves((over, period, harmonics), times.value(p), p, see);
            }
            Basis::Lens { fx, fy, reference_px, orders } => {
                lens([fx, fy], reference_px, orders, p, see);
            }
            Basis::Decay { over, width } => see(0, (-over.value(p) / width).exp()),
            Basis::Log1p { over } => see(0, over.value(p).ln_1p()),
            Basis::Table { z_m, theta_rad, ref columns } => {
                let at_z = node(p.z, z_m[0], z_m[1], TABLE);
                let at_theta = node(p.theta, theta_rad[0], theta_rad[1], TABLE);
                for (k, column) in columns.iter().enumerate() {
                    see(k, interpolated(column, TABLE, at_z, at_theta));
                }
            }
            Basis::Curve { over, low, high, nodes, times } => {
                let (k, t) = node(over.value(p), low, high, nodes);
                let scale = times.value(p);
                if self.is_lift_of_target() {
                    // No column is zero, since the straight part is removed.
                    let weight = |j| hat_without_line(j, k as f64 + t, nodes);
                    (0..nodes).for_each(|j| see(j, scale * weight(j)));
                } else {
                    see(k, scale * (1.0 - t));
                    see(k + 1, scale * t);
                }
            }
            Basis::Ring { over, period, nodes, times } => {
                let ([k, next], t) = on_ring(over.value(p), period, nodes);
                let scale = times.value(p);
                see(k, scale * (1.0 - t));
                see(next, scale * t);
            }
            Basis::Map { width, height, across, down, times } => {
                let at = [node(p.u, 0.0, width - 1.0, across), node(p.v, 0.0, height - 1.0, down)];
                bilinear(at, across, times.value(p), see);
            }
            Basis::Spline { width, height, across, down, times } => {
                let (i, of_columns) = cubic(p.u, width - 1.0, across);
                let (j, of_rows) = cubic(p.v, height - 1.0, down);
                let scale = times.value(p);
                for (row, y) in of_rows.iter().enumerate() {
                    let first = (j + row) * across + i;
                    of_columns.iter().enumerate().for_each(|(k, x)| see(first + k, scale * x * y));
                }
            }
            Basis::Affine { times } => {
                let far = times.value(p);
                [far, far * p.x, far * p.y].into_iter().enumerate().for_each(|(k, g)| see(k, g));
            }
            Basis::Pair { over, low, high, nodes } => {
                let at = [0, 1].map(|k| node(over[k].value(p), low[k], high[k], nodes[k]));
                bilinear(at, nodes[0], 1.0, see);
            }
        }
    }

    /// Fills in the columns at a place; `out` has [`Basis::count`] entries.
    pub fn fill(&self, p: &PixelContext, out: &mut [f64]) {
        out.fill(0.0);
        self.visit(p, |k, g| out[k] += g);
    }

    /// Value of the term at a place.
    pub fn value(&self, coefficients: &[f64], p: &PixelContext) -> f64 {
        let mut sum = 0.0;
        self.visit(p, |k, g| sum += g * coefficients[k]);
        sum
    }
}

#[cfg(test)]
#[path = "basis_tests.rs"]
mod tests;
