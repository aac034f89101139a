//! Folders of depth images without recording.json's views: a TUM sequence, and plain PNGs.

use std::path::Path;

use super::assumed::Assumed;
use super::images::size_of;
use super::layout::{DEPTH_LIST, DESCRIPTION, read_sensor};
use super::list::read_list;
use super::output::entries;
use super::stills::{Film, Footage};
use super::unknown::UnknownKeys;
use crate::error::{Error, Result};
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
