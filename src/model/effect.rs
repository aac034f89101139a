//! What a model holds beyond sigma: physical effects, with the free shape that was fitted.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::terms::Term;

/// One physical effect of the model.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Effect {
    /// Of effects.md, or [`UNEXPLAINED`].
    pub id: String,
    #[serde(default)]
    pub parameters: Map<String, Value>,
    /// The free shape that was fitted, where there is one: it holds, and not the formula of the
    /// catalogue with these parameters.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub shape: Vec<Term>,
}

/// The id of what has no name: its shape is all that is known.
pub const UNEXPLAINED: &str = "unexplained";

impl Effect {
    /// What is wrong with it, if anything.
    pub fn fault(&self) -> Option<String> {
        if self.id == UNEXPLAINED && self.shape.is_empty() {
            return Some(format!("an {UNEXPLAINED} effect has no shape"));
        }
        let mut terms = self.shape.iter().enumerate();
        terms.find_map(|(k, term)| {
            let fault = term.fault()?;
            Some(format!("effect {}: term {} of its shape: {fault}", self.id, k + 1))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::terms::{Basis, Coordinate, Modulation, Statistic, TABLE};
    use proptest::prelude::*;

    fn over() -> impl Strategy<Value = Coordinate> {
        use Coordinate::*;
        prop::sample::select(vec![
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
            Session,
            Temperature,
            Light,
        ])
    }

    fn times() -> impl Strategy<Value = Modulation> {
        use Modulation::*;
        prop::sample::select(vec![One, DisparitySquared, Lift, Tilt])
    }

    /// Any double from the least to the greatest that a fit could have.
    fn length() -> impl Strategy<Value = f64> {
        (-300.0f64..300.0).prop_map(|e| 10f64.powf(e))
    }

    fn axis() -> impl Strategy<Value = [f64; 2]> {
        (-1e6f64..1e6, 1e-3f64..1e6).prop_map(|(low, width)| [low, low + width])
    }

    fn basis() -> impl Strategy<Value = Basis> {
        let table = prop::collection::vec(-1e9f64..1e9, TABLE * TABLE);
        prop_oneof![
            (-3.0f64..3.0, 1usize..4)
                .prop_map(|(disparity_power, orders)| Basis::Bowl { disparity_power, orders }),
            (length(), length(), 1usize..4).prop_map(|(fx, fy, orders)| Basis::Lens {
                fx,
                fy,
                orders
            }),
            Just(Basis::RangeNotDepth),
            (2usize..5).prop_map(|degree| Basis::Bow { degree }),
            (length(), 1usize..5)
                .prop_map(|(period_px, harmonics)| Basis::Locking { period_px, harmonics }),
            (length(), 1usize..5)
                .prop_map(|(period_px, harmonics)| Basis::Banding { period_px, harmonics }),
            length().prop_map(|width_px| Basis::EdgeMixing { width_px }),
            (length(), 1usize..3)
                .prop_map(|(pivot_m, orders)| Basis::RangeExponent { pivot_m, orders }),
            (1usize..4).prop_map(|orders| Basis::Vignetting { orders }),
            length().prop_map(|lateral_px| Basis::SlopeNoise { lateral_px }),
            (0i32..5).prop_map(|tilt_power| Basis::TiltAxis { tilt_power }),
            (1usize..4).prop_map(|orders| Basis::Intensity { orders }),
            length().prop_map(|ratio| Basis::Ambient { ratio }),
            Just(Basis::Level),
            (axis(), axis(), prop::collection::vec(table, 1..3)).prop_map(
                |(z_m, theta_rad, columns)| Basis::Recalibrate { z_m, theta_rad, columns }
            ),
            (over(), axis(), 2usize..30, times()).prop_map(|(over, [low, high], nodes, times)| {
                Basis::Curve { over, low, high, nodes, times }
            }),
            (over(), length(), 2usize..30, times()).prop_map(|(over, period, nodes, times)| {
                Basis::Ring { over, period, nodes, times }
            }),
            (2.0f64..1e4, 2.0f64..1e4, 2usize..9, 2usize..9, times()).prop_map(
                |(width, height, across, down, times)| Basis::Map {
                    width,
                    height,
                    across,
                    down,
                    times
                }
            ),
            (over(), over(), axis(), axis(), 2usize..9, 2usize..9).prop_map(
                |(a, b, p, q, i, j)| {
                    Basis::Pair {
                        over: [a, b],
                        low: [p[0], q[0]],
                        high: [p[1], q[1]],
                        nodes: [i, j],
                    }
                }
            ),
        ]
    }

    pub(crate) fn term() -> impl Strategy<Value = Term> {
        let statistic = prop::sample::select(vec![Statistic::Bias, Statistic::Variance]);
        (statistic, basis()).prop_flat_map(|(statistic, basis)| {
            prop::collection::vec(prop::num::f64::NORMAL | prop::num::f64::ZERO, basis.count())
                .prop_map(move |coefficients| Term {
                    statistic,
                    basis: basis.clone(),
                    coefficients,
                })
        })
    }

    proptest! {
        /// Every kind of basis survives the file exactly, and none is refused.
        #[test]
        fn shapes_read_back_bit_for_bit(shape in prop::collection::vec(term(), 1..4)) {
            let effect = Effect { id: UNEXPLAINED.into(), shape, ..Effect::default() };
            prop_assert_eq!(effect.fault(), None);
            let text = serde_json::to_string(&effect).unwrap();
            prop_assert_eq!(serde_json::from_str::<Effect>(&text).unwrap(), effect);
        }

        /// A coefficient too many or one that is no number is a fault.
        #[test]
        fn a_shape_with_a_lie_is_refused(term in term(), lie in 0usize..4) {
            let mut bad = term;
            match lie {
                0 => bad.coefficients.push(0.0),
                1 => { bad.coefficients.pop(); }
                2 => bad.coefficients[0] = f64::NAN,
                _ => bad.statistic = Statistic::Dropout,
            }
            prop_assert!(bad.fault().is_some());
        }
    }

    #[test]
    fn impossible_bases_are_refused() {
        let curve = |low, high, nodes| Basis::Curve {
            over: Coordinate::Radius,
            low,
            high,
            nodes,
            times: Modulation::One,
        };
        let bad = [
            Basis::Locking { period_px: 0.0, harmonics: 2 },
            Basis::Banding { period_px: -8.0, harmonics: 1 },
            Basis::Banding { period_px: 8.0, harmonics: usize::MAX },
            Basis::Bow { degree: usize::MAX },
            Basis::Map {
                width: 640.0,
                height: 480.0,
                across: usize::MAX,
                down: 2,
                times: Modulation::One,
            },
            Basis::Ring {
                over: Coordinate::Azimuth,
                period: f64::INFINITY,
                nodes: 4,
                times: Modulation::One,
            },
            Basis::Recalibrate {
                z_m: [1.0, 2.0],
                theta_rad: [0.0, 1.0],
                columns: vec![vec![0.0; 3]],
            },
            curve(0.0, 1.0, 1),
            curve(1.0, 1.0, 4),
            curve(f64::NAN, 1.0, 4),
        ];
        for basis in bad {
            assert!(basis.fault().is_some(), "{basis:?}");
        }
    }
}
