//! Kinds of depth cameras, and typical properties of the common ones.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::frame::{DepthCode, KINECT_NO_MEASUREMENT};

/// How a camera comes to its depth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SensorKind {
    /// A projected pattern is matched with a stored one.
    StructuredLight,
    /// Two cameras match a projected texture.
    ActiveStereo,
    /// The time that light takes there and back.
    TimeOfFlight,
}

impl SensorKind {
    /// The kinds that match patterns: they have a disparity and a baseline.
    pub const MATCHING: &[SensorKind] = &[SensorKind::StructuredLight, SensorKind::ActiveStereo];
    pub const ALL: &[SensorKind] =
        &[SensorKind::StructuredLight, SensorKind::ActiveStereo, SensorKind::TimeOfFlight];

    pub fn has_disparity(self) -> bool {
        self != SensorKind::TimeOfFlight
    }

    /// Name for use in the middle of a sentence.
    pub fn description(self) -> &'static str {
        match self {
            SensorKind::StructuredLight => "structured light",
            SensorKind::ActiveStereo => "active stereo",
            SensorKind::TimeOfFlight => "time of flight",
        }
    }
}

/// Distance from projector to camera in every Kinect v1, m (LDDIS of the OpenNI device properties;
/// libfreenect: dcmos_emitter_distance = 7.5 cm). Also used where a sensor without a given baseline needs
/// a disparity.
pub const KINECT_BASELINE_M: f64 = 0.075;

/// z = 1/(3.33095 - 0.0030711 raw) of a Kinect v1: the fit that OpenKinect users have shared since 2010,
/// also in libfreenect's own viewer (examples/glpclview.c).
pub(crate) const OPENKINECT: DepthCode = DepthCode::Disparity {
    offset: 3.330_949_516_1,
    slope: -0.003_071_101_6,
    invalid: KINECT_NO_MEASUREMENT,
};

/// Quantisation step of the default mode.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Step {
    /// Step in disparity, px.
    DisparityPx(f64),
    /// Step in depth, m.
    DepthM(f64),
}

/// Typical properties of a camera in its default mode; a unit differs by a percent or so.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Preset {
    /// As given on the command line.
    pub id: &'static str,
    pub name: &'static str,
    pub kind: SensorKind,
    /// Width and height of the depth image, px.
    pub size: (usize, usize),
    pub focal_px: f64,
    pub baseline_m: Option<f64>,
    pub step: Step,
}

/// All of the presets' drivers deliver depth in millimetres.
pub const PRESET_UNITS_PER_METRE: f64 = 1000.0;

pub static PRESETS: [Preset; 6] = [
    Preset {
        id: "kinect-v1",
        name: "Kinect for Xbox 360",
        kind: SensorKind::StructuredLight,
        size: (640, 480),
        // OpenNI and ROS (openni_launch).
        focal_px: 580.0,
        baseline_m: Some(KINECT_BASELINE_M),
        // Konolige and Mihelich, ROS kinect_calibration/technical: an eighth of a pixel.
        step: Step::DisparityPx(0.125),
    },
    Preset {
        id: "primesense",
        name: "PrimeSense Carmine, Asus Xtion or Orbbec Astra",
        kind: SensorKind::StructuredLight,
        size: (640, 480),
        // openni2_camera: the depth camera's default focal length, 570.34 px.
        focal_px: 570.34,
        // The PS1080 reference design, which all of these follow: as in a Kinect v1.
        baseline_m: Some(KINECT_BASELINE_M),
        // The same chip as in a Kinect v1.
        step: Step::DisparityPx(0.125),
    },
    Preset {
        id: "realsense-d415",
        name: "Intel RealSense D415",
        kind: SensorKind::ActiveStereo,
        // Intel, Tuning depth cameras for best performance: the optimal resolution.
        size: (1280, 720),
        // Half the width over the tangent of half of 65 degrees (Intel, Subpixel linearity improvement).
        focal_px: 1004.6,
        // Data sheet of the D400 series.
        baseline_m: Some(0.055),
        // The same paper on subpixel linearity.
        step: Step::DisparityPx(1.0 / 32.0),
    },
    Preset {
        id: "realsense-d435",
        name: "Intel RealSense D435",
        kind: SensorKind::ActiveStereo,
        // Intel, Tuning depth cameras for best performance: the optimal resolution.
        size: (848, 480),
        // Half the width over the tangent of half of 90 degrees (Intel, Subpixel linearity improvement).
        focal_px: 424.0,
        // Data sheet of the D400 series.
        baseline_m: Some(0.05),
        // The same paper on subpixel linearity.
        step: Step::DisparityPx(1.0 / 32.0),
    },
    Preset {
        id: "azure-kinect",
        name: "Azure Kinect or Orbbec Femto, NFOV unbinned",
        kind: SensorKind::TimeOfFlight,
        // Azure Kinect DK hardware specification.
        size: (640, 576),
        // Factory calibration of a unit (panispani/3DReconstruct, calib.md): 503.93 and 503.98 px.
        focal_px: 504.0,
        baseline_m: None,
        // K4A_IMAGE_FORMAT_DEPTH16: millimetres.
        step: Step::DepthM(0.001),
    },
    Preset {
        id: "kinect-v2",
        name: "Kinect for Xbox One",
        kind: SensorKind::TimeOfFlight,
        size: (512, 424),
        // Factory calibration of a unit as libfreenect2 reads it: 365.456 px.
        focal_px: 365.456,
        baseline_m: None,
        // Kinect for Windows SDK 2.0, DepthFrame: millimetres.
        step: Step::DepthM(0.001),
    },
];

