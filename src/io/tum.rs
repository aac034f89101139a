//! One TUM RGB-D folder: depth.txt and depth/, 5000 units a metre, read as a film of a target.

use std::path::Path;

use super::list::read_list;
use super::stills::{Film, Footage};
use super::{Assumed, assumed_sensor, images};
use crate::error::{Error, Result};
use crate::frame::DepthCode;
use crate::view::Recording;

pub(super) const DEPTH_LIST: &str = "depth.txt";
/// What ROS publishes for an uncalibrated PrimeSense camera; the TUM tools assume it too.
const ROS_DEFAULT: [f64; 4] = [525.0, 525.0, 319.5, 239.5];
/// Scale of the PNGs in the TUM benchmark.
const TUM_CODE: DepthCode = DepthCode::Metric { units_per_metre: 5000.0, invalid: 0 };

pub(super) fn open(root: &Path, assumed: &Assumed) -> Result<Recording> {
    let path = root.join(DEPTH_LIST);
    let list = read_list(&path)?;
    let first = list.frames.first().ok_or_else(|| {
        Error::recording(&path, "no depth frame in it", "list at least one existing depth image")
    })?;
    let size = images::size_of(&first.path)?;
    let mut remarks = list.remarks.clone();
    if assumed.intrinsics.is_none() {
        remarks.push(
            "a TUM folder carries no intrinsics: 525,525,319.5,239.5 assumed; give --intrinsics"
                .into(),
        );
    }
    let sensor = assumed_sensor(
        "TUM RGB-D sequence",
        size,
        assumed.intrinsics.unwrap_or(ROS_DEFAULT),
        assumed.code.unwrap_or(TUM_CODE),
        assumed,
    )?;
    let footage =
        Footage { frames: list.frames, film: Film::Video, remarks, described_by: vec![path] };
    Ok(footage.recording(root, sensor))
}
