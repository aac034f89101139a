//! The shapes a missing term may have: families with a free shape, and nameless curves.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

use super::nodes::{DISPARITY_UNIT_PX, bilinear, cubic, disparity_scale, node};
use super::place::{Axis, PixelContext};

/// A term with everything but its linear coefficients settled. Terms of the bias are in px of
/// disparity, those of the variance in its natural logarithm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Basis {
    /// A bowl r^2 .. r^2n in disparity whose depth goes with a power of the disparity.
    Bowl { disparity_power: f64, orders: usize },
    /// Rays shifted along the radius, seen through the slope of the target.
    Lens { fx: f64, fy: f64, orders: usize },
    /// Ray length in place of depth.
    RangeNotDepth,
    /// A board that is not flat: even polynomial of its own coordinates.
    Bow { degree: usize },
    /// Periodic in the disparity.
    Locking { period_px: f64, harmonics: usize },
    /// Stripes down the picture.
    Banding { period_px: f64, harmonics: usize },
    /// Fades with the distance from the edge; to both sides alike, or to the left and right apart.
    EdgeMixing { width_px: f64 },
    /// Noise with another power of z: powers of ln(z / pivot).
    RangeExponent { pivot_m: f64, orders: usize },
    /// Less light towards the corners.
    Vignetting { orders: usize },
    /// Lateral noise through the slope of the target.
    SlopeNoise { lateral_px: f64 },
    /// Along the baseline against across it, fading as the tilt does.
    TiltAxis { tilt_power: i32 },
    /// Dark surface: ln(light), a level (what counts as light is arbitrary), its square.
    Intensity { orders: usize },
    /// Light of the room against the pattern's.
    Ambient { ratio: f64 },
    /// The logarithm of the variance as a whole.
    Level,
    /// d log variance / d parameter of the sigma model, on a table over z and theta.
    Recalibrate { z_m: [f64; 2], theta_rad: [f64; 2], columns: Vec<Vec<f64>> },
    /// A broken line over an axis between evenly spaced nodes; a lift over the target's own
    /// coordinates is without its straight part.
    Curve { over: Coordinate, low: f64, high: f64, nodes: usize, times: Modulation },
    /// A broken line on a circle.
    Ring { over: Coordinate, period: f64, nodes: usize, times: Modulation },
    /// A bilinear map over the picture.
    Map { width: f64, height: f64, across: usize, down: usize, times: Modulation },
    /// A smooth map over the picture: products of cubic B-splines.
    Spline { width: f64, height: f64, across: usize, down: usize, times: Modulation },
    /// 1, x and y of the ray, times a power of the disparity: what planes absorb of a shape.
    Affine { disparity_power: f64 },
    /// Two curves at once: a bilinear map over two axes.
    Pair { over: [Coordinate; 2], low: [f64; 2], high: [f64; 2], nodes: [usize; 2] },
}

/// What a curve runs over.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Coordinate {
    Column,
    Row,
    Radius,
    Z,
    LogZ,
    Disparity,
    Right,
    Down,
    Edge,
    Theta,
    Azimuth,
    /// Along the direction in which depth grows, from the optical axis, in rays' units.
    Along,
    Session,
    Temperature,
    Light,
}

/// What a curve is multiplied by.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Modulation {
    One,
    /// The square of the disparity in units of 40 px: a constant error of depth's own shape.
    DisparitySquared,
    /// Disparity over the plane's distance: a lift of the surface along its normal, m.
    Lift,
    /// Sine of the tilt: what a frontal plane does not show.
    Tilt,
}

/// Columns of bands are in this unit, px, over their order: so large are bands, and so do the waves
/// of a saw-tooth fall. A coefficient that few columns of the picture decide is then held to it.
const BAND_PX: f64 = 0.2;

impl Coordinate {
    pub fn value(self, p: &PixelContext) -> f64 {
        match self {
            Coordinate::Column => p.u,
            Coordinate::Row => p.v,
            Coordinate::Radius => p.radius,
            Coordinate::Z => p.z,
            Coordinate::LogZ => p.z.ln(),
            Coordinate::Disparity => p.disparity,
            Coordinate::Right => p.right,
            Coordinate::Down => p.down,
            Coordinate::Edge => p.edge,
            Coordinate::Theta => p.theta,
            Coordinate::Azimuth => p.azimuth,
            Coordinate::Along => p.x * p.azimuth.cos() + p.y * p.azimuth.sin(),
            Coordinate::Session => p.session_s,
            Coordinate::Temperature => p.temperature_c,
            Coordinate::Light => p.light,
        }
    }