impl Preset {
    pub fn find(id: &str) -> Option<&'static Preset> {
        PRESETS.iter().find(|p| p.id == id)
    }

    /// fx, fy, cx, cy, px, for images of the default size or scaled; `None` for another aspect ratio.
    pub fn intrinsics(&self, (width, height): (usize, usize)) -> Option<[f64; 4]> {
        (self.size.0 * height == self.size.1 * width && width > 0).then(|| {
            let focal = self.focal_px * width as f64 / self.size.0 as f64;
            let [cx, cy] = [width, height].map(|n| (n as f64 - 1.0) / 2.0);
            [focal, focal, cx, cy]
        })
    }

    /// Human-readable description of the values used.
    pub fn describe(&self) -> String {
        let baseline =
            self.baseline_m.map_or(String::new(), |b| format!(", baseline {:.0} mm", 1e3 * b));
        let step = match self.step {
            Step::DisparityPx(px) => format!("steps of {px} px of disparity"),
            Step::DepthM(m) => format!("steps of {:.0} mm", 1e3 * m),
        };
        let (width, height) = self.size;
        format!(
            "{}: {}, {width} x {height} px, f = {} px{baseline}, {step}",
            self.name,
            self.kind.description(),
            self.focal_px
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Intel's formula, f = width/2 / tan(hfov/2), and the baseline and step of each kind.
    #[test]
    fn presets_agree_with_themselves() {
        for preset in &PRESETS {
            assert_eq!(Preset::find(preset.id), Some(preset));
            assert_eq!(preset.kind.has_disparity(), preset.baseline_m.is_some(), "{}", preset.id);
            assert_eq!(preset.kind.has_disparity(), matches!(preset.step, Step::DisparityPx(_)));
        }
        for (id, degrees) in [("realsense-d415", 65f64), ("realsense-d435", 90.0)] {
            let preset = Preset::find(id).unwrap();
            let focal = 0.5 * preset.size.0 as f64 / (0.5 * degrees).to_radians().tan();
            assert!((preset.focal_px / focal - 1.0).abs() < 1e-3, "{id}: {focal}");
        }
    }

    #[test]
    fn a_smaller_image_of_the_same_shape_has_a_shorter_focal_length() {
        let kinect = Preset::find("kinect-v1").unwrap();
        assert_eq!(kinect.intrinsics((640, 480)), Some([580.0, 580.0, 319.5, 239.5]));
        assert_eq!(kinect.intrinsics((320, 240)), Some([290.0, 290.0, 159.5, 119.5]));
        assert_eq!(kinect.intrinsics((640, 400)), None);
    }
}
