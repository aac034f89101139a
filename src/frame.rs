//! A depth frame as stored, and how its raw values become metres.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::units::shortest;

/// One depth image: 16-bit raw values, row-major, still in the sensor's own code.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    pub width: usize,
    pub height: usize,
    /// Raw values, `width * height` of them; [`DepthCode`] turns them into metres.
    pub raw: Vec<u16>,
}

/// How a raw value becomes a depth along the optical axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DepthCode {
    /// z = raw / units_per_metre (5000 in the TUM layout, 1000 for OpenNI and ROS).
    Metric {
        units_per_metre: f64,
        /// The raw value for "no measurement", besides 0.
        invalid: u16,
    },
    /// z = 1 / (offset + slope * raw): the 11-bit values of a Kinect v1.
    Disparity {
        /// Inverse depth of the raw value 0, 1/m.
        offset: f64,
        /// Inverse depth per raw unit, 1/m; negative for a Kinect v1.
        slope: f64,
        invalid: u16,
    },
}

/// The JSON face of [`DepthCode::Disparity`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(expecting = "an object with offset and slope")]
pub struct RawDisparity {
    pub offset: f64,
    pub slope: f64,
    #[serde(default = "default_invalid_disparity")]
    pub invalid: u16,
}

fn default_invalid_disparity() -> u16 {
    KINECT_NO_MEASUREMENT
}

/// The raw value a Kinect v1 writes where it saw no pattern (11 bits, all ones).
pub const KINECT_NO_MEASUREMENT: u16 = 2047;

impl DepthCode {
    /// Depth in metres, or `None` for the raw value that means "no measurement" and for those whose
    /// depth is not a positive finite number.
    pub fn metres(&self, raw: u16) -> Option<f64> {
        let z = match *self {
            DepthCode::Metric { units_per_metre, invalid } => {
                // Zero, and a word of ones, are no measurement in any format of lengths.
                if raw == invalid || raw == 0 || raw == u16::MAX {
                    return None;
                }
                f64::from(raw) / units_per_metre
            }
            DepthCode::Disparity { offset, slope, invalid } => {
                if raw == invalid {
                    return None;
                }
                1.0 / (offset + slope * f64::from(raw))
            }
        };
        (z.is_finite() && z > 0.0 && z < FARTHEST_M).then_some(z)
    }

    /// The raw value nearest to the depth `z` (m), or the one for "no measurement" when none fits.
    pub fn raw(&self, z: f64) -> u16 {
        let exact = match *self {
            DepthCode::Metric { units_per_metre, .. } => z * units_per_metre,
            DepthCode::Disparity { offset, slope, .. } => (1.0 / z - offset) / slope,
        };
        let rounded = exact.round();
        let stored = z > 0.0 && rounded > 0.0 && rounded < f64::from(self.end());
        if stored { rounded as u16 } else { self.invalid() }
    }

    /// The raw value for "no measurement".
    pub fn invalid(&self) -> u16 {
        match *self {
            DepthCode::Metric { invalid, .. } | DepthCode::Disparity { invalid, .. } => invalid,
        }
    }

    /// First raw value past those that a depth is stored as.
    pub fn end(&self) -> u16 {
        match *self {
            // A Kinect's raw values have 11 bits, and the last of them is no measurement.
            DepthCode::Disparity { invalid: KINECT_NO_MEASUREMENT, .. } => KINECT_NO_MEASUREMENT,
            _ => u16::MAX,
        }
    }

    /// One step of the code at depth `z`, in inverse depth (1/m).
    pub fn step_inverse(&self, z: f64) -> f64 {
        match *self {
            DepthCode::Metric { units_per_metre, .. } => 1.0 / (units_per_metre * z * z),
            DepthCode::Disparity { slope, .. } => slope.abs(),
        }
    }

    /// Depth in metres of each of the 65,536 raw values; NaN where there is no measurement.
    pub fn table(&self) -> DepthTable {
        let metres =
            (0..=u16::MAX).map(|raw| self.metres(raw).map_or(f32::NAN, |z| z as f32)).collect();
        DepthTable { metres }
    }

