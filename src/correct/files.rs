//! The files of a recording beside its depth images.

use std::collections::HashSet;
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};

use crate::error::{Error, Result};
use crate::io::{is_description, write_atomic_with};
use crate::read::{MAX_IMAGE, MAX_TEXT, open};

/// Folders in folders: more is a link that leads back to where it stands.
const MAX_DEPTH: usize = 12;

/// The longest file that is copied of what no command reads, bytes: ten minutes of a compressed video of
/// the session. A sparse file of a terabyte would fill the disk.
const MAX_OTHER: u64 = 1 << 30;

/// The longest file of its kind that is copied: what would be refused as an input is no part of the
/// recording.
fn max_bytes(file: &Path) -> u64 {
    let kind = file.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    match &*kind {
        "png" | "jpg" | "jpeg" | "pgm" | "ppm" => MAX_IMAGE,
        "txt" | "csv" | "json" | "yaml" | "yml" | "md" => MAX_TEXT,
        _ => MAX_OTHER,
    }
}

/// Every file below `root`, as paths relative to it, in name order. A link may lead out of `root` to
/// what is `read` as part of the recording, so that folders of links to some of its views will do.
/// An error when one is no regular file, or stands outside and is not `read`: it may be private.
pub(super) fn files_below(root: &Path, read: &HashSet<&Path>) -> Result<Vec<PathBuf>> {
    let real_root = root.canonicalize().map_err(|e| Error::read(root, e))?;
    let mut files = Vec::new();
    let mut folders = vec![(PathBuf::new(), 0)];
    while let Some((folder, depth)) = folders.pop() {
        let here = root.join(&folder);
        for entry in std::fs::read_dir(&here).map_err(|e| Error::read(&here, e))? {
            let name = entry.map_err(|e| Error::read(&here, e))?.file_name();
            let path = folder.join(name);
            let full = root.join(&path);
            if full.is_file() {
                if !read.contains(path.as_path()) {
                    refuse_outside(&full, &real_root)?;
                }
                files.push(path);
            } else if !full.is_dir() {
                let what = "neither a file nor a folder";
                return Err(Error::recording(&full, what, "take it out of the recording"));
            } else if depth < MAX_DEPTH {
                folders.push((path, depth + 1));
            } else {
                return Err(Error::recording(
                    &root.join(&path),
                    format!("more than {MAX_DEPTH} folders deep"),
                    "take out the link that leads back into the recording",
                ));
            }
        }
    }
    files.sort();
    Ok(files)
}

/// An error of a file that a link names outside of `root`, which has no links in it.
fn refuse_outside(file: &Path, root: &Path) -> Result<()> {
    let target = file.canonicalize().map_err(|e| Error::read(file, e))?;
    if target.starts_with(root) {
        return Ok(());
    }
    let what = "a link that leads out of the recording";
    Err(Error::recording(file, what, "copy into the recording what it names, or take it out"))
}

/// Is it a file without which a folder is no recording, and which therefore comes last?
pub(super) fn makes_a_recording(file: &Path) -> bool {
    is_description(file.file_name().and_then(|n| n.to_str()).unwrap_or_default())
}

/// Copy files, those that make a recording of the folder after all others.
pub(super) fn copy(from: &Path, to: &Path, files: &[&PathBuf]) -> Result<()> {
    for file in files {
        let (source, target) = (from.join(file), to.join(file));
        make_folder_of(&target)?;
        let mut reader = open(&source)?;
        let length = reader.metadata().map_err(|e| Error::read(&source, e))?.len();
        let max = max_bytes(file);
        // Piece by piece: it may be longer than memory. It may grow meanwhile.
        let mut within = reader.by_ref().take(max + 1);
        let copied = if length > max {
            length
        } else {
            let mut copied = 0;
            write_atomic_with(&target, |file| {
                copied = io::copy(&mut within, file)?;
                Ok(())
            })?;
            copied
        };
        if copied > max {
            let what = format!(
                "{} MB, more than is copied of such a file ({} MB)",
                copied >> 20,
                max >> 20
            );
            return Err(Error::recording(&source, what, "take it out of the recording"));
        }
    }
    Ok(())
}

pub(super) fn make_folder_of(file: &Path) -> Result<()> {
    let folder = file.parent().unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder).map_err(|e| Error::write(folder, e))
}

/// Where a listed image stands, relative to `root`.
/// An error when it stands outside: written again it would be lost.
pub(super) fn inside(root: &Path, file: &Path) -> Result<PathBuf> {
    let mut parts: Vec<Component<'_>> = Vec::new();
    let relative = file.strip_prefix(root).ok();
    let mut outside = relative.is_none();
    for part in relative.into_iter().flat_map(Path::components) {
        match part {
            Component::CurDir => {}
            Component::ParentDir => outside |= parts.pop().is_none(),
            part => parts.push(part),
        }
    }
    if outside {
        return Err(Error::recording(
            file,
            "a list names this image, which stands outside the recording",
            "copy it into the recording",
        ));
    }
    Ok(parts.iter().collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_outside_are_refused_however_they_are_named() {
        let root = Path::new("/rec");
        let of = |file: &str| inside(root, Path::new(file)).ok();
        assert_eq!(of("/rec/a/./b/../c.png"), Some("a/c.png".into()));
        assert_eq!(of("/rec/a/../../x.png"), None);
        assert_eq!(of("/elsewhere/x.png"), None);
    }
}