    pub fn axis(self) -> Axis {
        match self {
            Coordinate::Column => Axis::Column,
            Coordinate::Row => Axis::Row,
            Coordinate::Radius => Axis::Radius,
            Coordinate::Z | Coordinate::LogZ | Coordinate::Disparity => Axis::Z,
            Coordinate::Right | Coordinate::Down => Axis::TargetPosition,
            Coordinate::Edge => Axis::EdgeDistance,
            Coordinate::Theta => Axis::Theta,
            Coordinate::Azimuth | Coordinate::Along => Axis::Azimuth,
            Coordinate::Session => Axis::SessionTime,
            Coordinate::Temperature => Axis::Temperature,
            Coordinate::Light => Axis::Intensity,
        }
    }
}

impl Modulation {
    pub(super) fn value(self, p: &PixelContext) -> f64 {
        match self {
            Modulation::One => 1.0,
            Modulation::DisparitySquared => (p.disparity / DISPARITY_UNIT_PX).powi(2),
            Modulation::Lift => p.disparity / p.rho,
            Modulation::Tilt => p.theta.sin(),
        }
    }
}

impl Basis {
    /// How many linear coefficients it has.
    pub fn count(&self) -> usize {
        match self {
            Basis::Bowl { orders, .. } | Basis::Lens { orders, .. } => *orders,
            Basis::Vignetting { orders }
            | Basis::RangeExponent { orders, .. }
            | Basis::Intensity { orders } => *orders,
            Basis::Bow { degree } => {
                BOW_TERMS.iter().filter(|(i, j)| i + j <= *degree as i32).count()
            }
            Basis::Locking { harmonics, .. } | Basis::Banding { harmonics, .. } => 2 * harmonics,
            Basis::Recalibrate { columns, .. } => columns.len(),
            Basis::Curve { nodes, .. } | Basis::Ring { nodes, .. } => *nodes,
            Basis::Map { across, down, .. } | Basis::Spline { across, down, .. } => across * down,
            Basis::Affine { .. } => 3,
            Basis::Pair { nodes, .. } => nodes[0] * nodes[1],
            Basis::RangeNotDepth
            | Basis::EdgeMixing { .. }
            | Basis::SlopeNoise { .. }
            | Basis::TiltAxis { .. }
            | Basis::Ambient { .. }
            | Basis::Level => 1,
        }
    }

