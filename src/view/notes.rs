//! Metadata of a view besides its frames: the target, its position, and the conditions.

use serde::{Deserialize, Serialize};

use crate::units::{shortest, to_digits};

/// Region of the target in the image, if the recording gives it; pixel coordinates.
#[derive(Debug, Clone, PartialEq)]
pub enum Region {
    /// Corners u0, v0, u1, v1; both edges belong to the region.
    Rectangle([f64; 4]),
    /// May reach outside the image.
    Polygon(Vec<[f64; 2]>),
}

impl Region {
    /// Whether the centre of pixel (u, v) lies inside; even-odd rule for polygons.
    pub fn contains(&self, u: f64, v: f64) -> bool {
        match self {
            Region::Rectangle([u0, v0, u1, v1]) => u >= *u0 && u <= *u1 && v >= *v0 && v <= *v1,
            Region::Polygon(corners) => {
                let mut inside = false;
                let mut previous = corners[corners.len() - 1];
                for &corner in corners {
                    let [(ua, va), (ub, vb)] = [corner, previous].map(|[a, b]| (a, b));
                    if (va > v) != (vb > v) && u < (ub - ua) * (v - va) / (vb - va) + ua {
                        inside = !inside;
                    }
                    previous = corner;
                }
                inside
            }
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(expecting = "an object with width_m and height_m")]
pub struct TargetSize {
    pub width_m: f64,
    pub height_m: f64,
    /// Distance between the two parallel planes that just enclose its surface (ISO 1101), m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flatness_m: Option<f64>,
}

/// Largest flatness as a share of the shorter side: a worse board is not a flat target, and a flatness
/// given in millimetres exceeds it.
const MAX_FLATNESS: f64 = 0.1;

impl TargetSize {
    /// Size with this width and height, m, and no stated flatness.
    pub fn of(width_m: f64, height_m: f64) -> Self {
        TargetSize { width_m, height_m, flatness_m: None }
    }

    fn fault(&self) -> Option<String> {
        for (key, side) in [("width_m", self.width_m), ("height_m", self.height_m)] {
            if side.is_nan() || side <= 0.0 {
                return Some(format!("target.{key} = {} must be positive", shortest(side)));
            }
        }
        let side = MAX_FLATNESS * self.width_m.min(self.height_m);
        let flatness = self.flatness_m.filter(|f| !(*f > 0.0 && *f <= side))?;
        Some(format!(
            "target.flatness_m = {} must be above 0 and at most a tenth of the target's shorter side, {}; is it in \
             millimetres?",
            shortest(flatness),
            shortest(to_digits(side, 4))
        ))
    }
}

/// Contents of `view.json`.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ViewNotes {
    pub target: Option<TargetSize>,
    /// Depth of the target's plane on the optical axis, measured by other means, m.
    pub reference_distance_m: Option<f64>,
    /// Its standard uncertainty (k = 1), m.
    pub reference_uncertainty_m: Option<f64>,
    /// Where the target is in the image; by default what the principal point looks at.
    pub region: Option<Region>,
    /// Temperature of the sensor or the room, degrees Celsius.
    pub temperature_c: Option<f64>,
    /// Light on the target, lx.
    pub ambient_lux: Option<f64>,
    pub notes: Option<String>,
}

impl ViewNotes {
    /// What is wrong with these numbers, if anything; names the key.
    pub fn fault(&self) -> Option<String> {
        if self.reference_distance_m.is_some_and(|d| !(d.is_finite() && d > 0.0)) {
            return Some("reference_distance_m must be positive".into());
        }
        self.target.and_then(|t| t.fault()).or_else(|| {
            let u = self.reference_uncertainty_m?;
            let Some(distance) = self.reference_distance_m else {
                return Some("reference_uncertainty_m is given without reference_distance_m".into());
            };
            // In millimetres it would be larger than the distance in metres.
            let usable = u > 0.0 && u < distance;
            (!usable).then(|| {
                format!(
                    "reference_uncertainty_m = {} must be above 0 and below reference_distance_m = {}; is it in \
                     millimetres?",
                    shortest(u),
                    shortest(distance)
                )
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polygon_may_be_concave_and_reach_outside() {
        let arrow = Region::Polygon(vec![[-5.0, -5.0], [10.0, 5.0], [-5.0, 15.0], [2.0, 5.0]]);
        assert!(arrow.contains(6.0, 5.0));
        assert!(!arrow.contains(0.0, 5.0), "in the notch");
        assert!(arrow.contains(-3.0, -3.0));
        assert!(!arrow.contains(11.0, 5.0));
    }
}
