//! A fakenect dump: INDEX.txt and `d-<time>-<stamp>.pgm`, raw 11-bit values of a Kinect v1.

use std::path::Path;

use super::assumed::Assumed;
use super::encode::encode_pgm16;
use super::images::size_of;
use super::list::shorten;
use super::output::{refuse_full, write_atomic};
use super::stills::{Film, Footage};
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::view::{FrameRef, Sensor};

pub(crate) const INDEX: &str = "INDEX.txt";
pub(super) fn footage(root: &Path, assumed: &Assumed) -> Result<(Footage, Sensor)> {
    let index = root.join(INDEX);
    let text = std::fs::read_to_string(&index).map_err(|e| Error::read(&index, e))?;
    let mut remarks = Vec::new();
    let mut frames = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let name = line.trim();
        if !name.starts_with("d-") {
            continue;
        }
        let timestamp = stamp(name).ok_or_else(|| Error::Text {
            path: index.clone(),
            line: i + 1,
            what: format!("\"{}\" is not d-<time>-<stamp>.pgm", shorten(name)),
            remedy: "record the dump with fakenect-record",
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
///
/// # Errors
/// When the folder has something in it, or cannot be written.
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