    /// What is wrong with these numbers, if anything.
    pub fn fault(&self) -> Option<String> {
        match *self {
            DepthCode::Metric { units_per_metre, .. } => {
                let [low, high] = UNITS_PER_METRE;
                (!(low..=high).contains(&units_per_metre)).then(|| {
                    let shown = shortest(units_per_metre);
                    format!("units_per_metre = {shown} is not from {low} to {high}")
                })
            }
            DepthCode::Disparity { offset, slope, .. } => {
                let [fine, coarse] = SLOPE;
                let good = offset.abs() <= MAX_OFFSET && (fine..=coarse).contains(&slope.abs());
                (!good).then(|| {
                    format!(
                        "raw_disparity offset = {}, slope = {} give no depth: the offset is up to {MAX_OFFSET} 1/m, the slope {fine} to {coarse} 1/m either way",
                        shortest(offset),
                        shortest(slope)
                    )
                })
            }
        }
    }
}

/// Accepted units per metre, from decimetres to micrometres (with which 16 bits reach 65 mm).
pub const UNITS_PER_METRE: [f64; 2] = [10.0, 1e6];
/// Largest inverse depth of the raw value 0, 1/m: a depth of one centimetre.
const MAX_OFFSET: f64 = 100.0;
/// Accepted inverse depth per raw unit, 1/m. A Kinect has 0.003; the finest is 1/256 px of a stereo pair
/// on a car's roof.
const SLOPE: [f64; 2] = [1e-7, 1.0];

/// Beyond the range of any sensor of this kind, m: 1/(c0 + c1 raw) has a pole, and values just before it
/// would otherwise count as walls a kilometre away.
pub(crate) const FARTHEST_M: f64 = 100.0;

#[derive(Debug, Clone)]
pub struct DepthTable {
    metres: Vec<f32>,
}

impl DepthTable {
    /// Depth along the optical axis, m; NaN where there is no measurement.
    #[inline]
    pub fn metres(&self, raw: u16) -> f32 {
        self.metres[usize::from(raw)]
    }

    /// Depth of every pixel, m; NaN where there is no measurement.
    pub fn depths(&self, frame: &Frame) -> Vec<f32> {
        frame.raw.iter().map(|&word| self.metres(word)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neither_end_of_the_words_is_a_length() {
        let code = DepthCode::Metric { units_per_metre: 1000.0, invalid: 0 };
        assert_eq!([0, u16::MAX].map(|raw| code.metres(raw)), [None; 2]);
        assert_eq!(code.metres(u16::MAX - 1), Some(65.534));
    }

    const KINECT: DepthCode =
        DepthCode::Disparity { offset: 3.3309495161, slope: -0.0030711016, invalid: 2047 };

    #[test]
    fn raw_values_survive_a_round_trip_in_both_codes() {
        let tum = DepthCode::Metric { units_per_metre: 5000.0, invalid: 0 };
        for code in [KINECT, tum] {
            for raw in 1..1080u16 {
                if let Some(z) = code.metres(raw) {
                    assert_eq!(code.raw(z), raw, "{code:?}");
                }
            }
        }
    }

    #[test]
    fn beyond_the_pole_of_the_disparity_code_there_is_no_depth() {
        assert_eq!(KINECT.metres(2047), None);
        assert_eq!(KINECT.metres(1100), None, "negative depth");
        assert!(KINECT.metres(1084).is_none(), "beyond 100 m");
        assert!((KINECT.metres(600).unwrap() - 0.6721).abs() < 1e-3);
    }

    #[test]
    fn no_depth_becomes_no_measurement() {
        assert_eq!(KINECT.raw(f64::NAN), 2047);
        assert_eq!(KINECT.raw(-1.0), 2047);
        let tum = DepthCode::Metric { units_per_metre: 5000.0, invalid: 0 };
        assert_eq!(tum.raw(20.0), 0, "does not fit 16 bits");
    }
}
