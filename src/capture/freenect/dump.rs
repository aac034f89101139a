//! The dump that fakenect, libfreenect's stand-in, plays. Every line is checked beforehand.
//!
//! fakenect ends the whole process if a file is missing, and reads past the end of a truncated one. So it is
//! only ever asked for good lines.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

use super::ffi::DEPTH_BYTES;
use crate::error::{Error, Result};
use crate::io::INDEX;
use crate::read::read_text;

/// Number of lines of a dump left to play, and the message at their end.
#[derive(Debug)]
pub struct Dump {
    left: usize,
    ending: String,
}

impl Dump {
    /// Checks the dump at `root`.
    /// Fails if there is no index, or its first line is bad.
    pub fn open(root: &Path) -> Result<Self> {
        let index = root.join(INDEX);
        let text = read_text(&index)?;
        // fakenect ends at the first empty line.
        let lines: Vec<&str> = text.split('\n').take_while(|line| !line.is_empty()).collect();
        let faults =
            lines.iter().enumerate().filter_map(|(i, name)| Some((i, check(root, name).err()?)));
        let fault = faults
            .map(|(i, what)| (i, format!("{}, line {}: {what}", index.display(), i + 1)))
            .next();
        let remedy = "record the dump again with fakenect-record";
        match fault {
            _ if lines.is_empty() => {
                Err(Error::sensor(format!("{} is empty", index.display()), remedy))
            }
            Some((0, what)) => Err(Error::sensor(what, remedy)),
            Some((left, what)) => Ok(Dump { left, ending: format!("the dump is damaged: {what}") }),
            None => {
                let ending = format!("the dump in {} has no more frames", root.display());
                Ok(Dump { left: lines.len(), ending })
            }
        }
    }

    /// Allows fakenect its next line.
    /// The error is why the dump ends here.
    pub fn advance(&mut self) -> std::result::Result<(), String> {
        self.left = self.left.checked_sub(1).ok_or_else(|| self.ending.clone())?;
        Ok(())
    }
}

/// Checks that fakenect can read this file.
fn check(root: &Path, name: &str) -> std::result::Result<(), String> {
    let file = root.join(name);
    let length = std::fs::metadata(&file).map_err(|_| format!("{name} is missing"))?.len();
    let kind = name.split('-').next().unwrap_or_default();
    let stamped = || name.split('-').nth(1).is_some_and(|t| t.parse::<f64>().is_ok());
    if !matches!(kind, "d" | "r" | "a") || !stamped() {
        return Err(format!("\"{name}\" is not a file of fakenect-record"));
    }
    if kind == "d" {
        // The files are many and large: the first line and the length must do.
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
        let opened = Dump::open(folder.path());
        (folder, opened)
    }

    #[test]
    fn only_what_stands_before_the_damage_is_played() {
        let files = [("d-1.0-1.pgm", DEPTH_BYTES), ("d-1.1-2.pgm", DEPTH_BYTES - 1)];
        let (_folder, opened) = dump(&files, "d-1.0-1.pgm\nd-1.1-2.pgm\nd-1.2-3.pgm\n");
        let ending = |opened: Result<Dump>| {
            let mut dump = opened.unwrap();
            assert_eq!(dump.advance(), Ok(()));
            dump.advance().unwrap_err()
        };
        let cut = ending(opened);
        assert!(cut.contains("line 2: d-1.1-2.pgm is cut short"), "{cut}");
        let (_folder, cut_name) = dump(&files, "d-1.0-1.pgm\nd-1.1-2.p");
        assert!(ending(cut_name).contains("d-1.1-2.p is missing"));
        let (_folder, whole) = dump(&files[..1], "d-1.0-1.pgm\n");
        assert!(ending(whole).contains("no more frames"));
    }

    #[test]
    fn a_dump_without_a_good_first_line_is_refused() {
        assert!(dump(&[], "").1.is_err());
        assert!(dump(&[], "d-1.0-1.pgm\n").1.unwrap_err().to_string().contains("missing"));
    }
}
