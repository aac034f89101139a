//! A plain folder of 16-bit PNGs, in name order; everything else must be told by options.

use std::path::{Path, PathBuf};

use super::stills::{Film, Footage};
use super::{Assumed, assumed_sensor, entries, images};
use crate::error::{Error, Result};
use crate::frame::DepthCode;
use crate::view::{FrameRef, Sensor};

/// OpenNI and ROS write millimetres.
const MILLIMETRES: DepthCode = DepthCode::Metric { units_per_metre: 1000.0, invalid: 0 };

pub(super) fn footage(root: &Path, assumed: &Assumed) -> Result<(Footage, Sensor)> {
    let files = png_files(root)?;
    let Some(first) = files.first() else {
        return Err(Error::recording(
            root,
            "neither recording.json, depth.txt, INDEX.txt nor a PNG is in this folder",
            "give the folder of a recording, a TUM sequence, a fakenect dump or 16-bit PNGs",
        ));
    };
    let (sensor, remarks) = sensor(root, images::size_of(first)?, assumed)?;
    let frames = files
        .into_iter()
        .enumerate()
        .map(|(i, path)| FrameRef { timestamp: i as f64 * NOMINAL_INTERVAL_S, path })
        .collect();
    let footage = Footage { frames, film: Film::Captures, remarks, described_by: Vec::new() };
    Ok((footage, sensor))
}

/// The sensor that took images of `size` px, as far as options tell, and what was assumed.
pub(super) fn sensor(
    root: &Path,
    size: (usize, usize),
    assumed: &Assumed,
) -> Result<(Sensor, Vec<String>)> {
    let Some(intrinsics) = assumed.intrinsics else {
        return Err(Error::recording(
            root,
            "a plain folder of PNGs carries no intrinsics",
            "give --intrinsics fx,fy,cx,cy (and --units-per-metre or --raw-disparity)",
        ));
    };
    let mut remarks = Vec::new();
    let code = assumed.code.unwrap_or_else(|| {
        remarks.push(
            "depth taken as millimetres; give --units-per-metre or --raw-disparity if not".into(),
        );
        MILLIMETRES
    });
    Ok((assumed_sensor("depth images", size, intrinsics, code, assumed)?, remarks))
}

/// 30 Hz: a plain folder has no clock, and every sensor of this kind runs at it.
const NOMINAL_INTERVAL_S: f64 = 1.0 / 30.0;

fn png_files(root: &Path) -> Result<Vec<PathBuf>> {
    let mut files = entries(root)?;
    files.retain(|p| p.is_file() && p.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")));
    Ok(files)
}
