//! Terms as written in files. Kinds of older files keep their names and numbers; a shape that none of them
//! holds is written as it is.

use schemars::JsonSchema;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value;

use super::basis::Basis;
use super::coordinate::Coordinate;
use super::modulation::Modulation;
use super::{Statistic, Term};

#[derive(Serialize, Deserialize, JsonSchema)]
pub(super) struct Written {
    statistic: Statistic,
    basis: Shape,
    coefficients: Vec<f64>,
}

#[derive(Serialize, JsonSchema)]
#[serde(untagged)]
enum Shape {
    Older(Kind),
    Basis(Basis),
}

/// By its kind: an untagged enum would not say which kind is unknown, or what it lacks.
impl<'de> Deserialize<'de> for Shape {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = Value::deserialize(deserializer)?;
        match Kind::deserialize(&value) {
            Err(e) if e.to_string().starts_with("unknown variant") => {
                Basis::deserialize(&value).map(Shape::Basis)
            }
            kind => kind.map(Shape::Older),
        }
        .map_err(D::Error::custom)
    }
}

#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case")]
enum Kind {
    Bowl { disparity_power: f64, orders: usize },
    Lens { fx: f64, fy: f64, orders: usize },
    RangeNotDepth,
    Bow { degree: usize },
    Locking { period_px: f64, harmonics: usize },
    Banding { period_px: f64, harmonics: usize },
    EdgeMixing { width_px: f64 },
    RangeExponent { pivot_m: f64, orders: usize },
    Vignetting { orders: usize },
    SlopeNoise { lateral_px: f64 },
    TiltAxis { tilt_power: i32 },
    Intensity { orders: usize },
    Ambient { ratio: f64 },
    Affine { disparity_power: f64 },
}

impl From<Term> for Written {
    fn from(Term { statistic, basis, coefficients }: Term) -> Self {
        let basis = Kind::of(&basis, statistic).map_or(Shape::Basis(basis), Shape::Older);
        Written { statistic, basis, coefficients }
    }
}

impl From<Written> for Term {
    fn from(Written { statistic, basis, coefficients }: Written) -> Self {
        let basis = match basis {
            Shape::Older(kind) => kind.into(),
            Shape::Basis(basis) => basis,
        };
        Term { statistic, basis, coefficients }
    }
}

impl Kind {
    /// A bowl of the variance that does not change with the disparity is written as vignetting.
    fn of(basis: &Basis, statistic: Statistic) -> Option<Self> {
        use Coordinate as C;
        use Modulation as M;
        Some(match *basis {
            Basis::Powers { over, orders, level, times } => match (over, times, level) {
                (C::RadiusSquared, M::One, false) if statistic == Statistic::Variance => {
                    Kind::Vignetting { orders }
                }
                (C::RadiusSquared, M::One, false) => Kind::Bowl { disparity_power: 0.0, orders },
                (C::RadiusSquared, M::DisparityPower(disparity_power), false) => {
                    Kind::Bowl { disparity_power, orders }
                }
                (C::RaySquared, M::RadialSlope { fx, fy }, false) => Kind::Lens { fx, fy, orders },
                (C::Foreshortening, M::Disparity, false) if orders == 1 => Kind::RangeNotDepth,
                (C::LogRatio(pivot_m), M::One, false) => Kind::RangeExponent { pivot_m, orders },
                (C::Alignment, M::TiltPower(tilt_power), false) if orders == 1 => {
                    Kind::TiltAxis { tilt_power }
                }
                (C::LogLight, M::One, false) if orders == 1 => Kind::Intensity { orders: 1 },
                (C::LogLight, M::One, true) => Kind::Intensity { orders: orders + 1 },
                _ => return None,
            },
            Basis::Polynomial { over: [C::Right, C::Down], degree, times: M::Lift } => {
                Kind::Bow { degree }
            }
            Basis::Waves { over: C::Disparity, period, harmonics, times: M::One } => {
                Kind::Locking { period_px: period, harmonics }
            }
            Basis::Waves { over: C::Column, period, harmonics, times: M::One } => {
                Kind::Banding { period_px: period, harmonics }
            }
            Basis::Decay { over: C::Edge, width } => Kind::EdgeMixing { width_px: width },
            Basis::Log1p { over: C::Blur(lateral_px) } => Kind::SlopeNoise { lateral_px },
            Basis::Log1p { over: C::Ambient(ratio) } => Kind::Ambient { ratio },
            Basis::Affine { times } => {
                Kind::Affine { disparity_power: times.power_of_disparity()? }
            }
            _ => return None,
        })
    }
}

