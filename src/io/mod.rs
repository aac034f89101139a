//! Files in, files out. One reader a file; every layout ends as the same [`Recording`].

mod dump;
mod folder;
mod images;
mod layout;
mod list;
mod output;
mod quick;
mod stills;
mod tum;
mod unknown;

pub(crate) use dump::INDEX;
pub use dump::write_dump;
pub use images::{ColourImage, FrameSource, InfraredImage, encode_pgm16, encode_png16};
pub(crate) use images::{read_depth, size_of};
pub use layout::DESCRIPTION;
pub(crate) use layout::{DEPTH_LIST, read_description};
pub use layout::{ViewFile, write_recording_file, write_view_notes};
pub use list::{FrameList, read_list};
pub use output::hex;
pub use output::{OutputDir, pretty_json, refuse_full, sha256_hex, write_atomic, write_json};
pub use quick::{encode_png16_quickly, encode_rgb};

use std::path::{Path, PathBuf};

use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::frame::DepthCode;
use crate::units::shortest;
use crate::view::{Recording, Sensor};
use stills::Footage;

/// What the user knows about a folder that does not describe itself.
#[derive(Debug, Clone, Default)]
pub struct Assumed {
    /// fx, fy, cx, cy in px.
    pub intrinsics: Option<[f64; 4]>,
    /// How words become metres.
    pub code: Option<DepthCode>,
    /// Distance between projector and camera, m.
    pub baseline_m: Option<f64>,
}

impl Assumed {
    /// What was given, under the names of the options.
    fn given(&self) -> Vec<&'static str> {
        let code = self.code.map(|code| match code {
            DepthCode::Metric { .. } => "--units-per-metre",
            DepthCode::Disparity { .. } => "--raw-disparity",
        });
        let intrinsics = self.intrinsics.map(|_| "--intrinsics");
        let baseline = self.baseline_m.map(|_| "--baseline");
        [intrinsics, code, baseline].into_iter().flatten().collect()
    }
}

/// How the files of a recording lie in its folder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// recording.json, and a folder a view.
    Recording,
    /// depth.txt, as in the TUM benchmark; recording.json beside it is read too.
    Sequence,
    /// What fakenect-record writes.
    Dump,
    /// PNGs and nothing else.
    Images,
}

impl Layout {
    /// Of a folder.
    ///
    /// # Errors
    /// When there is no such folder.
    pub fn of(path: &Path) -> Result<Self> {
        if !path.is_dir() {
            return Err(Error::recording(
                path,
                if path.exists() { "this is not a folder" } else { "there is no such folder" },
                "give the folder of a recording, a TUM sequence, a fakenect dump or 16-bit PNGs",
            ));
        }
        // A described TUM sequence has its frames at the root, a recording in one folder a view.
        let sequence = path.join(tum::DEPTH_LIST).is_file();
        Ok(if path.join(layout::DESCRIPTION).is_file() && !sequence {
            Layout::Recording
        } else if path.join(dump::INDEX).is_file() {
            Layout::Dump
        } else if sequence {
            Layout::Sequence
        } else {
            Layout::Images
        })
    }
}

/// Open whatever stands at `path`: a recording, a TUM folder, a fakenect dump or a plain folder
/// of 16-bit PNGs. Frames are not read, except to find still stretches in a film.
///
/// # Errors
/// When the folder is none of these, is empty, or describes itself wrongly; or when something is
/// assumed of a recording that describes itself.
pub fn open(path: &Path, assumed: &Assumed) -> Result<Recording> {
    open_and(path, assumed, Footage::recording)
}

/// As [`open`], but a film stays whole: one view with all its frames, also those in motion.
///
/// # Errors
/// As [`open`].
pub fn open_uncut(path: &Path, assumed: &Assumed) -> Result<Recording> {
    open_and(path, assumed, Footage::uncut)
}

fn open_and(
    path: &Path,
    assumed: &Assumed,
    cut: impl Fn(Footage, &Path, Sensor) -> Recording,
) -> Result<Recording> {
    let footage = match Layout::of(path)? {
        Layout::Recording => {
            refuse(assumed, path)?;
            None
        }
        Layout::Dump => Some(dump::footage(path, assumed)?),
        Layout::Sequence => Some(tum::footage(path, assumed)?),
        Layout::Images => Some(folder::footage(path, assumed)?),
    };
    let recording = match footage {
        None => layout::open(path)?,
        Some((footage, sensor)) => cut(footage, path, sensor),
    };
    if recording.views.is_empty() {
        let reason = recording
            .excluded
            .first()
            .map(ToString::to_string)
            .or_else(|| recording.remarks.first().cloned());
        return Err(Error::recording(
            path,
            reason.unwrap_or_else(|| "no view in it".into()),
            "a view is a folder with depth.txt and depth/*.png beside recording.json",
        ));
    }
    Ok(recording)
}

/// An option that would have no effect must not look as if it had one.
fn refuse(assumed: &Assumed, path: &Path) -> Result<()> {
    let given = assumed.given();
    if given.is_empty() {
        return Ok(());
    }
    Err(Error::Argument {
        what: format!(
            "{}: {} describes its sensor itself",
            given.join(" and "),
            path.join(layout::DESCRIPTION).display()
        ),
        remedy: "leave the option out, or correct that file",
    })
}

/// The sensor of a folder whose images are `size` px, and what had to be assumed: told by its
/// recording.json, by what is known of a dump, or by `assumed`.
pub(crate) fn describe_folder(
    root: &Path,
    size: (usize, usize),
    assumed: &Assumed,
) -> Result<(Sensor, Vec<String>)> {
    let description = root.join(DESCRIPTION);
    if description.is_file() {
        refuse(assumed, root)?;
        return Ok((read_description(&description)?, Vec::new()));
    }
    if root.join(INDEX).is_file() {
        return dump::sensor(size, assumed);
    }
    folder::sensor(root, size, assumed)
}

/// What stands in a folder, in name order.
pub(crate) fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    let failed = |e| Error::read(folder, e);
    let mut paths = std::fs::read_dir(folder)
        .map_err(failed)?
        .map(|entry| entry.map(|e| e.path()))
        .collect::<std::io::Result<Vec<PathBuf>>>()
        .map_err(failed)?;
    paths.sort();
    Ok(paths)
}

/// A sensor for folders that carry no description of their own.
pub(crate) fn assumed_sensor(
    name: &str,
    size: (usize, usize),
    intrinsics: [f64; 4],
    code: DepthCode,
    assumed: &Assumed,
) -> Result<Sensor> {
    let [fx, fy, cx, cy] = intrinsics;
    let sensor = Sensor {
        name: name.into(),
        serial: None,
        mode: None,
        camera: Camera { width: size.0, height: size.1, fx, fy, cx, cy, distortion: None },
        baseline_m: assumed.baseline_m,
        code,
    };
    match sensor.fault() {
        Some(what) => Err(Error::Argument {
            what: format!("--intrinsics {}: {what}", intrinsics.map(shortest).join(",")),
            remedy: "give fx,fy,cx,cy in pixels",
        }),
        None => Ok(sensor),
    }
}
