//! The dump that the stand-in plays, looked at beforehand.
//!
//! fakenect ends the whole process when FAKENECT_PATH is not set or a file is missing, and reads
//! beyond the end of a file that is cut short. So it is only ever asked for lines that are good.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use super::ffi::DEPTH_BYTES;
use crate::error::{Error, Result};
use crate::io::INDEX;

/// Lines of a dump that can be played.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Dump {
    pub root: PathBuf,
    /// How many lines, from the first, are good.
    pub good: usize,
    /// What is wrong with the line after them; `None` when the dump simply ends there.
    pub fault: Option<String>,
}

impl Dump {
    /// Look at every file of the dump at `root`.
    ///
    /// # Errors
    /// When there is no index, or its first line is already bad.
    pub fn check(root: &Path) -> Result<Self> {
        let index = root.join(INDEX);
        let text = std::fs::read_to_string(&index).map_err(|e| Error::read(&index, e))?;
        // fakenect ends at the first empty line.
        let lines: Vec<&str> = text.split('\n').take_while(|line| !line.is_empty()).collect();
        let mut dump = Dump { root: root.into(), good: 0, fault: None };
        for (number, line) in lines.iter().enumerate() {
            if let Err(what) = good(root, line) {
                dump.fault = Some(format!("{}, line {}: {what}", index.display(), number + 1));
                break;
            }
            dump.good += 1;
        }
        if dump.good == 0 {
            let what = dump.fault.unwrap_or_else(|| format!("{} is empty", index.display()));
            return Err(Error::sensor(what, "record the dump again with fakenect-record"));
        }
        Ok(dump)
    }

    /// Why it ends where it ends.
    pub fn ending(&self) -> String {
        match &self.fault {
            Some(fault) => format!("the dump is damaged: {fault}"),
            None => format!("the dump in {} has no more frames", self.root.display()),
        }
    }
}

fn good(root: &Path, name: &str) -> std::result::Result<(), String> {
    let file = root.join(name);
    let length = std::fs::metadata(&file).map_err(|_| format!("{name} is missing"))?.len();
    let kind = name.split('-').next().unwrap_or_default();
    let stamped = || name.split('-').nth(1).is_some_and(|t| t.parse::<f64>().is_ok());
    if !matches!(kind, "d" | "r" | "a") || !stamped() {
        return Err(format!("\"{name}\" is not a file of fakenect-record"));
    }
    if kind == "d" {
        // Of many large files the first line and the length are enough.
        let mut header = Vec::new();
        File::open(&file)
            .and_then(|f| BufReader::new(f).read_until(b'\n', &mut header))
            .map_err(|e| format!("{name}: {e}"))?;
        if !header.starts_with(b"P5") || header.last() != Some(&b'\n') {
            return Err(format!("{name} is not a PGM image"));
        }
        if length < (header.len() + DEPTH_BYTES) as u64 {
            return Err(format!("{name} is cut short ({length} bytes)"));
        }
    } else if length == 0 {
        return Err(format!("{name} is empty"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dump(files: &[(&str, usize)], index: &str) -> (tempfile::TempDir, Result<Dump>) {
        let folder = tempfile::tempdir().unwrap();
        for (name, pixels) in files {
            let mut bytes = b"P5 640 480 65535\n".to_vec();
            bytes.resize(bytes.len() + pixels, 1);
            std::fs::write(folder.path().join(name), bytes).unwrap();
        }
        std::fs::write(folder.path().join(INDEX), index).unwrap();
        let checked = Dump::check(folder.path());
        (folder, checked)
    }

    #[test]
    fn only_what_stands_before_the_damage_is_played() {
        let files = [("d-1.0-1.pgm", DEPTH_BYTES), ("d-1.1-2.pgm", DEPTH_BYTES - 1)];
        let (_folder, checked) = dump(&files, "d-1.0-1.pgm\nd-1.1-2.pgm\nd-1.2-3.pgm\n");
        let checked = checked.unwrap();
        assert_eq!(checked.good, 1);
        assert!(checked.ending().contains("line 2: d-1.1-2.pgm is cut short"), "{checked:?}");
        let (_folder, cut_name) = dump(&files, "d-1.0-1.pgm\nd-1.1-2.p");
        assert!(cut_name.unwrap().ending().contains("d-1.1-2.p is missing"));
        let (_folder, whole) = dump(&files[..1], "d-1.0-1.pgm\n");
        assert!(whole.unwrap().ending().contains("no more frames"));
    }

    #[test]
    fn a_dump_without_a_good_first_line_is_refused() {
        assert!(dump(&[], "").1.is_err());
        assert!(dump(&[], "d-1.0-1.pgm\n").1.unwrap_err().to_string().contains("missing"));
    }
}
