//! The files of a recording other than its depth images.

use std::collections::HashSet;
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};

use crate::error::{Error, Result};
use crate::io::{DESCRIPTIONS, write_atomic_with};
use crate::read::{MAX_IMAGE, MAX_TEXT, open};

/// Deepest nesting of folders; deeper nesting means a link that leads back into the recording.
const MAX_DEPTH: usize = 12;

/// Largest file copied that no command reads, bytes: ten minutes of compressed video of the session. Without
/// a limit, a sparse file of a terabyte would fill the disk.
const MAX_OTHER: u64 = 1 << 30;

/// Largest file of its kind that is copied. A file that would be refused as an input is no part of the
/// recording.
fn max_bytes(file: &Path) -> u64 {
    let kind = file.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    match &*kind {
        "png" | "jpg" | "jpeg" | "pgm" | "ppm" => MAX_IMAGE,
        "txt" | "csv" | "json" | "yaml" | "yml" | "md" => MAX_TEXT,
        _ => MAX_OTHER,
    }
}

/// Every file below `root`, as relative paths in name order. A link may lead out of `root` only to files that
/// are `read` as part of the recording, so that a folder of links to some of its views works.
/// Fails at an entry that is no regular file, or that lies outside and is not `read`: it may be private.
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

/// Fails if a link leads out of `root`, which must be canonical.
fn refuse_outside(file: &Path, root: &Path) -> Result<()> {
    let target = file.canonicalize().map_err(|e| Error::read(file, e))?;
    if target.starts_with(root) {
        return Ok(());
    }
    let what = "a link that leads out of the recording";
    Err(Error::recording(file, what, "copy into the recording what it names, or take it out"))
}

/// Whether a folder is no recording without this file, which is therefore written last.
pub(super) fn makes_a_recording(file: &Path) -> bool {
    file.file_name().and_then(|n| n.to_str()).is_some_and(|name| DESCRIPTIONS.contains(&name))
}

/// Copies files in the given order.
pub(super) fn copy(from: &Path, to: &Path, files: &[&PathBuf]) -> Result<()> {
    for file in files {
        let (source, target) = (from.join(file), to.join(file));
        make_folder_of(&target)?;
        let mut reader = open(&source)?;
        let length = reader.metadata().map_err(|e| Error::read(&source, e))?.len();
        let max = max_bytes(file);
        // Streamed, because the file may be larger than memory. It may also grow meanwhile.
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

/// Path of a listed image relative to `root`.
/// Fails if the image lies outside, because the copied list would no longer find it.
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
