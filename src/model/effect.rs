//! Physical effects of a model beyond sigma, with the free shapes fitted to them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::covariance::Covariance;
use crate::terms::Term;

/// One physical effect of the model.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Effect {
    /// Of the catalogue (`crate::docs::catalogue`), or [`UNEXPLAINED`].
    pub id: String,
    #[serde(default)]
    pub parameters: Map<String, Value>,
    /// The free shape that was fitted, where there is one: it holds, and not the formula of the
    /// catalogue with these parameters.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub shape: Vec<Term>,
    /// Disparities at which the shape was learnt, px: beyond them it is held at the edge.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub learnt_px: Option<[f64; 2]>,
    /// Of the shape's coefficients.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covariance: Option<Covariance>,
    /// How much each term of the shape differs from view to view: the standard deviation of its size,
    /// as a share of it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub between_views: Vec<f64>,
}

/// Id of an effect without a name, of which only the shape is known.
pub const UNEXPLAINED: &str = "unexplained";

/// Largest disparity, px: none exceeds the width of an image.
const MAX_PX: f64 = 65_536.0;
/// Largest scatter of a term's size between views, as a share of it.
const MAX_SCATTER: f64 = 1e3;

impl Effect {
    /// Value of a parameter, which is a number or {"value": number, ..}.
    pub fn number(&self, name: &str) -> Option<f64> {
        let parameter = self.parameters.get(name)?;
        parameter.get("value").unwrap_or(parameter).as_f64()
    }

