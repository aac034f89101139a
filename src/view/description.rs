//! The sensor as `recording.json` describes it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{IntrinsicsUncertainty, Sensor};
use crate::camera::Camera;
use crate::frame::{DepthCode, RawDisparity};
use crate::sensors::{Preset, SensorKind};

/// `recording.json` (`crate::docs::layouts`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RecordingFile {
    pub format: String,
    pub sensor: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub serial: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mode: Option<String>,
    /// width, height, fx, fy, cx, cy, distortion; px.
    #[serde(flatten)]
    pub camera: Camera,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub baseline_m: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kind: Option<SensorKind>,
    /// Standard uncertainties of fx, fy, cx, cy, px.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intrinsics_uncertainty: Option<IntrinsicsUncertainty>,
    /// Raw units a metre, 1/m; this or `raw_disparity`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub units_per_metre: Option<f64>,
    /// The raw value for "no measurement" beside `units_per_metre`; 0 by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub invalid: Option<u16>,
    /// z = 1/(offset + slope raw).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub raw_disparity: Option<RawDisparity>,
}

/// The only recording format there is.
pub const RECORDING_FORMAT: &str = "recording/1";

impl RecordingFile {
    pub fn of(sensor: &Sensor) -> Self {
        let (units_per_metre, invalid, raw_disparity) = match sensor.code {
            DepthCode::Metric { units_per_metre, invalid } => {
                (Some(units_per_metre), Some(invalid), None)
            }
            DepthCode::Disparity { offset, slope, invalid } => {
                (None, None, Some(RawDisparity { offset, slope, invalid }))
            }
        };
        RecordingFile {
            format: RECORDING_FORMAT.into(),
            sensor: sensor.name.clone(),
            serial: sensor.serial.clone(),
            mode: sensor.mode.clone(),
            camera: sensor.camera.clone(),
            baseline_m: sensor.baseline_m,
            kind: sensor.kind,
            intrinsics_uncertainty: sensor.intrinsics_uncertainty,
            units_per_metre,
            invalid,
            raw_disparity,
        }
    }

    /// The sensor described, or what is wrong with the description.
    pub fn sensor(self) -> Result<Sensor, String> {
        let code = match (self.units_per_metre, self.raw_disparity) {
            (Some(units_per_metre), None) => {
                DepthCode::Metric { units_per_metre, invalid: self.invalid.unwrap_or(0) }
            }
            (None, Some(RawDisparity { offset, slope, invalid })) => {
                if self.invalid.is_some_and(|given| given != invalid) {
                    return Err("invalid of raw disparities stands within raw_disparity".into());
                }
                DepthCode::Disparity { offset, slope, invalid }
            }
            (None, None) => return Err("neither units_per_metre nor raw_disparity is given".into()),
            (Some(_), Some(_)) => {
                return Err("units_per_metre and raw_disparity contradict each other".into());
            }
        };
        // A preset's name states the kind as `--sensor` does.
        let kind = self.kind.or_else(|| Preset::find(&self.sensor).map(|preset| preset.kind));
        let sensor = Sensor {
            name: self.sensor,
            serial: self.serial,
            mode: self.mode,
            camera: self.camera,
            baseline_m: self.baseline_m,
            code,
            intrinsics_uncertainty: self.intrinsics_uncertainty,
            kind,
        };
        match sensor.fault() {
            Some(fault) => Err(fault),
            None => Ok(sensor),
        }
    }
}
