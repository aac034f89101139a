//! Terms of a model as expressions valid in both Python and C: calls, + - * / and numbers.
//!
//! `p` is the place of a pixel ([`crate::terms::PixelContext`] under shorter names); the functions called
//! are defined in `helpers.py` and `helpers.h`.

use crate::model::{Form, SigmaModel};
use crate::terms::{Basis, Coordinate, DISPARITY_UNIT_PX, Modulation, ROOM_LUX, TABLE, Term};

/// The shortest text that reads back to the same double, in Python and in C.
pub(super) fn number(v: f64) -> String {
    format!("{v:?}")
}

/// The same for YAML 1.1, which reads 1e-5 as text: a decimal point, and a sign of the exponent.
pub(super) fn yaml_float(v: f64) -> String {
    let text = number(v);
    let Some((head, power)) = text.split_once('e') else { return text };
    let point = if head.contains('.') { "" } else { ".0" };
    let sign = if power.starts_with('-') { "" } else { "+" };
    format!("{head}{point}e{sign}{power}")
}

/// Sigma, m, at `z` and `theta` inside the range where the model holds.
pub(super) fn sigma(model: &SigmaModel, prefix: &str) -> String {
    let p: Vec<String> = model.parameters.iter().copied().map(number).collect();
    let square = |of: &str| format!("{prefix}square({of})");
    let parabola = || format!("{} + {} * {}", p[0], p[1], square(&format!("z - {}", p[2])));
    let form = match model.form {
        Form::Paper => {
            let tilt = square(&format!("theta / ({} - theta)", p[5]));
            format!("{} + {} * pow(z, {}) * {tilt}", parabola(), p[3], p[4])
        }
        Form::Nguyen => {
            let pole = number(std::f64::consts::FRAC_PI_2);
            let tilt = square(&format!("theta / ({pole} - theta)"));
            format!("{} + {} * ({tilt} / sqrt(z))", parabola(), p[3])
        }
        Form::Khoshelham => format!("{} * z * z", p[0]),
        Form::Disparity => format!("hypot({} * z * z, {})", p[0], p[1]),
    };
    match model.direction {
        crate::model::Direction::Axial => form,
        crate::model::Direction::Perpendicular => format!("({form}) / cos(theta)"),
    }
}

/// Writes expressions, and collects the tables of numbers that they refer to by name.
#[derive(Debug, Clone)]
pub(super) struct Expressions {
    prefix: &'static str,
    pub tables: Vec<Vec<f64>>,
}

impl Expressions {
    /// Names begin with `prefix`.
    pub fn new(prefix: &'static str) -> Self {
        Expressions { prefix, tables: Vec::new() }
    }

    /// The name of table number `k`.
    pub fn name(&self, k: usize) -> String {
        format!("{}t{k}", self.prefix)
    }

    /// The value of a term at `p`: px, or nepers of variance.
    pub fn term(&mut self, term: &Term) -> String {
        let b = &term.coefficients;
        let times = |times: &Modulation| self.modulation(*times);
        match &term.basis {
            Basis::Level => number(b[0]),
            Basis::Powers { over, level, times: by, .. } => {
                let tail = [flag(*level), coordinate(*over), times(by)];
                self.call("powers", b, tail.into())
            }
            Basis::Polynomial { over, times: by, .. } => {
                let tail = [coordinate(over[0]), coordinate(over[1]), times(by)];
                self.call("polynomial", b, tail.into())
            }
            Basis::Waves { over, period, times: by, .. } => {
                let stripes = matches!(over, Coordinate::Column | Coordinate::Row);
                let tail = [flag(stripes), coordinate(*over), number(*period), times(by)];
                self.call("waves", b, tail.into())
            }
            Basis::Lens { fx, fy, reference_px, .. } => {
                let elsewhere = times(&Modulation::RadialSlope { fx: *fx, fy: *fy });
                let shift = format!("(p.disparity - {})", number(*reference_px));
                let order = |(n, b): (usize, &f64)| {
                    let stretch =
                        format!("{OFF_AXIS} + {} * p.x * p.x", number(2.0 * (n + 1) as f64));
                    let whole = format!("({OFF_AXIS}) * ({elsewhere}) + ({stretch}) * {shift}");
                    format!("{} * pow({OFF_AXIS}, {}) * ({whole})", number(*b), number(n as f64))
                };
                let orders: Vec<String> = b.iter().enumerate().map(order).collect();
                format!("({})", orders.join(" + "))
            }
            Basis::Decay { over, width } => {
                format!("{} * exp(-({}) / {})", number(b[0]), coordinate(*over), number(*width))
            }
            Basis::Log1p { over } => format!("{} * log1p({})", number(b[0]), coordinate(*over)),
            Basis::Table { z_m, theta_rad, columns } => {
                let node = |i: usize| columns.iter().zip(b).map(|(c, b)| c[i] * b).sum();
                let grid: Vec<f64> = (0..TABLE * TABLE).map(node).collect();
                let axes = [("p.z".into(), *z_m, TABLE), ("p.theta".into(), *theta_rad, TABLE)];
                self.grid(&grid, axes)
            }
            Basis::Curve { over, low, high, times: by, .. } => {
                let tail = vec![coordinate(*over), number(*low), number(*high)];
                let by = times(by);
                product(&by, self.call("curve", b, tail))
            }
            Basis::Ring { over, period, times: by, .. } => {
                let by = times(by);
                product(&by, self.call("ring", b, vec![coordinate(*over), number(*period)]))
            }
            Basis::Map { width, height, across, down, times: by } => {
                let by = times(by);
                let column = ("p.u".into(), [0.0, width - 1.0], *across);
                product(&by, self.grid(b, [column, ("p.v".into(), [0.0, height - 1.0], *down)]))
            }
            Basis::Spline { width, height, across, down, times: by } => {
                let by = times(by);
                let ends = ["p.u".into(), number(width - 1.0), "p.v".into(), number(height - 1.0)];
                let tail = [across.to_string(), down.to_string()].into_iter().chain(ends);
                product(&by, self.call("spline", b, tail.collect()))
            }
            Basis::Affine { times: by } => {
                let [a, x, y] = [0, 1, 2].map(|k| number(b[k]));
                product(&times(by), format!("({a} + {x} * p.x + {y} * p.y)"))
            }
            Basis::Pair { over, low, high, nodes } => {
                let axis = |k: usize| (coordinate(over[k]), [low[k], high[k]], nodes[k]);
                self.grid(b, [axis(0), axis(1)])
            }
        }
    }

