//! "timestamp path" lists: depth.txt, ir.txt, rgb.txt of the TUM layout.

use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::read::read_text;
use crate::units::{counted, verb};
use crate::view::FrameRef;

/// Timestamps from here on are not times, s: thirty thousand years.
pub(super) const LATEST_S: f64 = 1e12;

/// The frames that a list names, in time order, and remarks on it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FrameList {
    pub frames: Vec<FrameRef>,
    pub remarks: Vec<String>,
}

/// Reads a list; its paths are relative to its folder.
///
/// Missing files, timestamps out of order and duplicate timestamps are remarks, not errors.
/// Fails if a line is not "timestamp path".
pub fn read_list(path: &Path) -> Result<FrameList> {
    let text = read_text(path)?;
    let folder = path.parent().unwrap_or(Path::new("."));
    let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut list = FrameList::default();
    for (line, content) in content_lines(&text) {
        let (timestamp, named) = parse(content).ok_or_else(|| {
            let what = format!("\"{}\" is not \"timestamp path\"", shorten(content));
            Error::text(path, line, what, "write a time in seconds, a space, and a file name")
        })?;
        let target: PathBuf = folder.join(named);
        if target.is_file() {
            list.frames.push(FrameRef::file(timestamp, target));
        } else {
            let odd = if target.exists() { "is not a regular file" } else { "is missing" };
            let named = shorten_path(named);
            list.remarks.push(format!(
                "{file} line {line} names {named}, which {odd}; that frame is left out"
            ));
        }
    }
    put_in_order(&mut list, &file);
    Ok(list)
}

/// Lines that are neither empty nor comments, with their line numbers from 1.
pub(crate) fn content_lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let trimmed = text.lines().map(|line| line.trim_start_matches('\u{feff}').trim());
    (1..).zip(trimmed).filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

fn parse(line: &str) -> Option<(f64, &str)> {
    let (stamp, path) = line.split_once(char::is_whitespace)?;
    let timestamp: f64 = stamp.parse().ok().filter(|t: &f64| t.abs() < LATEST_S)?;
    let path = path.trim();
    (!path.is_empty()).then_some((timestamp, path))
}

pub(super) fn put_in_order(list: &mut FrameList, file: &str) {
    let frames = &mut list.frames;
    if frames.windows(2).any(|w| w[1].timestamp < w[0].timestamp) {
        list.remarks.push(format!("{file}: timestamps were out of order; frames were sorted"));
        frames.sort_by(|a, b| a.timestamp.total_cmp(&b.timestamp));
    }
    let before = frames.len();
    frames.dedup_by(|b, a| a.timestamp == b.timestamp && a.path == b.path);
    if frames.len() < before {
        list.remarks.push(format!(
            "{file}: {} {} twice; each frame is used once",
            counted(before - frames.len(), "line"),
            verb(before - frames.len(), "stands", "stand")
        ));
    }
    let shared = frames.windows(2).filter(|w| w[0].timestamp == w[1].timestamp).count();
    if shared > 0 {
        list.remarks.push(format!(
            "{file}: {} {} the same timestamp as another; all are used",
            counted(shared, "frame"),
            verb(shared, "has", "have")
        ));
    }
}

/// A path shortened for a message; the longest path of common systems is shown whole.
fn shorten_path(named: &str) -> String {
    named.chars().take(1024).collect()
}

/// A line shortened for a message.
pub(super) fn shorten(line: &str) -> String {
    const QUOTED: usize = 60;
    let mut short: String = line.chars().take(QUOTED).collect();
    if short.len() < line.len() {
        short.push('…');
    }
    short
}
