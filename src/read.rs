//! Input files: regular ones, of a size that memory holds. A pipe would wait for ever, a device never
//! ends, and a sparse file of a terabyte is made in a second.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::error::{Error, Result};

/// Of lists, tables and trajectories, bytes: an hour of poses at 500 Hz.
const MAX_TEXT: u64 = 1 << 28;
/// Of JSON, bytes, which takes sixteen times its length in memory; a model with the covariance of
/// every shape has 8 MB.
const MAX_JSON: u64 = 1 << 25;
/// Of an image, bytes: 16 megapixels in colour, not compressed, and what is written around them.
const MAX_IMAGE: u64 = 1 << 26;

/// Open a file to read.
/// An error when it cannot be, or is a pipe, a device or a socket.
pub(crate) fn open(path: &Path) -> Result<File> {
    let failed = |e| Error::read(path, e);
    let kind = std::fs::metadata(path).map_err(failed)?;
    // What a folder is read as is the system's to refuse, in its own words.
    if !kind.is_file() && !kind.is_dir() {
        let what = "this is a pipe or a device, no file";
        return Err(Error::recording(path, what, "save what it gives to a file, and give that"));
    }
    File::open(path).map_err(failed)
}

/// All of a file that has `max` bytes or less.
fn bytes(path: &Path, max: u64) -> Result<Vec<u8>> {
    let failed = |e| Error::read(path, e);
    let file = open(path)?;
    let length = file.metadata().map_err(failed)?.len();
    // It may grow while it is read.
    let mut bytes = Vec::new();
    if length <= max {
        file.take(max + 1).read_to_end(&mut bytes).map_err(failed)?;
    }
    if length > max || bytes.len() as u64 > max {
        let what = format!("{} MB, more than the {} MB of any such file", length >> 20, max >> 20);
        return Err(Error::recording(path, what, "check that this is the file that is meant"));
    }
    Ok(bytes)
}

fn text(path: &Path, max: u64) -> Result<String> {
    String::from_utf8(bytes(path, max)?).map_err(|_| {
        let cause = std::io::Error::new(
            std::io::ErrorKind::InvalidData,
            "stream did not contain valid UTF-8",
        );
        Error::read(path, cause)
    })
}

/// A list, a table or a trajectory.
pub(crate) fn read_text(path: &Path) -> Result<String> {
    text(path, MAX_TEXT)
}

pub(crate) fn read_json(path: &Path) -> Result<String> {
    text(path, MAX_JSON)
}

/// The bytes of a list, a table or a trajectory.
pub(crate) fn read_bytes(path: &Path) -> Result<Vec<u8>> {
    bytes(path, MAX_TEXT)
}

pub(crate) fn read_image(path: &Path) -> Result<Vec<u8>> {
    bytes(path, MAX_IMAGE)
}
