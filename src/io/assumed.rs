//! Sensor properties that a folder does not state: given by options, inferred from its values, or defaults.

use std::path::Path;

use super::images::size_of;
use super::raw_values::RawValues;
use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::frame::DepthCode;
use crate::read::read_text;
use crate::sensors::{KINECT_BASELINE_M, OPENKINECT, PRESET_UNITS_PER_METRE, Preset};
use crate::units::shortest;
use crate::view::{FrameRef, Sensor};

/// What the user knows about a folder that does not describe itself.
#[derive(Debug, Clone, Default)]
pub struct Assumed {
    /// fx, fy, cx, cy in px.
    pub intrinsics: Option<[f64; 4]>,
    pub code: Option<DepthCode>,
    /// Distance between projector and camera, m.
    pub baseline_m: Option<f64>,
    /// Camera model that supplies everything else.
    pub preset: Option<&'static Preset>,
    /// Depth topic of a bag, or array of a NumPy archive.
    pub topic: Option<String>,
}

/// Focal length of a Kinect v1 infrared camera, good to a percent, and the image centre.
const KINECT_INTRINSICS: [f64; 4] = [585.0, 585.0, 319.5, 239.5];
/// What ROS publishes for an uncalibrated PrimeSense camera; the TUM tools assume it too.
const ROS_INTRINSICS: [f64; 4] = [525.0, 525.0, 319.5, 239.5];
/// Size of the images that these intrinsics belong to, px.
const USUAL_SIZE: (usize, usize) = (640, 480);
/// Scale of the PNGs in the TUM benchmark.
const TUM_CODE: DepthCode = DepthCode::Metric { units_per_metre: 5000.0, invalid: 0 };

/// Calibration that the benchmark publishes for a colour camera, to which depth is registered.
struct Published {
    name: &'static str,
    /// fx, fy, cx, cy, px.
    intrinsics: [f64; 4],
    /// k1, k2, p1, p2, k3. Depth is registered to the distorted colour image: with these coefficients the RPE
    /// over 1 s of freiburg1_rpy falls from 64 to 46 mm.
    distortion: Option<[f64; 5]>,
}

const FREIBURG: [Published; 3] = [
    Published {
        name: "freiburg1",
        intrinsics: [517.3, 516.5, 318.6, 255.3],
        distortion: Some([0.2624, -0.9531, -0.0054, 0.0026, 1.1633]),
    },
    Published {
        name: "freiburg2",
        intrinsics: [520.9, 521.0, 325.1, 249.7],
        distortion: Some([0.2312, -0.7849, -0.0033, -0.0001, 0.9172]),
    },
    Published { name: "freiburg3", intrinsics: [535.4, 539.2, 320.1, 247.6], distortion: None },
];

/// Published camera of a sequence. The benchmark's lists name their bag, and with it the camera, in a
/// comment; its images all have one size.
fn published(list: &Path, size: (usize, usize)) -> Option<&'static Published> {
    if size != USUAL_SIZE {
        return None;
    }
    let list = read_text(list).ok()?;
    let mut head = list.lines().take_while(|line| line.starts_with('#'));
    head.find_map(|line| FREIBURG.iter().find(|p| line.contains(p.name)))
}

