//! Reads input files, only regular ones of a size that fits in memory. A pipe would block for ever, a
//! device never ends, and a sparse file of a terabyte is made in a second.

use std::fs::{File, Metadata};
use std::io::Read;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::error::{Error, Result};
use crate::units::shortest;

/// Size limit of lists, tables and trajectories, bytes: an hour of poses at 500 Hz.
pub(crate) const MAX_TEXT: u64 = 1 << 28;
/// Size limit of JSON, bytes, which takes sixteen times its length in memory; a model with the
/// covariance of every shape has 8 MB.
const MAX_JSON: u64 = 1 << 25;
/// Length limit of a JSON string, bytes: notes of some pages. Strings that are kept go into every result.
const MAX_WORDS: usize = 1 << 14;
/// Limit of numbers: variances of barely known parameters are less, and squares of much more overflow.
pub(crate) const MAX_NUMBER: f64 = 1e30;
/// Size limit of an image file, bytes: 16 megapixels in colour, uncompressed, with metadata.
pub(crate) const MAX_IMAGE: u64 = 1 << 26;
/// Allowance for an image's metadata (profiles, comments), bytes.
const AROUND_IMAGE: u64 = 1 << 20;

/// Opens a file for reading.
/// Fails when it cannot be opened, or is a folder, a pipe, a device or a socket.
pub(crate) fn open(path: &Path) -> Result<File> {
    let failed = |e| Error::read(path, e);
    match odd(&std::fs::metadata(path).map_err(failed)?) {
        Some((what, remedy)) => Err(Error::recording(path, what, remedy)),
        None => File::open(path).map_err(failed),
    }
}

/// What the path is instead of a regular file, and what to do.
fn odd(kind: &Metadata) -> Option<(&'static str, &'static str)> {
    if kind.is_file() {
        None
    } else if kind.is_dir() {
        Some(("this is not a regular file, but a folder", "give the file, or take the folder out"))
    } else {
        let what = "this is not a regular file, but a pipe or a device";
        Some((what, "save what it gives to a file, and give that"))
    }
}

/// Whether a file of this name exists.
/// Fails when something else does, which would otherwise be ignored silently.
pub(crate) fn is_there(path: &Path) -> Result<bool> {
    let Ok(kind) = std::fs::metadata(path) else { return Ok(false) };
    match odd(&kind) {
        Some((what, remedy)) => Err(Error::recording(path, what, remedy)),
        None => Ok(true),
    }
}

/// The first of these files that exists. Fails as [`is_there`] does.
pub(crate) fn first_there(paths: impl IntoIterator<Item = PathBuf>) -> Result<Option<PathBuf>> {
    for path in paths {
        if is_there(&path)? {
            return Ok(Some(path));
        }
    }
    Ok(None)
}

/// Reads a file of at most `max` bytes.
fn bytes(path: &Path, max: u64) -> Result<Vec<u8>> {
    let failed = |e| Error::read(path, e);
    let file = open(path)?;
    let length = file.metadata().map_err(failed)?.len();
    // The file may grow while it is read.
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

/// Reads a list, a table or a trajectory.
pub(crate) fn read_text(path: &Path) -> Result<String> {
    text(path, MAX_TEXT)
}

pub(crate) fn read_json(path: &Path) -> Result<String> {
    text(path, MAX_JSON)
}

/// The first absurdly long string or absurdly large number of a JSON document, with its key.
pub(crate) fn absurd(value: &Value) -> Option<String> {
    let off = |value: &Value| match value {
        Value::String(text) if text.len() > MAX_WORDS => {
            Some(format!("a text of {} bytes, more than the {MAX_WORDS} of any", text.len()))
        }
        Value::Number(number) => {
            let number = number.as_f64().filter(|v| v.abs() > MAX_NUMBER)?;
            Some(format!("{}, beyond any number that is measured", shortest(number)))
        }
        _ => None,
    };
    let below = |key: String, value: &Value| {
        let found = off(value).map(|what| format!(" = {what}")).or_else(|| absurd(value))?;
        let dot = if found.starts_with([' ', '[']) { "" } else { "." };
        Some(format!("{key}{dot}{found}"))
    };
    match value {
        Value::Object(entries) => {
            entries.iter().find_map(|(key, value)| below(key.chars().take(40).collect(), value))
        }
        Value::Array(all) => {
            all.iter().enumerate().find_map(|(i, value)| below(format!("[{i}]"), value))
        }
        _ => None,
    }
}

/// Serde's message on a JSON document, without Rust type names and without the line, which messages add
/// themselves.
pub(crate) fn plainly(error: &serde_json::Error) -> String {
    let full = error.to_string();
    let what = full.rsplit_once(" at line ").map_or(&*full, |(before, _)| before);
    let Some((before, expected)) = what.split_once(", expected ") else { return what.into() };
    let plain = match expected {
        "f64" => "a number",
        "u8" | "u16" | "u32" | "u64" | "usize" => "a whole number, 0 or above",
        "a sequence" => "a list, in [ ]",
        "a map" => "an object, in { }",
        "a string" => "a text",
        "a boolean" => "true or false",
        other if other.starts_with("struct ") || other.starts_with("internally tagged enum ") => {
            "an object, in { }"
        }
        other => other,
    };
    format!("{before}, expected {plain}")
}

/// Reads the bytes of a list, a table or a trajectory.
pub(crate) fn read_bytes(path: &Path) -> Result<Vec<u8>> {
    bytes(path, MAX_TEXT)
}

pub(crate) fn read_image(path: &Path) -> Result<Vec<u8>> {
    bytes(path, MAX_IMAGE)
}

/// Reads a depth image of this width and height, px. Incompressible data is stored as it is, with one more
/// byte per row and five per block of 64 kB.
pub(crate) fn read_depth_image(path: &Path, [width, height]: [usize; 2]) -> Result<Vec<u8>> {
    // The size comes from the input and may be anything.
    let raw = (width as u64).saturating_mul(height as u64).min(MAX_IMAGE) * 2;
    bytes(path, (raw + raw / 8 + AROUND_IMAGE).min(MAX_IMAGE))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn texts_and_numbers_that_nobody_means_are_named_by_their_key() {
        let long = "x".repeat(MAX_WORDS + 1);
        for (document, says) in [
            (json!({"mode": long}), Some("mode = a text of 16385 bytes")),
            (json!({"a": [{"b": 1}, {"c": [0, -1e300]}]}), Some("a[1].c[1] = -1e300, beyond")),
            (json!({"a": {"b": u64::MAX, "c": "words", "d": null}}), None),
        ] {
            let said = absurd(&document);
            assert_eq!(said.is_some(), says.is_some(), "{said:?}");
            assert!(said.unwrap_or_default().starts_with(says.unwrap_or_default()));
        }
    }
}
