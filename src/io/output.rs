//! Files and folders. Outputs appear whole or not at all: written beside their place, then renamed
//! into it.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::Serialize;
use sha2::{Digest, Sha256};

use crate::error::{Error, Result};

/// Never mix a new recording into somebody's folder.
/// An error when the folder has something in it.
pub fn refuse_full(root: &Path) -> Result<()> {
    let full = fs::read_dir(root).is_ok_and(|mut entries| entries.next().is_some());
    if full {
        return Err(Error::recording(
            root,
            "the folder is not empty",
            "choose a new folder for the recording",
        ));
    }
    Ok(())
}

/// Write beside `path`, then rename: a kill or a full disk leaves the old file, or none.
/// An error when the folder cannot be written; the temporary file is then removed.
pub fn write_atomic(path: &Path, bytes: &[u8]) -> Result<()> {
    write_atomic_with(path, |file| file.write_all(bytes))
}

/// As [`write_atomic`], piece by piece.
pub(crate) fn write_atomic_with(
    path: &Path,
    write: impl FnOnce(&mut fs::File) -> std::io::Result<()>,
) -> Result<()> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let temporary = path.with_file_name(format!(".{name}.{}.tmp", std::process::id()));
    let written = fs::File::create(&temporary)
        .and_then(|mut file| write(&mut file).and_then(|()| file.sync_data()))
        .and_then(|()| fs::rename(&temporary, path));
    written.map_err(|e| {
        let _ = fs::remove_file(&temporary);
        Error::write(path, e)
    })
}

/// JSON for people to read, with a line's end at its end.
/// An error when the value has no form in JSON.
pub fn pretty_json(value: &impl Serialize) -> serde_json::Result<String> {
    let mut text = serde_json::to_string_pretty(value)?;
    text.push('\n');
    Ok(text)
}

/// Write [`pretty_json`] whole or not at all; the text. `remedy` is for what has no form in JSON.
pub fn write_json(path: &Path, value: &impl Serialize, remedy: &'static str) -> Result<String> {
    let text = pretty_json(value).map_err(|e| Error::text(path, 0, e.to_string(), remedy))?;
    write_atomic(path, text.as_bytes())?;
    Ok(text)
}

/// What stands in a folder, in name order.
pub(crate) fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    let failed = |e| Error::read(folder, e);
    let mut paths = fs::read_dir(folder)
        .map_err(failed)?
        .map(|entry| entry.map(|e| e.path()))
        .collect::<std::io::Result<Vec<PathBuf>>>()
        .map_err(failed)?;
    paths.sort();
    Ok(paths)
}

/// A few of the names.
pub(crate) fn listed(names: &[String]) -> String {
    const SHOWN: usize = 3;
    let shown = names.iter().take(SHOWN).map(String::as_str).collect::<Vec<_>>().join(", ");
    match names.len().saturating_sub(SHOWN) {
        0 => shown,
        more => format!("{shown} and {more} more"),
    }
}

/// SHA-256 as lower-case hexadecimal.
pub fn sha256_hex(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}

pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_no_temporary_file() {
        let dir = tempfile::tempdir().unwrap();
        let blocked = dir.path().join("taken");
        fs::create_dir(&blocked).unwrap();
        fs::write(blocked.join("x"), b"").unwrap();
        assert!(write_atomic(&blocked, b"1").is_err(), "a folder stands there");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[test]
    fn json_ends_with_a_line_and_reads_back() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.json");
        let text = write_json(&path, &[1.5, 2.0], "").unwrap();
        assert_eq!(text, "[\n  1.5,\n  2.0\n]\n");
        assert_eq!(fs::read_to_string(&path).unwrap(), text);
        let not_a_key = std::collections::BTreeMap::from([([1, 2], 3)]);
        assert!(write_json(&path, &not_a_key, "name it").is_err());
        assert_eq!(fs::read_to_string(&path).unwrap(), text, "the old file stands");
    }

    #[test]
    fn the_hash_is_the_standard_one() {
        assert_eq!(
            sha256_hex(b"abc"),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
        );
    }
}
