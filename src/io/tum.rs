//! One TUM RGB-D folder: depth.txt and depth/, 5000 units a metre, read as a film of a target.
//! A recording.json beside depth.txt describes its sensor, as simulated rooms have it.

use std::path::Path;

use super::layout::{DESCRIPTION, read_sensor};
use super::list::read_list;
use super::stills::{Film, Footage};
use super::unknown::UnknownKeys;
use super::{Assumed, assumed_sensor, images};
use crate::error::{Error, Result};
use crate::frame::DepthCode;
use crate::view::Sensor;

pub(super) const DEPTH_LIST: &str = "depth.txt";
/// What ROS publishes for an uncalibrated PrimeSense camera; the TUM tools assume it too.
const ROS_DEFAULT: [f64; 4] = [525.0, 525.0, 319.5, 239.5];
/// Scale of the PNGs in the TUM benchmark.
const TUM_CODE: DepthCode = DepthCode::Metric { units_per_metre: 5000.0, invalid: 0 };

pub(super) fn footage(root: &Path, assumed: &Assumed) -> Result<(Footage, Sensor)> {
    let path = root.join(DEPTH_LIST);
    let list = read_list(&path)?;
    let first = list.frames.first().ok_or_else(|| {
        Error::recording(&path, "no depth frame in it", "list at least one existing depth image")
    })?;
    let mut remarks = list.remarks.clone();
    let description = root.join(DESCRIPTION);
    let mut described_by = vec![path];
    let sensor = if description.is_file() {
        let mut unknown = UnknownKeys::default();
        let sensor = read_sensor(&description, &mut unknown)?;
        remarks.extend(unknown.remarks());
        described_by.push(description);
        sensor
    } else {
        undescribed(images::size_of(&first.path)?, assumed, &mut remarks)?
    };
    let footage = Footage { frames: list.frames, film: Film::Video, remarks, described_by };
    Ok((footage, sensor))
}

/// The sensor of a folder that says nothing about it.
fn undescribed(
    size: (usize, usize),
    assumed: &Assumed,
    remarks: &mut Vec<String>,
) -> Result<Sensor> {
    if assumed.intrinsics.is_none() {
        remarks.push(
            "a TUM folder carries no intrinsics: 525,525,319.5,239.5 assumed; give --intrinsics"
                .into(),
        );
    }
    assumed_sensor(
        "TUM RGB-D sequence",
        size,
        assumed.intrinsics.unwrap_or(ROS_DEFAULT),
        assumed.code.unwrap_or(TUM_CODE),
        assumed,
    )
}