impl Assumed {
    /// Rejects options that would have no effect.
    /// Fails if anything is assumed where the file `description` describes the sensor.
    pub(super) fn refuse_beside(&self, description: &Path) -> Result<()> {
        let code = self.code.map(|code| match code {
            DepthCode::Metric { .. } => "--units-per-metre",
            DepthCode::Disparity { .. } => "--raw-disparity",
        });
        let intrinsics = self.intrinsics.map(|_| "--intrinsics");
        let baseline = self.baseline_m.map(|_| "--baseline");
        let preset = self.preset.map(|_| "--sensor");
        let given: Vec<&str> = [intrinsics, code, baseline, preset].into_iter().flatten().collect();
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

    /// Fails if a topic is chosen where there are none.
    pub(crate) fn refuse_topic(&self, root: &Path) -> Result<()> {
        match &self.topic {
            Some(topic) => Err(Error::Argument {
                what: format!("--topic {topic}: {} is a folder of images", root.display()),
                remedy: "leave the option out: bags and NumPy archives alone have topics",
            }),
            None => Ok(()),
        }
    }

    /// The Kinect of a fakenect dump with frames of `size` px, and what was assumed of it.
    pub(super) fn dump_sensor(&self, size: (usize, usize)) -> Result<(Sensor, Option<String>)> {
        let known = self.intrinsics.is_some() || self.preset.is_some();
        let (formula, focal) = ("OpenKinect's depth formula", "f = 585 px");
        let remark = match (known, self.code.is_some()) {
            (true, true) => None,
            (false, false) => Some(format!(
                "{formula} and {focal} assumed; give --intrinsics and --raw-disparity"
            )),
            (true, false) => Some(format!("{formula} assumed; give --raw-disparity")),
            (false, true) => Some(format!("{focal} assumed; give --intrinsics")),
        };
        let remark = remark.map(|what| format!("a fakenect dump carries no calibration: {what}"));
        let baseline_m = self.baseline_m.or(Some(KINECT_BASELINE_M));
        let kinect = Assumed { baseline_m, ..self.clone() };
        let name = "Kinect for Xbox 360 (fakenect dump)";
        Ok((kinect.sensor(name, size, KINECT_INTRINSICS, OPENKINECT)?, remark))
    }

    /// Sensor of a TUM sequence with this depth list and images of `size` px, and what was assumed of it.
    pub(super) fn sequence_sensor(
        &self,
        list: &Path,
        size: (usize, usize),
    ) -> Result<(Sensor, Option<String>)> {
        const NAME: &str = "TUM RGB-D sequence";
        let known = published(list, size);
        if let (Some(given), Some(of)) = (self.intrinsics, known) {
            let remark = format!(
                "--intrinsics replaces {}'s published camera (depth.txt names it), which is {}{}",
                of.name,
                of.intrinsics.map(shortest).join(","),
                if of.distortion.is_some() { " with a distortion" } else { "" }
            );
            let differs = given != of.intrinsics || of.distortion.is_some();
            return Ok((self.sensor(NAME, size, given, TUM_CODE)?, differs.then_some(remark)));
        }
        if let Some(of) = known {
            let published = Assumed { intrinsics: Some(of.intrinsics), ..self.clone() };
            let mut sensor = published.sensor(NAME, size, of.intrinsics, TUM_CODE)?;
            sensor.camera.distortion = of.distortion;
            let remark = format!("depth.txt says {}: its published camera is used", of.name);
            return Ok((sensor, Some(remark)));
        }
        let open = self.intrinsics.is_none() && self.preset.is_none();
        let remark = match (open, self.code.is_none()) {
            (true, true) => Some(
                "a TUM folder carries no intrinsics and no unit: 525,525,319.5,239.5 and 5000 units a metre \
                 assumed; give --intrinsics and --units-per-metre",
            ),
            (true, false) => Some(
                "a TUM folder carries no intrinsics: 525,525,319.5,239.5 assumed; give --intrinsics",
            ),
            (false, true) => Some(
                "a TUM folder carries no unit: 5000 units a metre assumed; give --units-per-metre",
            ),
            (false, false) => None,
        };
        let remark = remark.map(String::from);
        Ok((self.sensor(NAME, size, ROS_INTRINSICS, TUM_CODE)?, remark))
    }

    /// Sensor of a plain folder with these images, and what was assumed of it. The depth code is given or
    /// inferred from the values themselves: a guess would give numbers that look right.
    pub(super) fn images_sensor(
        &self,
        root: &Path,
        images: &[FrameRef],
    ) -> Result<(Sensor, Option<String>)> {
        if self.intrinsics.is_none() && self.preset.is_none() {
            return Err(Error::recording(
                root,
                "a plain folder of PNGs carries no intrinsics",
                "give --intrinsics fx,fy,cx,cy or --sensor (and --units-per-metre or --raw-disparity)",
            ));
        }
        let Some(first) = images.first() else {
            return Err(Error::recording(root, "no image in it", "give a folder of 16-bit PNGs"));
        };
        let usual = self.intrinsics.unwrap_or(KINECT_INTRINSICS);
        let mut sensor = self.sensor("depth images", size_of(first)?, usual, OPENKINECT)?;
        if self.code.is_some() {
            return Ok((sensor, None));
        }
        let decided = RawValues::of(images.iter()).code(sensor.may_be_kinect());
        let (code, why) = match (decided, self.preset) {
            (Ok(decided), _) => decided,
            (Err(_), Some(preset)) => {
                let units_per_metre = PRESET_UNITS_PER_METRE;
                let millimetres = DepthCode::Metric { units_per_metre, invalid: 0 };
                (
                    millimetres,
                    format!("millimetres assumed, as the driver of {} gives them", preset.id),
                )
            }
            (Err(what), None) => {
                const REMEDY: &str =
                    "give --units-per-metre (1000 = mm, 5000 = TUM) or --raw-disparity";
                return Err(Error::recording(root, what, REMEDY));
            }
        };
        sensor.code = code;
        Ok((sensor, Some(format!("{why}; give --units-per-metre or --raw-disparity if not"))))
    }

    /// Sensor with images of this size, px, using the usual values where nothing else is known.
    /// Fails if the intrinsics are not a camera's, or if there are none for this size.
    pub(crate) fn sensor(
        &self,
        name: &str,
        (width, height): (usize, usize),
        usual_intrinsics: [f64; 4],
        usual_code: DepthCode,
    ) -> Result<Sensor> {
        // For a preset without images of this shape, nothing else is guessed.
        let usual = match self.preset {
            Some(preset) => preset.intrinsics((width, height)),
            None => ((width, height) == USUAL_SIZE).then_some(usual_intrinsics),
        };
        let intrinsics = self.intrinsics.or(usual).ok_or_else(|| Error::Argument {
            what: format!("nothing tells the intrinsics of images of {width} x {height} px"),
            remedy: "give --intrinsics fx,fy,cx,cy in pixels",
        })?;
        let [fx, fy, cx, cy] = intrinsics;
        let sensor = Sensor {
            name: self.preset.map_or(name, |p| p.name).into(),
            serial: None,
            mode: None,
            camera: Camera { width, height, fx, fy, cx, cy, distortion: None },
            baseline_m: self.baseline_m.or(self.preset.and_then(|p| p.baseline_m)),
            code: self.code.unwrap_or(usual_code),
            intrinsics_uncertainty: None,
            kind: self.preset.map(|p| p.kind),
        };
        if let Some(what) = sensor.camera.fault() {
            return Err(Error::Argument {
                what: format!("--intrinsics {}: {what}", intrinsics.map(shortest).join(",")),
                remedy: "give fx,fy,cx,cy in pixels",
            });
        }
        match sensor.fault() {
            Some(what) => Err(Error::Argument {
                what,
                remedy: "correct the option, or what the recording says",
            }),
            None => Ok(sensor),
        }
    }
}