    /// The columns at a place; `out` has [`Basis::count`] entries.
    pub fn fill(&self, p: &PixelContext, out: &mut [f64]) {
        match *self {
            Basis::Bowl { disparity_power, .. } => {
                let scale = if disparity_power == 0.0 {
                    1.0
                } else {
                    (p.disparity / DISPARITY_UNIT_PX).powf(disparity_power)
                };
                powers(scale, p.radius * p.radius, out);
            }
            Basis::Lens { fx, fy, .. } => {
                let r2 = p.x * p.x + p.y * p.y;
                powers(-(p.slope[0] * p.x * fx + p.slope[1] * p.y * fy), r2, out);
            }
            Basis::RangeNotDepth => {
                out[0] = p.disparity * (1.0 / (1.0 + p.x * p.x + p.y * p.y).sqrt() - 1.0);
            }
            Basis::Bow { .. } => {
                let lift = p.disparity / p.rho;
                for (g, (i, j)) in out.iter_mut().zip(BOW_TERMS) {
                    *g = lift * p.right.powi(i) * p.down.powi(j);
                }
            }
            // A patch sees the mean over the disparities, or columns, it spans.
            Basis::Locking { period_px, .. } => {
                waves(p.disparity / period_px, |order| smear(p, order / period_px), out);
            }
            Basis::Banding { period_px, .. } => {
                let seen = |order| BAND_PX / order * sinc(order * p.side / period_px);
                waves(p.u / period_px, seen, out);
            }
            Basis::EdgeMixing { width_px } => out[0] = (-p.edge / width_px).exp(),
            Basis::RangeExponent { pivot_m, .. } => powers(1.0, (p.z / pivot_m).ln(), out),
            Basis::Vignetting { .. } => powers(1.0, p.radius * p.radius, out),
            Basis::SlopeNoise { lateral_px } => {
                let slope2 = p.slope[0].powi(2) + p.slope[1].powi(2);
                out[0] = (lateral_px * lateral_px * slope2 / p.variance).ln_1p();
            }
            Basis::TiltAxis { tilt_power } => {
                out[0] = (2.0 * p.azimuth).cos() * p.theta.sin().powi(tilt_power);
            }
            Basis::Intensity { .. } => {
                let light = p.light.max(1e-2).ln();
                for (g, value) in out.iter_mut().zip([light, 1.0, light * light]) {
                    *g = value;
                }
            }
            Basis::Ambient { ratio } => {
                let far = p.z * p.z * (1.0 + p.x * p.x + p.y * p.y) / p.theta.cos().max(0.05);
                out[0] = (ratio * p.ambient / OFFICE_LUX * far).ln_1p();
            }
            Basis::Level => out[0] = 1.0,
            Basis::Recalibrate { z_m, theta_rad, ref columns } => {
                let (i, s) = node(p.z, z_m[0], z_m[1], TABLE);
                let (j, t) = node(p.theta, theta_rad[0], theta_rad[1], TABLE);
                for (g, column) in out.iter_mut().zip(columns) {
                    let at = |i: usize, j: usize| column[j * TABLE + i];
                    *g = (1.0 - t) * ((1.0 - s) * at(i, j) + s * at(i + 1, j))
                        + t * ((1.0 - s) * at(i, j + 1) + s * at(i + 1, j + 1));
                }
            }
            Basis::Curve { over, low, high, times, .. } => {
                out.fill(0.0);
                let (k, t) = node(over.value(p), low, high, out.len());
                let scale = times.value(p);
                out[k] = scale * (1.0 - t);
                out[k + 1] = scale * t;
                if self.is_lift_of_target() {
                    without_line(out);
                }
            }
            Basis::Ring { over, period, nodes, times } => {
                out.fill(0.0);
                let place = (over.value(p) / period).rem_euclid(1.0) * nodes as f64;
                let (k, t) = (place as usize % nodes, place.fract());
                let scale = times.value(p);
                out[k] += scale * (1.0 - t);
                out[(k + 1) % nodes] += scale * t;
            }
            Basis::Map { width, height, across, down, times } => {
                let (i, s) = node(p.u, 0.0, width - 1.0, across);
                let (j, t) = node(p.v, 0.0, height - 1.0, down);
                bilinear((i, s), (j, t), across, times.value(p), out);
            }
            Basis::Spline { width, height, across, down, times } => {
                out.fill(0.0);
                let scale = times.value(p);
                let (i, of_columns) = cubic(p.u, width - 1.0, across);
                let (j, of_rows) = cubic(p.v, height - 1.0, down);
                for (row, b) in of_rows.iter().enumerate() {
                    let first = (j + row) * across + i;
                    for (g, a) in out[first..first + 4].iter_mut().zip(of_columns) {
                        *g = scale * a * b;
                    }
                }
            }
            Basis::Affine { disparity_power } => {
                let far = disparity_scale(disparity_power, p);
                out.copy_from_slice(&[far, far * p.x, far * p.y]);
            }
            Basis::Pair { over, low, high, nodes } => {
                let (i, s) = node(over[0].value(p), low[0], high[0], nodes[0]);
                let (j, t) = node(over[1].value(p), low[1], high[1], nodes[1]);
                bilinear((i, s), (j, t), nodes[0], 1.0, out);
            }
        }
    }

    /// Value of the term at a place.
    pub fn value(&self, coefficients: &[f64], p: &PixelContext, row: &mut Vec<f64>) -> f64 {
        row.clear();
        row.resize(self.count(), 0.0);
        self.fill(p, row);
        row.iter().zip(coefficients).map(|(g, b)| g * b).sum()
    }

    /// Does it depend on one coordinate of a view alone?
    pub fn alone(&self) -> Option<Coordinate> {
        match self {
            Basis::Banding { .. } => Some(Coordinate::Column),
            Basis::Locking { .. } => Some(Coordinate::Disparity),
            Basis::EdgeMixing { .. } => Some(Coordinate::Edge),
            Basis::Curve { over, times: Modulation::One, .. }
            | Basis::Ring { over, times: Modulation::One, .. } => match over {
                Coordinate::Column | Coordinate::Row | Coordinate::Edge => Some(*over),
                Coordinate::Disparity | Coordinate::Z | Coordinate::LogZ => {
                    Some(Coordinate::Disparity)
                }
                _ => None,
            },
            _ => None,
        }
    }

    /// Does it depend on the column of the picture alone?
    pub fn of_column_alone(&self) -> bool {
        self.alone() == Some(Coordinate::Column)
    }

