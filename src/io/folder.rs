//! Folders of depth images without recording.json's views: a TUM sequence, plain PNGs, and a fakenect
//! dump (INDEX.txt and `d-<time>-<stamp>.pgm`, raw 11-bit values of a Kinect v1). What such a folder
//! does not say of its sensor is given by options, or is what is usual.

use std::path::Path;

use super::images::{encode_pgm16, size_of};
use super::layout::{DEPTH_LIST, DESCRIPTION, UnknownKeys, read_sensor};
use super::list::{read_list, shorten};
use super::output::{entries, refuse_full, write_atomic};
use super::stills::{Film, Footage};
use crate::camera::Camera;
use crate::error::{Error, Result, read_text};
use crate::frame::{DepthCode, Frame, KINECT_NO_MEASUREMENT};
use crate::units::shortest;
use crate::view::{FrameRef, Sensor};

/// depth.txt and depth/ as in the TUM benchmark, read as a film of a target. A recording.json
/// beside depth.txt describes its sensor, as simulated rooms have it.
pub(super) fn sequence(root: &Path, assumed: &Assumed) -> Result<(Footage, Sensor)> {
    let path = root.join(DEPTH_LIST);
    let list = read_list(&path)?;
    let first = list.frames.first().ok_or_else(|| {
        Error::recording(&path, "no depth frame in it", "list at least one existing depth image")
    })?;
    let mut remarks = list.remarks;
    let description = root.join(DESCRIPTION);
    let mut described_by = vec![path];
    let sensor = if description.is_file() {
        let mut unknown = UnknownKeys::default();
        let sensor = read_sensor(&description, &mut unknown)?;
        remarks.extend(unknown.remarks());
        described_by.push(description);
        sensor
    } else {
        let (sensor, remark) = assumed.sequence_sensor(size_of(&first.path)?)?;
        remarks.extend(remark);
        sensor
    };
    Ok((Footage { frames: list.frames, film: Film::Video, remarks, described_by }, sensor))
}

/// 30 Hz: a plain folder has no clock, and every sensor of this kind runs at it.
const NOMINAL_INTERVAL_S: f64 = 1.0 / 30.0;

/// 16-bit PNGs in name order; everything else comes from options.
pub(super) fn images(root: &Path, assumed: &Assumed) -> Result<(Footage, Sensor)> {
    let mut files = entries(root)?;
    files.retain(|p| p.is_file() && p.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")));
    let Some(first) = files.first() else {
        return Err(Error::recording(
            root,
            "neither recording.json, depth.txt, INDEX.txt nor a PNG is in this folder",
            "give the folder of a recording, a TUM sequence, a fakenect dump or 16-bit PNGs",
        ));
    };
    let (sensor, remark) = assumed.images_sensor(root, size_of(first)?)?;
    let frames = files
        .into_iter()
        .enumerate()
        .map(|(i, path)| FrameRef { timestamp: i as f64 * NOMINAL_INTERVAL_S, path })
        .collect();
    let remarks = remark.into_iter().collect();
    Ok((Footage { frames, film: Film::Captures, remarks, described_by: Vec::new() }, sensor))
}

pub(crate) const INDEX: &str = "INDEX.txt";
/// INDEX.txt and the depth frames that it names.
pub(super) fn dump(root: &Path, assumed: &Assumed) -> Result<(Footage, Sensor)> {
    let index = root.join(INDEX);
    let text = read_text(&index)?;
    let mut remarks = Vec::new();
    let mut frames = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let name = line.trim();
        if !name.starts_with("d-") {
            continue;
        }
        let timestamp = stamp(name).ok_or_else(|| {
            let what = format!("\"{}\" is not d-<time>-<stamp>.pgm", shorten(name));
            Error::text(&index, i + 1, what, "record the dump with fakenect-record")
        })?;
        let path = root.join(name);
        if path.is_file() {
            frames.push(FrameRef { timestamp, path });
        } else {
            remarks
                .push(format!("INDEX.txt line {} names {name}, which is missing; left out", i + 1));
        }
    }
    let first = frames.first().ok_or_else(|| {
        Error::recording(
            &index,
            "no depth frame (d-*.pgm) in it",
            "record the dump with fakenect-record",
        )
    })?;
    let (sensor, remark) = assumed.dump_sensor(size_of(&first.path)?)?;
    remarks.extend(remark);
    let footage = Footage { frames, film: Film::Video, remarks, described_by: vec![index] };
    Ok((footage, sensor))
}

/// Write depth frames as fakenect-record would have: stamps in s, frames of 640 x 480 raw values.
/// fakenect plays nothing else.
pub fn write_dump<'a>(
    root: &Path,
    frames: impl IntoIterator<Item = (f64, &'a Frame)>,
) -> Result<()> {
    refuse_full(root)?;
    std::fs::create_dir_all(root).map_err(|e| Error::write(root, e))?;
    let mut index = String::new();
    for (stamp, frame) in frames {
        // The sensor's own clock: 60 MHz in 32 bits.
        let ticks = (stamp * CLOCK_HZ) as u64 as u32;
        let name = format!("d-{stamp:.6}-{ticks}.pgm");
        let file = root.join(&name);
        std::fs::write(&file, encode_pgm16(frame)).map_err(|e| Error::write(&file, e))?;
        index += &name;
        index.push('\n');
    }
    write_atomic(&root.join(INDEX), index.as_bytes())
}

/// Of a Kinect v1's timestamps.
const CLOCK_HZ: f64 = 60e6;

/// Host time in seconds: the first number of `d-<time>-<stamp>.pgm`.
fn stamp(name: &str) -> Option<f64> {
    let rest = name.strip_prefix("d-")?.strip_suffix(".pgm")?;
    let (time, _) = rest.split_once('-')?;
    time.parse().ok().filter(|t: &f64| t.is_finite())
}

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

#[cfg(test)]
mod tests {
    #[test]
    fn the_stamp_is_the_first_number() {
        assert_eq!(super::stamp("d-1316653530.207391-4127230476.pgm"), Some(1316653530.207391));
        assert_eq!(super::stamp("d-x-1.pgm"), None);
    }
}
