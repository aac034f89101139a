//! The sensor of a folder that does not describe it: from options, else from what is usual.

use std::path::Path;

use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::frame::{DepthCode, KINECT_NO_MEASUREMENT};
use crate::units::shortest;
use crate::view::Sensor;

/// What the user knows about a folder that does not describe itself.
#[derive(Debug, Clone, Default)]
pub struct Assumed {
    /// fx, fy, cx, cy in px.
    pub intrinsics: Option<[f64; 4]>,
    pub code: Option<DepthCode>,
    /// Distance between projector and camera, m.
    pub baseline_m: Option<f64>,
}

/// z = 1/(3.33095 - 0.0030711 raw): the fit OpenKinect users have shared since 2010.
const OPENKINECT: DepthCode = DepthCode::Disparity {
    offset: 3.330_949_516_1,
    slope: -0.003_071_101_6,
    invalid: KINECT_NO_MEASUREMENT,
};
/// Focal length of a Kinect v1 infrared camera to a percent, and the image centre.
const KINECT_INTRINSICS: [f64; 4] = [585.0, 585.0, 319.5, 239.5];
/// Projector to camera in every Kinect v1 (LDDIS of the OpenNI device properties: 7.5 cm).
const KINECT_BASELINE_M: f64 = 0.075;
/// What ROS publishes for an uncalibrated PrimeSense camera; the TUM tools assume it too.
const ROS_INTRINSICS: [f64; 4] = [525.0, 525.0, 319.5, 239.5];
/// Scale of the PNGs in the TUM benchmark.
const TUM_CODE: DepthCode = DepthCode::Metric { units_per_metre: 5000.0, invalid: 0 };
/// OpenNI and ROS write millimetres.
const MILLIMETRES: DepthCode = DepthCode::Metric { units_per_metre: 1000.0, invalid: 0 };

impl Assumed {
    /// An option that would have no effect must not look as if it had one.
    /// An error when anything is assumed where the file `description` describes the sensor.
    pub(super) fn refuse_beside(&self, description: &Path) -> Result<()> {
        let code = self.code.map(|code| match code {
            DepthCode::Metric { .. } => "--units-per-metre",
            DepthCode::Disparity { .. } => "--raw-disparity",
        });
        let intrinsics = self.intrinsics.map(|_| "--intrinsics");
        let baseline = self.baseline_m.map(|_| "--baseline");
        let given: Vec<&str> = [intrinsics, code, baseline].into_iter().flatten().collect();
        if given.is_empty() {
            return Ok(());
        }
        Err(Error::Argument {
            what: format!(
                "{}: {} describes its sensor itself",
                given.join(" and "),
                description.display()
            ),
            remedy: "leave the option out, or correct that file",
        })
    }

    /// The Kinect whose fakenect dump has frames of `size` px, and what was assumed of it.
    pub(super) fn dump_sensor(&self, size: (usize, usize)) -> Result<(Sensor, Option<String>)> {
        let remark = (self.intrinsics.is_none() || self.code.is_none()).then(|| {
            "a fakenect dump carries no calibration: OpenKinect's depth formula and f = 585 px assumed; \
             give --intrinsics and --raw-disparity"
                .into()
        });
        let baseline_m = self.baseline_m.or(Some(KINECT_BASELINE_M));
        let kinect = Assumed { baseline_m, ..*self };
        let name = "Kinect for Xbox 360 (fakenect dump)";
        Ok((kinect.sensor(name, size, KINECT_INTRINSICS, OPENKINECT)?, remark))
    }

    /// The sensor of a TUM sequence with images of `size` px, and what was assumed of it.
    pub(super) fn sequence_sensor(&self, size: (usize, usize)) -> Result<(Sensor, Option<String>)> {
        let remark = self.intrinsics.is_none().then(|| {
            "a TUM folder carries no intrinsics: 525,525,319.5,239.5 assumed; give --intrinsics"
                .into()
        });
        Ok((self.sensor("TUM RGB-D sequence", size, ROS_INTRINSICS, TUM_CODE)?, remark))
    }

    /// The sensor of a plain folder with images of `size` px, and what was assumed of it.
    pub(super) fn images_sensor(
        &self,
        root: &Path,
        size: (usize, usize),
    ) -> Result<(Sensor, Option<String>)> {
        let Some(intrinsics) = self.intrinsics else {
            return Err(Error::recording(
                root,
                "a plain folder of PNGs carries no intrinsics",
                "give --intrinsics fx,fy,cx,cy (and --units-per-metre or --raw-disparity)",
            ));
        };
        let remark = self.code.is_none().then(|| {
            "depth taken as millimetres; give --units-per-metre or --raw-disparity if not".into()
        });
        Ok((self.sensor("depth images", size, intrinsics, MILLIMETRES)?, remark))
    }

    /// A sensor with images of this size, px, as usual where nothing else is known.
    /// An error when the intrinsics are no camera's.
    pub(crate) fn sensor(
        &self,
        name: &str,
        (width, height): (usize, usize),
        usual_intrinsics: [f64; 4],
        usual_code: DepthCode,
    ) -> Result<Sensor> {
        let intrinsics = self.intrinsics.unwrap_or(usual_intrinsics);
        let [fx, fy, cx, cy] = intrinsics;
        let sensor = Sensor {
            name: name.into(),
            serial: None,
            mode: None,
            camera: Camera { width, height, fx, fy, cx, cy, distortion: None },
            baseline_m: self.baseline_m,
            code: self.code.unwrap_or(usual_code),
        };
        match sensor.fault() {
            Some(what) => Err(Error::Argument {
                what: format!("--intrinsics {}: {what}", intrinsics.map(shortest).join(",")),
                remedy: "give fx,fy,cx,cy in pixels",
            }),
            None => Ok(sensor),
        }
    }
}
