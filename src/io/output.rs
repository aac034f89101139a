//! Writing files and folders. Outputs appear whole or not at all: written beside
//! their final path, then renamed.

use std::fs;
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;
use sha2::{Digest, Sha256};
use tempfile::NamedTempFile;

use super::unfinished::{is_being_filled, unfinished};
use crate::error::{Error, Result};

/// Keeps a new recording out of an existing folder.
/// Fails if the folder is not empty.
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

/// Writes beside `path`, then renames: a kill, a full disk or a power cut leaves the old file, or none.
/// Fails if the folder cannot be written; the temporary file is then removed.
pub fn write_atomic(path: &Path, bytes: &[u8]) -> Result<()> {
    write_atomic_with(path, |file| file.write_all(bytes))
}

/// As [`write_atomic`], writing in pieces.
pub(crate) fn write_atomic_with(
    path: &Path,
    write: impl FnOnce(&mut fs::File) -> io::Result<()>,
) -> Result<()> {
    // Renaming would replace a device of that name.
    if fs::metadata(path).is_ok_and(|standing| !standing.is_file() && !standing.is_dir()) {
        let what = "a pipe or a device stands there, no file";
        return Err(Error::recording(path, what, "choose another name"));
    }
    let folder = path.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let written = beside(folder).and_then(|mut file| {
        write(file.as_file_mut())?;
        file.as_file().sync_all()?;
        file.persist(path)?;
        // A folder being filled is synced once, when it is complete.
        if is_being_filled(folder) { Ok(()) } else { sync_folder(folder) }
    });
    written.map_err(|e| Error::write(path, e))
}

/// Locked temporary file with the permissions of any new file; what a killed run left is not locked.
fn beside(folder: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    let name = unfinished();
    builder.prefix(&name);
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666)); // less the umask
    let file = builder.tempfile_in(folder)?;
    // Without file locks, only its age tells it from a stale file.
    let _ = file.as_file().try_lock();
    Ok(file)
}

/// Flushes a folder's entries to disk. Some systems cannot open folders, and some disks cannot sync them.
pub(crate) fn sync_folder(folder: &Path) -> io::Result<()> {
    let Ok(file) = fs::File::open(folder) else { return Ok(()) };
    match file.sync_all() {
        Err(e) if ![ErrorKind::InvalidInput, ErrorKind::Unsupported].contains(&e.kind()) => Err(e),
        _ => Ok(()),
    }
}

/// Pretty-printed JSON with a trailing newline.
/// Fails if the value cannot be represented in JSON.
pub fn pretty_json(value: &impl Serialize) -> serde_json::Result<String> {
    let mut text = serde_json::to_string_pretty(value)?;
    text.push('\n');
    Ok(text)
}

/// Writes [`pretty_json`] atomically and returns the text. `remedy` is for values that JSON cannot represent.
pub fn write_json(path: &Path, value: &impl Serialize, remedy: &'static str) -> Result<String> {
    let text = pretty_json(value).map_err(|e| Error::text(path, 0, e.to_string(), remedy))?;
    write_atomic(path, text.as_bytes())?;
    Ok(text)
}

/// Entries of a folder, sorted by name.
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

/// Key that sorts names with their numbers by value: 2.png before 10.png, and 1.15.png before 1.2.png, as the
/// seconds that they mostly are.
pub(crate) fn by_number(path: &Path) -> String {
    const DIGITS: usize = 20;
    let (mut key, mut digits) = (String::new(), String::new());
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    for c in name.chars().map(Some).chain([None]) {
        if let Some(digit) = c.filter(char::is_ascii_digit) {
            digits.push(digit);
            continue;
        }
        if !digits.is_empty() {
            let is_decimal =
                key.ends_with('.') && key[..key.len() - 1].ends_with(|c: char| c.is_ascii_digit());
            key += &if is_decimal { digits.clone() } else { format!("{digits:0>DIGITS$}") };
            digits.clear();
        }
        key.extend(c);
    }
    key
}

/// The first few names, and how many more there are.
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
    fn numbers_sort_by_value() {
        let sorted = [
            "1.png",
            "2.png",
            "10.png",
            "0010b.png",
            "13.175.png",
            "13.2.png",
            "a9b20.png",
            "a10b1.png",
        ];
        let mut names = sorted;
        names.reverse();
        names.sort_by_key(|name| by_number(Path::new(name)));
        assert_eq!(names, sorted);
    }

    #[test]
    fn a_failed_write_leaves_no_temporary_file() {
        let dir = tempfile::tempdir().unwrap();
        let blocked = dir.path().join("taken");
        fs::create_dir(&blocked).unwrap();
        fs::write(blocked.join("x"), b"").unwrap();
        assert!(write_atomic(&blocked, b"1").is_err(), "a folder stands there");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    /// Others must be able to read results; temporary files are private to their owner by default.
    #[cfg(unix)]
    #[test]
    fn a_file_has_the_permissions_of_any_new_file() {
        use std::os::unix::fs::PermissionsExt;
        let dir = tempfile::tempdir().unwrap();
        let [plain, atomic] = ["plain", "atomic"].map(|name| dir.path().join(name));
        fs::write(&plain, b"1").unwrap();
        write_atomic(&atomic, b"1").unwrap();
        let mode = |path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&atomic), mode(&plain));
    }

    #[test]
    fn what_json_cannot_hold_leaves_the_old_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.json");
        let text = write_json(&path, &[1.5, 2.0], "").unwrap();
        let not_a_key = std::collections::BTreeMap::from([([1, 2], 3)]);
        assert!(write_json(&path, &not_a_key, "name it").is_err());
        assert_eq!(fs::read_to_string(&path).unwrap(), text);
    }
}
