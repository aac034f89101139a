//! Reading and writing files. Each format has one reader; every layout ends as the same [`Recording`].

mod assumed;
mod container;
mod folder;
mod images;
mod layout;
mod list;
mod output;
mod output_folder;
mod pictures;
mod raw_values;
mod stills;
mod unfinished;

pub use assumed::Assumed;
pub(crate) use folder::results_in;
pub use images::{FrameSource, encode_pgm16, encode_png16, encode_png16_quickly, encode_rgb};
pub(crate) use images::{encode_corrected, is_corrected, read_depth, size_of};
pub(crate) use layout::{DEPTH_LIST, DESCRIPTIONS, INDEX, read_description};
pub use layout::{DESCRIPTION, ViewFile, write_recording_file, write_view_notes};
pub(crate) use list::content_lines;
pub use list::{FrameList, read_list};
pub(crate) use output::{by_number, entries, sync_folder, write_atomic_with};
pub use output::{hex, pretty_json, refuse_full, sha256_hex, write_atomic, write_json};
pub use output_folder::{Leaves, OutputFolder, refuse_inside, refuse_nested, settled};
pub use pictures::{ColourImage, read_infrared};
pub(crate) use unfinished::lock;
pub use unfinished::{Interrupted, discard_stale, discard_unfinished};

use std::fs::File;
use std::path::Path;

use raw_values::RawValues;
use stills::Footage;

use crate::error::{Error, Result};
use crate::read::is_there;
use crate::view::{FrameRef, Recording, Sensor};

/// How the files of a recording are laid out in its folder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// recording.json and one folder per view.
    Recording,
    /// depth.txt as in the TUM benchmark; a recording.json beside it is read too.
    Sequence,
    /// What fakenect-record writes.
    Dump,
    /// PNGs; a recording.json beside them is read too.
    Images,
    /// One file with many frames: a bag or a stack of arrays.
    Container,
}

const WHAT_TO_GIVE: &str = "give the folder of a recording, a TUM sequence, a fakenect dump or 16-bit PNGs, \
                            a ROS bag (.bag, .mcap, .db3), or a NumPy stack (.npy, .npz)";

impl Layout {
    /// Layout of a folder or a file.
    /// Fails if `path` does not exist, or is a file that holds no frames.
    pub fn of(path: &Path) -> Result<Self> {
        if container::is_one(path) {
            return Ok(Layout::Container);
        }
        if path.is_file() {
            File::open(path).map_err(|e| Error::read(path, e))?;
        }
        if !path.is_dir() {
            let what = match path.exists() {
                true => "this is neither a folder nor a file that holds a film",
                false => "there is no such folder or file",
            };
            return Err(Error::recording(path, what, WHAT_TO_GIVE));
        }
        // A described film or plain folder has its frames at the root; a recording has one folder per view.
        let sequence = is_there(&path.join(DEPTH_LIST))?;
        let described = is_there(&path.join(DESCRIPTION))? && !sequence;
        Ok(if described && !folder::is_plain(path)? {
            Layout::Recording
        } else if is_there(&path.join(INDEX))? {
            Layout::Dump
        } else if sequence {
            Layout::Sequence
        } else {
            Layout::Images
        })
    }
}

/// Opens `path`: a recording, a TUM folder, a fakenect dump, a plain folder of 16-bit PNGs, a ROS bag or a
/// NumPy stack. Frames are not read, except to find still stretches in a film.
/// Fails if the folder is none of these, is empty or describes itself wrongly, or if something is assumed of
/// a recording that describes itself.
pub fn open(path: &Path, assumed: &Assumed) -> Result<Recording> {
    open_and_cut(path, assumed, true)
}

/// As [`open`], but keeps a film whole: one view with all its frames, including those in motion.
pub fn open_uncut(path: &Path, assumed: &Assumed) -> Result<Recording> {
    open_and_cut(path, assumed, false)
}

fn open_and_cut(path: &Path, assumed: &Assumed, cut: bool) -> Result<Recording> {
    let film = |(footage, sensor): (Footage, Sensor)| footage.recording(path, sensor, cut);
    let layout = Layout::of(path)?;
    if layout != Layout::Container {
        assumed.refuse_topic(path)?;
    }
    let mut recording = match layout {
        Layout::Recording => {
            assumed.refuse_beside(&path.join(DESCRIPTION))?;
            layout::open(path)?
        }
        Layout::Dump => film(folder::dump(path, assumed)?),
        Layout::Sequence => film(folder::sequence(path, assumed)?),
        Layout::Images => film(folder::images(path, assumed)?),
        Layout::Container => film(container::open(path, assumed)?),
    };
    if recording.views.is_empty() {
        let excluded = recording.excluded.first().map(ToString::to_string);
        let reason = excluded.or_else(|| recording.remarks.first().cloned());
        return Err(Error::recording(
            path,
            reason.unwrap_or_else(|| "no view in it".into()),
            match layout {
                Layout::Recording => {
                    "a view is a folder with depth.txt and depth/*.png beside recording.json"
                }
                _ => "give depth images that can be read and hold depths",
            },
        ));
    }
    let frames: Vec<&FrameRef> = recording.views.iter().flat_map(|v| &v.depth).collect();
    let doubt = refuse_impossible(path, &recording.sensor, &frames)?;
    recording.remarks.extend(doubt);
    Ok(recording)
}

/// Checks that the raw values in some of these frames can be what the sensor's code says.
/// Fails if they cannot; returns a remark if it is doubtful.
pub(crate) fn refuse_impossible(
    root: &Path,
    sensor: &Sensor,
    frames: &[&FrameRef],
) -> Result<Option<String>> {
    let values = RawValues::of(frames.iter().copied());
    match values.contradiction(sensor.code) {
        Some((what, remedy)) => Err(Error::recording(root, what, remedy)),
        None => Ok(values.doubt(sensor.code, sensor.may_be_kinect())),
    }
}

/// Sensor of a folder with these images, and remarks on what was assumed: from its recording.json, from the
/// defaults for a dump, or from `assumed`.
pub(crate) fn describe_folder(
    root: &Path,
    images: &[FrameRef],
    assumed: &Assumed,
) -> Result<(Sensor, Vec<String>)> {
    let description = root.join(DESCRIPTION);
    if is_there(&description)? {
        assumed.refuse_beside(&description)?;
        return Ok((read_description(&description)?, Vec::new()));
    }
    let (sensor, remark) = match images.first() {
        Some(first) if root.join(INDEX).is_file() => assumed.dump_sensor(size_of(first)?)?,
        _ => assumed.images_sensor(root, images)?,
    };
    let frames: Vec<&FrameRef> = images.iter().collect();
    let doubt = refuse_impossible(root, &sensor, &frames)?;
    Ok((sensor, remark.into_iter().chain(doubt).collect()))
}
