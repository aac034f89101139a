//! Describes the raw values of a folder that were written in another code.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::error::{Error, Result};
use crate::frame::DepthCode;
use crate::io::{DESCRIPTION, Layout, pretty_json, write_atomic, write_recording_file};
use crate::read::read_json;
use crate::view::Sensor;

/// Writes the new code into recording.json of `folder` and keeps its other entries. `images` are the stamps
/// and names that a dump's index or a container listed.
pub(super) fn describe(
    folder: &Path,
    layout: Layout,
    sensor: &Sensor,
    images: impl Iterator<Item = (f64, PathBuf)>,
) -> Result<()> {
    match layout {
        Layout::Dump | Layout::Container => {
            let mut list = String::from("# timestamp path\n");
            for (stamp, file) in images {
                // Stamps in a dump's file names have six decimals; a container's are kept as they are.
                // Writing to a String does not fail.
                let _ = match layout {
                    Layout::Dump => writeln!(list, "{stamp:.6} {}", file.display()),
                    _ => writeln!(list, "{stamp} {}", file.display()),
                };
            }
            write_atomic(&folder.join("depth.txt"), list.as_bytes())?;
            write_recording_file(folder, sensor)
        }
        Layout::Recording | Layout::Sequence | Layout::Images => {
            let path = folder.join(DESCRIPTION);
            match read_json(&path) {
                Ok(text) => write_atomic(&path, with_code(&text, &sensor.code)?.as_bytes()),
                Err(_) => write_recording_file(folder, sensor),
            }
        }
    }
}

/// The text of recording.json with the code replaced.
fn with_code(text: &str, code: &DepthCode) -> Result<String> {
    let failed = |e: serde_json::Error| Error::Argument {
        what: format!("{DESCRIPTION}: {e}"),
        remedy: "compare it with the recording layout in the README",
    };
    let mut value: Value = serde_json::from_str(text).map_err(failed)?;
    if let (Some(map), DepthCode::Metric { units_per_metre, invalid }) =
        (value.as_object_mut(), code)
    {
        map.shift_remove("raw_disparity");
        map.insert("units_per_metre".into(), json!(units_per_metre));
        map.insert("invalid".into(), json!(invalid));
    }
    pretty_json(&value).map_err(failed)
}
