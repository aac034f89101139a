//! A recording: a sensor and the views it took of a planar target.

use std::path::PathBuf;
use std::sync::Arc;

use crate::camera::Camera;
use crate::error::Result;
use crate::frame::{DepthCode, Frame, RawDisparity};
use crate::sensors::SensorKind;
use crate::units::shortest;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// From half of the smallest structured-light module's (1 cm) to twice the longest stereo rig's on a
/// car's roof (1.5 m).
const BASELINE_M: [f64; 2] = [0.005, 3.0];
/// Where a disparity is as large as the image is wide. Stereo cameras on cars see from 2 to 3 m on.
const MAX_NEAREST_M: f64 = 10.0;

/// The unit that was recorded: everything `recording.json` says about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensor {
    pub name: String,
    pub serial: Option<String>,
    /// "normal" or "near".
    pub mode: Option<String>,
    pub camera: Camera,
    /// Distance between projector and camera, m.
    pub baseline_m: Option<f64>,
    pub code: DepthCode,
    /// How well the intrinsics are known, where the recording says so.
    pub intrinsics_uncertainty: Option<IntrinsicsUncertainty>,
    /// How it comes to its depth, where that is known.
    pub kind: Option<SensorKind>,
}

impl Sensor {
    /// fx * baseline: disparity in px is this over the depth in m.
    pub fn disparity_px_m(&self) -> Option<f64> {
        self.baseline_m.filter(|_| self.may_have_disparity()).map(|b| self.camera.fx * b)
    }

    /// Not a time-of-flight camera, as far as is known.
    pub fn may_have_disparity(&self) -> bool {
        self.kind.is_none_or(SensorKind::has_disparity)
    }

    /// What is wrong with these numbers, if anything.
    pub fn fault(&self) -> Option<String> {
        let camera = self.camera.fault().map(|fault| fault.to_string());
        let uncertainty = || self.intrinsics_uncertainty?.fault(&self.camera);
        camera.or_else(|| self.code.fault()).or_else(|| self.baseline_fault()).or_else(uncertainty)
    }

    fn baseline_fault(&self) -> Option<String> {
        let baseline_m = self.baseline_m?;
        let shown = shortest(baseline_m);
        let [low, high] = BASELINE_M;
        if !(low..=high).contains(&baseline_m) {
            return Some(format!("baseline_m = {shown} is not from {low} to {high} m"));
        }
        let Camera { fx, width, .. } = self.camera;
        let nearest_m = fx * baseline_m / width as f64;
        (nearest_m > MAX_NEAREST_M).then(|| {
            format!(
                "baseline_m = {shown} and fx = {} px let both eyes meet first {nearest_m:.0} m away",
                shortest(fx)
            )
        })
    }
}

/// Standard uncertainties (k = 1) of the intrinsics, px; what is not stated is left out.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct IntrinsicsUncertainty {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fx: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fy: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cx: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cy: Option<f64>,
}

impl IntrinsicsUncertainty {
    /// Of fx and fy relative to them; nothing where neither is stated.
    pub fn focal_relative(&self, camera: &Camera) -> Option<[f64; 2]> {
        let relative = [self.fx.map(|u| u / camera.fx), self.fy.map(|u| u / camera.fy)];
        relative.iter().any(Option::is_some).then(|| relative.map(|u| u.unwrap_or(0.0)))
    }

    /// Of the principal point as an angle, rad; nothing where neither coordinate is stated.
    pub fn axis_rad(&self, camera: &Camera) -> Option<[f64; 2]> {
        let angles = [self.cx.map(|u| u / camera.fx), self.cy.map(|u| u / camera.fy)];
        angles.iter().any(Option::is_some).then(|| angles.map(|u| u.unwrap_or(0.0)))
    }

    fn fault(&self, camera: &Camera) -> Option<String> {
        // One that is as large as the number itself says nothing: a unit was mistaken.
        let (width, height) = (camera.width as f64, camera.height as f64);
        let stated = [
            ("fx", self.fx, camera.fx),
            ("fy", self.fy, camera.fy),
            ("cx", self.cx, width),
            ("cy", self.cy, height),
        ];
        stated.into_iter().find_map(|(key, u, below)| {
            let u = u.filter(|u| !(*u > 0.0 && *u < below))?;
            let (u, below) = (shortest(u), shortest(below));
            Some(format!(
                "intrinsics_uncertainty.{key} = {u} must be a standard uncertainty in px, above 0 and below {below}"
            ))
        })
    }
}

