//! Folders of depth images without recording.json's views: a TUM sequence, plain PNGs, and a fakenect
//! dump (INDEX.txt and `d-<time>-<stamp>.pgm`, raw 11-bit values of a Kinect v1).

use std::path::Path;

use super::assumed::Assumed;
use super::images::{encode_pgm16, size_of};
use super::layout::{DEPTH_LIST, DESCRIPTION, UnknownKeys, read_sensor};
use super::list::{read_list, shorten};
use super::output::{entries, refuse_full, write_atomic};
use super::stills::{Film, Footage};
use crate::error::{Error, Result, read_text};
use crate::frame::Frame;
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
    let mut described_by = vec![path.clone()];
    let sensor = if description.is_file() {
        let mut unknown = UnknownKeys::default();
        let sensor = read_sensor(&description, &mut unknown)?;
        remarks.extend(unknown.remarks());
        described_by.push(description);
        sensor
    } else {
        let (sensor, remark) = assumed.sequence_sensor(&path, size_of(first)?)?;
        remarks.extend(remark);
        sensor
    };
    Ok((
        Footage {
            frames: list.frames,
            film: Film::Video,
            remarks,
            described_by,
            ..Footage::default()
        },
        sensor,
    ))
}

/// 30 Hz: a plain folder has no clock, and every sensor of this kind runs at it.
pub(super) const NOMINAL_INTERVAL_S: f64 = 1.0 / 30.0;

/// 16-bit PNGs in name order; everything else comes from options.
pub(super) fn images(root: &Path, assumed: &Assumed) -> Result<(Footage, Sensor)> {
    let mut files = entries(root)?;
    files.retain(|p| p.is_file() && p.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")));
    if files.is_empty() {
        return Err(Error::recording(
            root,
            "neither recording.json, depth.txt, INDEX.txt nor a PNG is in this folder",
            "give the folder of a recording, a TUM sequence, a fakenect dump or 16-bit PNGs",
        ));
    }
    let stamped = files
        .into_iter()
        .enumerate()
        .map(|(i, p)| FrameRef::file(i as f64 * NOMINAL_INTERVAL_S, p));
    let frames: Vec<FrameRef> = stamped.collect();
    let (sensor, remark) = assumed.images_sensor(root, &frames)?;
    let remarks = remark.into_iter().collect();
    Ok((Footage { frames, film: Film::Captures, remarks, ..Footage::default() }, sensor))
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
            frames.push(FrameRef::file(timestamp, path));
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
    let (sensor, remark) = assumed.dump_sensor(size_of(first)?)?;
    remarks.extend(remark);
    let footage = Footage {
        frames,
        film: Film::Video,
        remarks,
        described_by: vec![index],
        ..Footage::default()
    };
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

#[cfg(test)]
mod tests {
    #[test]
    fn the_stamp_is_the_first_number() {
        assert_eq!(super::stamp("d-1316653530.207391-4127230476.pgm"), Some(1316653530.207391));
        assert_eq!(super::stamp("d-x-1.pgm"), None);
    }
}