impl From<Kind> for Basis {
    fn from(kind: Kind) -> Self {
        use Coordinate as C;
        use Modulation as M;
        match kind {
            Kind::Bowl { disparity_power, orders } => {
                Basis::powers(C::RadiusSquared, orders, M::power(disparity_power))
            }
            Kind::Lens { fx, fy, orders } => {
                Basis::powers(C::RaySquared, orders, M::RadialSlope { fx, fy })
            }
            Kind::RangeNotDepth => Basis::powers(C::Foreshortening, 1, M::Disparity),
            Kind::Bow { degree } => Basis::relief(degree),
            Kind::Locking { period_px, harmonics } => {
                Basis::waves(C::Disparity, period_px, harmonics)
            }
            Kind::Banding { period_px, harmonics } => Basis::waves(C::Column, period_px, harmonics),
            Kind::EdgeMixing { width_px } => Basis::Decay { over: C::Edge, width: width_px },
            Kind::RangeExponent { pivot_m, orders } => {
                Basis::powers(C::LogRatio(pivot_m), orders, M::One)
            }
            Kind::Vignetting { orders } => Basis::powers(C::RadiusSquared, orders, M::One),
            Kind::SlopeNoise { lateral_px } => Basis::Log1p { over: C::Blur(lateral_px) },
            Kind::TiltAxis { tilt_power } => {
                Basis::powers(C::Alignment, 1, M::TiltPower(tilt_power))
            }
            // The second column is the level: the unit of the light is arbitrary.
            Kind::Intensity { orders } => {
                let (level, times) = (orders > 1, M::One);
                let orders = orders - usize::from(level);
                Basis::Powers { over: C::LogLight, orders, level, times }
            }
            Kind::Ambient { ratio } => Basis::Log1p { over: C::Ambient(ratio) },
            Kind::Affine { disparity_power } => Basis::Affine { times: M::still(disparity_power) },
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    /// Kinds as files had them before shapes were made of coordinates.
    fn known() -> Vec<Value> {
        let table = vec![vec![0.5; 289]];
        vec![
            json!({"kind": "bowl", "disparity_power": 0.0, "orders": 2}),
            json!({"kind": "bowl", "disparity_power": 2.0, "orders": 4}),
            json!({"kind": "lens", "fx": 580.0, "fy": 581.0, "orders": 1}),
            json!({"kind": "range-not-depth"}),
            json!({"kind": "bow", "degree": 4}),
            json!({"kind": "locking", "period_px": 1.0, "harmonics": 3}),
            json!({"kind": "banding", "period_px": 80.0, "harmonics": 2}),
            json!({"kind": "edge-mixing", "width_px": 2.0}),
            json!({"kind": "range-exponent", "pivot_m": 2.0, "orders": 2}),
            json!({"kind": "slope-noise", "lateral_px": 0.8}),
            json!({"kind": "tilt-axis", "tilt_power": 2}),
            json!({"kind": "intensity", "orders": 1}),
            json!({"kind": "intensity", "orders": 3}),
            json!({"kind": "ambient", "ratio": 0.05}),
            json!({"kind": "level"}),
            json!({"kind": "recalibrate", "z_m": [0.5, 4.0], "theta_rad": [0.0, 1.2], "columns": table}),
            json!({"kind": "curve", "over": "log-z", "low": 0.0, "high": 1.0, "nodes": 3, "times": "lift"}),
            json!({"kind": "ring", "over": "azimuth", "period": 6.3, "nodes": 4, "times": "tilt"}),
            json!({"kind": "map", "width": 640.0, "height": 480.0, "across": 3, "down": 2, "times": "one"}),
            json!({"kind": "affine", "disparity_power": 2.0}),
            json!({"kind": "affine", "disparity_power": 0.5}),
        ]
    }

    fn again(statistic: &str, basis: &Value) -> Value {
        let term = json!({"statistic": statistic, "basis": basis, "coefficients": [0.25]});
        let read: Term = serde_json::from_value(term).expect("a term");
        assert_eq!(read.basis.fault(), None, "{basis}");
        serde_json::to_value(read).expect("JSON")["basis"].clone()
    }

    #[test]
    fn what_older_files_hold_is_read_and_written_as_it_was() {
        for basis in known() {
            assert_eq!(again("bias", &basis), basis);
        }
        let vignetting = json!({"kind": "vignetting", "orders": 2});
        assert_eq!(again("variance", &vignetting), vignetting);
    }

    /// Shapes that no older kind holds come back too.
    #[test]
    fn other_shapes_are_written_as_they_are() {
        for basis in [
            Basis::waves(Coordinate::Row, 30.0, 2),
            Basis::powers(Coordinate::RadiusSquared, 2, Modulation::DisparitySquared),
            Basis::Decay { over: Coordinate::Radius, width: 0.1 },
            Basis::Lens { fx: 580.0, fy: 581.0, reference_px: 21.5, orders: 2 },
            Basis::Log1p { over: Coordinate::Light },
            Basis::Log1p { over: Coordinate::TiltBlur(0.4) },
            Basis::powers(Coordinate::AlongBaseline, 1, Modulation::SlopeSquared),
        ] {
            let term = Term::bias(basis, vec![0.5]);
            let value = serde_json::to_value(&term).expect("JSON");
            assert_eq!(serde_json::from_value::<Term>(value).expect("a term"), term);
        }
    }
}