/// Where the target is, when the recording says so; pixel coordinates.
#[derive(Debug, Clone, PartialEq)]
pub enum Region {
    /// Corners u0, v0, u1, v1; both edges belong to the region.
    Rectangle([f64; 4]),
    /// May reach outside the image.
    Polygon(Vec<[f64; 2]>),
}

impl Region {
    /// Does the centre of pixel (u, v) lie inside? Even-odd rule for polygons.
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
pub struct TargetSize {
    pub width_m: f64,
    pub height_m: f64,
    /// Distance of the two parallel planes that just hold its surface (ISO 1101), m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flatness_m: Option<f64>,
}

/// A board of which less than this share of the shorter side is flat is not used as a flat target; a
/// flatness in millimetres lies beyond it.
const MAX_FLATNESS: f64 = 0.1;

impl TargetSize {
    /// Of this width and height, m; nothing is stated of its flatness.
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
            shortest(side)
        ))
    }
}

/// What `view.json` may say.
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
    /// What is wrong with these numbers, if anything: the key is named.
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

/// A frame that can be read when it is needed.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameRef {
    /// Seconds, one clock for the whole recording.
    pub timestamp: f64,
    /// The image, or the file that holds it among others.
    pub path: PathBuf,
    /// Which of the frames in `path`; `None` where the file is one image.
    pub within: Option<Within>,
}

impl FrameRef {
    /// An image with a file of its own.
    pub fn file(timestamp: f64, path: PathBuf) -> Self {
        FrameRef { timestamp, path, within: None }
    }

    /// Where it is, for people.
    pub fn place(&self) -> String {
        let file = self.path.display();
        match &self.within {
            None => file.to_string(),
            Some(Within { store, index }) => format!("{file}: {}", store.place(*index)),
        }
    }
}

/// A frame of a file that holds many.
#[derive(Debug, Clone)]
pub struct Within {
    pub store: Arc<dyn FrameStore>,
    pub index: usize,
}

impl PartialEq for Within {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.store, &other.store) && self.index == other.index
    }
}

/// A file that holds many depth frames. It reads one when it is asked for, from any thread, and keeps
/// no more than a few.
pub trait FrameStore: std::fmt::Debug + Send + Sync {
    /// An error, with the place, when the frame is damaged.
    fn frame(&self, index: usize) -> Result<Frame>;
    /// Where a frame stands in the file: its topic and number.
    fn place(&self, index: usize) -> String;
}

/// One still pose of target and sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// The folder's name, or the file's or the stretch's where a view has no folder.
    pub name: String,
    /// Depth frames in time order.
    pub depth: Vec<FrameRef>,
    /// Infrared images in time order; may be none.
    pub infrared: Vec<FrameRef>,
    pub notes: ViewNotes,
}

/// Views in name order, their frames not yet read.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// The folder it was opened from.
    pub root: PathBuf,
    pub sensor: Sensor,
    /// The views that could be opened.
    pub views: Vec<View>,
    pub excluded: Vec<Excluded>,
    /// What was found odd while opening.
    pub remarks: Vec<String>,
    /// Files that describe the recording (not the frames), for provenance.
    pub described_by: Vec<PathBuf>,
}

/// A view that was not used, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct Excluded {
    pub view: String,
    /// What went wrong, where, and what to do.
    pub reason: String,
}

impl Excluded {
    pub(crate) fn of(view: &str, error: &crate::error::Error) -> Self {
        let text = error.to_string();
        // The view's name has its own field.
        let reason = text.strip_prefix(&format!("view {view}: ")).unwrap_or(&text);
        Excluded { view: view.into(), reason: reason.into() }
    }
}

impl std::fmt::Display for Excluded {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "view {} was left out: {}", self.view, self.reason)
    }
}

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
                DepthCode::Disparity { offset, slope, invalid }
            }
            (None, None) => return Err("neither units_per_metre nor raw_disparity is given".into()),
            (Some(_), Some(_)) => {
                return Err("units_per_metre and raw_disparity contradict each other".into());
            }
        };
        let sensor = Sensor {
            name: self.sensor,
            serial: self.serial,
            mode: self.mode,
            camera: self.camera,
            baseline_m: self.baseline_m,
            code,
            intrinsics_uncertainty: self.intrinsics_uncertainty,
            kind: self.kind,
        };
        match sensor.fault() {
            Some(fault) => Err(fault),
            None => Ok(sensor),
        }
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