    /// What is wrong with it, if anything.
    pub fn fault(&self) -> Option<String> {
        if self.id == UNEXPLAINED && self.shape.is_empty() {
            return Some(format!("an {UNEXPLAINED} effect has no shape"));
        }
        if self.learnt_px.is_some_and(|[low, high]| !(0.0 < low && low <= high && high <= MAX_PX)) {
            return Some(format!("effect {}: learnt_px is no range of disparities", self.id));
        }
        let mut terms = self.shape.iter().enumerate();
        let of_shape = terms.find_map(|(k, term)| {
            let fault = term.fault()?;
            Some(format!("effect {}: term {} of its shape: {fault}", self.id, k + 1))
        });
        let scatter = &self.between_views;
        let a_term = scatter.is_empty() || scatter.len() == self.shape.len();
        if !(a_term && scatter.iter().all(|s| (0.0..=MAX_SCATTER).contains(s))) {
            return Some(format!("effect {}: between_views is not one share a term", self.id));
        }
        of_shape.or_else(|| {
            let coefficients = self.shape.iter().map(|t| t.coefficients.len()).sum();
            let fault = self.covariance.as_ref()?.fault(coefficients)?;
            Some(format!("effect {}: {fault}", self.id))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::terms::{Basis, Coordinate, Modulation, Statistic, TABLE};

    /// One basis of each kind.
    fn bases() -> Vec<Basis> {
        let (over, times) = (Coordinate::Session, Modulation::Tilt);
        let (low, high) = (-1e6, 1.0 / 3.0);
        vec![
            Basis::powers(Coordinate::RadiusSquared, 2, Modulation::power(-0.7)),
            Basis::powers(
                Coordinate::RaySquared,
                3,
                Modulation::RadialSlope { fx: 580.1, fy: 1745.3 / 3.0 },
            ),
            Basis::Lens { fx: 580.1, fy: 1745.3 / 3.0, reference_px: 21.7, orders: 2 },
            Basis::powers(Coordinate::Foreshortening, 1, Modulation::Disparity),
            Basis::relief(4),
            Basis::dome(3),
            Basis::waves(Coordinate::Disparity, 1.0, 4),
            Basis::waves(Coordinate::Column, 80.7, 1),
            Basis::Decay { over: Coordinate::Edge, width: 2.3 },
            Basis::powers(Coordinate::LogRatio(2.0), 2, Modulation::One),
            Basis::powers(Coordinate::RadiusSquared, 3, Modulation::One),
            Basis::Log1p { over: Coordinate::Blur(0.8) },
            Basis::Log1p { over: Coordinate::TiltBlur(0.8) },
            Basis::Log1p { over: Coordinate::DepthPower { unit_m: 2.0 / 3.0, power: 3.1 } },
            Basis::powers(Coordinate::Alignment, 1, Modulation::TiltPower(2)),
            Basis::Powers {
                over: Coordinate::LogLight,
                orders: 2,
                level: true,
                times: Modulation::One,
            },
            Basis::Log1p { over: Coordinate::Ambient(1.0 / 3.0) },
            Basis::Level,
            Basis::Table {
                z_m: [0.5, 4.0],
                theta_rad: [0.0, 1.3],
                columns: vec![vec![0.1; TABLE * TABLE]; 2],
            },
            Basis::Curve { over, low, high, nodes: 9, times },
            Basis::Ring { over: Coordinate::Azimuth, period: 6.3, nodes: 4, times },
            Basis::Map { width: 640.0, height: 480.0, across: 3, down: 2, times },
            Basis::Spline { width: 640.0, height: 480.0, across: 4, down: 5, times },
            Basis::Affine { times: Modulation::DisparitySquared },
            Basis::Pair { over: [over; 2], low: [low; 2], high: [high; 2], nodes: [2, 3] },
        ]
    }

    fn term(basis: Basis) -> Term {
        let coefficients = (0..basis.count()).map(|k| 0.1 / (k as f64 - 0.3)).collect();
        Term { statistic: Statistic::Variance, basis, coefficients }
    }

    /// Every kind of basis survives the file exactly, and none is refused.
    #[test]
    fn shapes_read_back_bit_for_bit() {
        let shape = bases().into_iter().map(term).collect();
        let effect = Effect { id: UNEXPLAINED.into(), shape, ..Effect::default() };
        assert_eq!(effect.fault(), None);
        let text = serde_json::to_string(&effect).unwrap();
        assert_eq!(serde_json::from_str::<Effect>(&text).unwrap(), effect);
    }

    /// As in an older file, as in a current one, and invalid ones.
    #[test]
    fn the_scatter_between_views_is_a_share_a_term() {
        let of = |between_views| {
            let shape = vec![term(Basis::Level), term(Basis::relief(4))];
            Effect { id: UNEXPLAINED.into(), shape, between_views, ..Effect::default() }
        };
        for (scatter, good) in [
            (vec![], true),
            (vec![0.0, 0.3], true),
            (vec![0.3], false),
            (vec![0.3, -0.1], false),
            (vec![0.3, f64::NAN], false),
        ] {
            assert_eq!(of(scatter.clone()).fault().is_none(), good, "{scatter:?}");
        }
        let text = serde_json::to_string(&of(vec![])).unwrap();
        assert!(!text.contains("between_views"), "{text}");
        assert_eq!(serde_json::from_str::<Effect>(&text).unwrap(), of(vec![]));
    }

    /// A coefficient too many or too few, a NaN, or a wrong statistic is a fault.
    #[test]
    fn a_wrong_shape_is_refused() {
        let lies: [fn(&mut Term); 4] = [
            |t| t.coefficients.push(0.0),
            |t| t.coefficients.truncate(t.coefficients.len() - 1),
            |t| t.coefficients[0] = f64::NAN,
            |t| t.statistic = Statistic::Dropout,
        ];
        for basis in bases() {
            for lie in lies {
                let mut bad = term(basis.clone());
                lie(&mut bad);
                assert!(bad.fault().is_some(), "{bad:?}");
            }
        }
    }

    #[test]
    fn impossible_bases_are_refused() {
        let (over, times) = (Coordinate::Radius, Modulation::One);
        let curve = |low, high, nodes| Basis::Curve { over, low, high, nodes, times };
        let (z_m, theta_rad, columns) = ([1.0, 2.0], [0.0, 1.0], vec![vec![0.0; 3]]);
        let bad = [
            Basis::waves(Coordinate::Disparity, 0.0, 2),
            Basis::waves(Coordinate::Column, -8.0, 1),
            Basis::waves(Coordinate::Column, 8.0, usize::MAX),
            Basis::relief(usize::MAX),
            Basis::Map { width: 640.0, height: 480.0, across: usize::MAX, down: 2, times },
            Basis::Ring { over: Coordinate::Azimuth, period: f64::INFINITY, nodes: 4, times },
            Basis::Table { z_m, theta_rad, columns },
            curve(0.0, 1.0, 1),
            curve(1.0, 1.0, 4),
            curve(f64::NAN, 1.0, 4),
            curve(-1e308, 1e308, 4),
            Basis::waves(Coordinate::Column, 1e-9, 1),
            Basis::Decay { over: Coordinate::Edge, width: 1e300 },
            Basis::Log1p { over: Coordinate::Blur(1e200) },
            Basis::Log1p { over: Coordinate::TiltBlur(-1.0) },
            Basis::Log1p { over: Coordinate::DepthPower { unit_m: 0.0, power: 3.0 } },
            Basis::Log1p { over: Coordinate::DepthPower { unit_m: 2.0, power: 1e3 } },
            Basis::Map { width: 1e12, height: 480.0, across: 3, down: 2, times },
            Basis::powers(Coordinate::RadiusSquared, 2, Modulation::power(300.0)),
            Basis::Table {
                z_m: [0.5, 1e6],
                theta_rad: [0.0, 1.0],
                columns: vec![vec![0.0; TABLE * TABLE]],
            },
        ];
        for basis in bad {
            assert!(basis.fault().is_some(), "{basis:?}");
        }
    }
}