    /// Does it stand still in the picture, but for its size?
    pub fn is_of_picture(&self) -> bool {
        match self {
            Basis::Banding { .. } => true,
            Basis::Bowl { .. } | Basis::Map { .. } | Basis::Spline { .. } => true,
            Basis::Affine { .. } => true,
            Basis::Curve { over, .. } => {
                matches!(over, Coordinate::Column | Coordinate::Row | Coordinate::Radius)
            }
            _ => false,
        }
    }

    /// Is it a shape of the target's surface over the target's own coordinates?
    pub(super) fn is_lift_of_target(&self) -> bool {
        let Basis::Curve { over, times, .. } = self else { return false };
        *times == Modulation::Lift && matches!(over, Coordinate::Right | Coordinate::Down)
    }

    /// Does it change within a few pixels?
    pub fn is_fine(&self) -> bool {
        match self {
            Basis::Locking { .. } | Basis::Ring { .. } | Basis::EdgeMixing { .. } => true,
            Basis::Curve { over, .. } => matches!(over, Coordinate::Edge),
            _ => false,
        }
    }

    /// The axis that it runs along.
    pub fn axis(&self) -> Axis {
        match self {
            Basis::Bowl { .. } | Basis::Lens { .. } | Basis::RangeNotDepth => Axis::Radius,
            Basis::Vignetting { .. } => Axis::Radius,
            Basis::Bow { .. } => Axis::TargetPosition,
            Basis::Locking { .. } => Axis::DisparityPhase,
            Basis::Banding { .. } => Axis::Column,
            Basis::EdgeMixing { .. } => Axis::EdgeDistance,
            Basis::RangeExponent { .. } | Basis::Level | Basis::Recalibrate { .. } => Axis::Z,
            Basis::SlopeNoise { .. } => Axis::Theta,
            Basis::TiltAxis { .. } => Axis::Azimuth,
            Basis::Intensity { .. } | Basis::Ambient { .. } => Axis::Intensity,
            Basis::Curve { over, .. } => over.axis(),
            Basis::Ring { over: Coordinate::Disparity, .. } => Axis::DisparityPhase,
            Basis::Ring { over, .. } => over.axis(),
            Basis::Map { .. } | Basis::Spline { .. } | Basis::Affine { .. } => Axis::Pixel,
            Basis::Pair { over, .. } => over[0].axis(),
        }
    }
}

/// Take out of the nodes' weights what a straight line over the nodes is: a surface that is moved
/// or tilted as a whole is a plane again, and no fit to planes can tell how far.
fn without_line(weights: &mut [f64]) {
    let n = weights.len() as f64;
    let middle = 0.5 * (n - 1.0);
    let squares = n * (n * n - 1.0) / 12.0;
    let (mut sum, mut moment) = (0.0, 0.0);
    for (k, w) in weights.iter().enumerate() {
        sum += w;
        moment += w * (k as f64 - middle);
    }
    for (k, w) in weights.iter_mut().enumerate() {
        *w -= sum / n + moment / squares * (k as f64 - middle);
    }
}

/// Light on the desk of an office, lx: what a room's share of the light is counted at.
const OFFICE_LUX: f64 = 500.0;
/// Nodes of a table over z and over theta.
pub const TABLE: usize = 17;
/// Powers of right and down on the board, without the plane itself.
const BOW_TERMS: [(i32, i32); 12] = [
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

fn powers(scale: f64, base: f64, out: &mut [f64]) {
    let mut term = scale;
    for g in out {
        term *= base;
        *g = term;
    }
}

fn sinc(cycles: f64) -> f64 {
    let x = std::f64::consts::PI * cycles;
    if x.abs() < 1e-6 { 1.0 } else { x.sin() / x }
}

fn smear(p: &PixelContext, frequency: f64) -> f64 {
    sinc(frequency * p.slope[0] * p.side) * sinc(frequency * p.slope[1] * p.side)
}

/// Sine and cosine of a phase, in periods, and of its multiples: each as large as `size` has it for
/// its order.
fn waves(phase: f64, size: impl Fn(f64) -> f64, out: &mut [f64]) {
    let (s, c) = (TAU * phase).sin_cos();
    let (mut sk, mut ck) = (s, c);
    for (k, pair) in out.chunks_exact_mut(2).enumerate() {
        let size = size((k + 1) as f64);
        pair[0] = size * sk;
        pair[1] = size * ck;
        (sk, ck) = (sk * c + ck * s, ck * c - sk * s);
    }
}
