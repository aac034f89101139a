//! The dump that fakenect plays, libfreenect's stand-in; each line is checked beforehand.
//!
//! fakenect ends the whole process when FAKENECT_PATH is not set or a file is missing, and reads
//! beyond the end of a file that is cut short. So it is only ever asked for lines that are good.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use super::ffi::DEPTH_BYTES;
use crate::error::{Error, Result, read_text};
use crate::io::INDEX;

/// A dump, and how far it has been played.
#[derive(Debug)]
pub struct Dump {
    root: PathBuf,
    lines: Vec<String>,
    played: usize,
}

impl Dump {
    /// Read the index of the dump at `root`.
    ///
    /// # Errors
    /// When there is no index, or its first line is already bad.
    pub fn open(root: &Path) -> Result<Self> {
        let index = root.join(INDEX);
        let text = read_text(&index)?;
        // fakenect ends at the first empty line.
        let lines = text.split('\n').take_while(|line| !line.is_empty()).map(String::from);
        let dump = Dump { root: root.into(), lines: lines.collect(), played: 0 };
        let first =
            dump.next_line().unwrap_or_else(|| Err(format!("{} is empty", index.display())));
        let remedy = "record the dump again with fakenect-record";
        first.map_err(|what| Error::sensor(what, remedy))?;
        Ok(dump)
    }

    /// Allow fakenect its next line.
    ///
    /// # Errors
    /// A sentence that says why the dump ends here.
    pub fn advance(&mut self) -> std::result::Result<(), String> {
        match self.next_line() {
            None => return Err(format!("the dump in {} has no more frames", self.root.display())),
            Some(Err(fault)) => return Err(format!("the dump is damaged: {fault}")),
            Some(Ok(())) => self.played += 1,
        }
        Ok(())
    }

    /// Is the next line good? `None` at the end.
    fn next_line(&self) -> Option<std::result::Result<(), String>> {
        let name = self.lines.get(self.played)?;
        let place = || format!("{}, line {}", self.root.join(INDEX).display(), self.played + 1);
        Some(check(&self.root, name).map_err(|what| format!("{}: {what}", place())))
    }
}

/// Is this a file that fakenect can read?
fn check(root: &Path, name: &str) -> std::result::Result<(), String> {
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