    /// Call of a helper with a table, its length and further arguments.
    fn call(&mut self, helper: &str, table: &[f64], tail: Vec<String>) -> String {
        let name = self.name(self.tables.len());
        self.tables.push(table.to_vec());
        let head = [name, table.len().to_string()];
        let all: Vec<String> = head.into_iter().chain(tail).collect();
        format!("{}{helper}({})", self.prefix, all.join(", "))
    }

    /// Bilinear interpolation over two axes, each given by node count, coordinate and range.
    fn grid(&mut self, table: &[f64], axes: [(String, [f64; 2], usize); 2]) -> String {
        let tail = axes.into_iter().flat_map(|(of, [low, high], nodes)| {
            [nodes.to_string(), of, number(low), number(high)]
        });
        self.call("grid", table, tail.collect())
    }

    fn modulation(&self, times: Modulation) -> String {
        let square = |of: &str| format!("{}square({of})", self.prefix);
        let units = format!("p.disparity / {}", number(DISPARITY_UNIT_PX));
        match times {
            Modulation::One => "1.0".into(),
            Modulation::Disparity => "p.disparity".into(),
            Modulation::DisparitySquared => square(&units),
            Modulation::DisparityPower(power) => format!("pow({units}, {})", number(power)),
            Modulation::Lift => "p.disparity / p.rho".into(),
            Modulation::Tilt => "sin(p.theta)".into(),
            Modulation::TiltPower(power) => format!("pow(sin(p.theta), {})", f64::from(power)),
            Modulation::SlopeSquared => {
                format!("fmin({}, {})", square("tan(p.theta)"), number(Modulation::STEEPEST))
            }
            Modulation::RadialSlope { fx, fy } => {
                let along =
                    |slope: &str, ray: &str, f: f64| format!("{slope} * {ray} * {}", number(f));
                let (u, v) = (along("p.slope_u", "p.x", fx), along("p.slope_v", "p.y", fy));
                format!("-({u} + {v})")
            }
        }
    }
}

fn product(times: &str, of: String) -> String {
    if times == "1.0" { of } else { format!("({times}) * {of}") }
}

fn flag(on: bool) -> String {
    u8::from(on).to_string()
}

/// Square of the ray's distance from the axis.
const OFF_AXIS: &str = "p.x * p.x + p.y * p.y";

fn coordinate(over: Coordinate) -> String {
    match over {
        Coordinate::Column => "p.u".into(),
        Coordinate::Row => "p.v".into(),
        Coordinate::Radius => "p.radius".into(),
        Coordinate::RadiusSquared => "p.radius * p.radius".into(),
        Coordinate::RaySquared => OFF_AXIS.into(),
        Coordinate::Foreshortening => format!("1.0 / sqrt(1.0 + {OFF_AXIS}) - 1.0"),
        Coordinate::Z => "p.z".into(),
        Coordinate::LogZ => "log(p.z)".into(),
        Coordinate::LogRatio(pivot_m) => format!("log(p.z / {})", number(pivot_m)),
        Coordinate::DepthPower { unit_m, power } => {
            format!("pow(p.z / {}, {})", number(unit_m), number(power))
        }
        Coordinate::Disparity => "p.disparity".into(),
        // Coordinates on a calibration board; no term of a sensor uses them.
        Coordinate::Right | Coordinate::Down => "0.0".into(),
        Coordinate::TargetRadiusSquared | Coordinate::Edge => "0.0".into(),
        Coordinate::Theta => "p.theta".into(),
        Coordinate::Azimuth => "p.azimuth".into(),
        Coordinate::Along => "p.x * cos(p.azimuth) + p.y * sin(p.azimuth)".into(),
        Coordinate::Alignment => "cos(2.0 * p.azimuth)".into(),
        Coordinate::AlongBaseline => "cos(p.azimuth) * cos(p.azimuth)".into(),
        Coordinate::Blur(lateral_px) => {
            let slope = "(p.slope_u * p.slope_u + p.slope_v * p.slope_v)";
            format!("{} * {slope} / p.variance", number(lateral_px * lateral_px))
        }
        Coordinate::TiltBlur(lateral_px) => {
            let middle = "(p.rho / (fmax(cos(p.theta), 0.05) * p.z))";
            format!("{} * {middle} * {middle}", coordinate(Coordinate::Blur(lateral_px)))
        }
        Coordinate::Session => "p.session_s".into(),
        Coordinate::Temperature => "p.temperature_c".into(),
        // A surface of median brightness.
        Coordinate::Light => "1.0".into(),
        Coordinate::LogLight => "0.0".into(),
        Coordinate::Ambient(ratio) => {
            let (ratio, room) = (number(ratio), number(ROOM_LUX));
            let square = format!("(p.z * p.z * (1.0 + {OFF_AXIS}))");
            let far = format!("{square} / fmax(p.rho / sqrt({square}), 0.05)");
            format!("{ratio} * p.ambient / {room} * ({far})")
        }
    }
}
