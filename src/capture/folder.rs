//! A folder that another program is filling: every new image is a frame.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use super::source::{Arrival, LiveFrame, Source};
use crate::error::{Error, Result};
use crate::io::{Assumed, by_number, describe_folder, entries, read_depth, size_of};
use crate::view::{FrameRef, Sensor};

/// Polling interval of the folder.
const POLL: Duration = Duration::from_millis(30);
/// An unreadable file younger than this counts as still being written.
const MAX_WRITING: Duration = Duration::from_secs(2);

/// 16-bit PNGs, or a dump's d-*.pgm, in the folder itself or in its `depth` folder.
pub struct Growing {
    root: PathBuf,
    sensor: Sensor,
    seen: BTreeSet<PathBuf>,
    /// Images not read yet, oldest last.
    waiting: Vec<PathBuf>,
    /// When the first of them could not be read for the first time.
    unread_since: Option<Instant>,
    remarks: Vec<String>,
}

impl Growing {
    /// Waits at most `patience` for the first image, which gives the frame size. Images
    /// that already exist are frames too.
    /// Fails if there is no such folder, no image arrives, or the intrinsics are unknown.
    pub fn open(root: &Path, assumed: &Assumed, patience: Duration) -> Result<Self> {
        if !root.is_dir() {
            let remedy = "start the program that fills it first, or make it";
            return Err(Error::recording(root, "there is no such folder", remedy));
        }
        assumed.refuse_topic(root)?;
        let first = first_image(root, patience)?;
        let (sensor, remarks) = describe_folder(root, &[FrameRef::file(0.0, first)], assumed)?;
        let seen = BTreeSet::new();
        let (waiting, unread_since) = (Vec::new(), None);
        Ok(Growing { root: root.into(), sensor, seen, waiting, unread_since, remarks })
    }

    /// The next image once it can be read; later ones wait for it.
    fn frame(&mut self) -> Option<LiveFrame> {
        if self.waiting.is_empty() {
            self.waiting = images(&self.root);
            self.waiting.retain(|p| !self.seen.contains(p));
            self.waiting.reverse();
        }
        let path = self.waiting.last()?;
        let (width, height) = (self.sensor.camera.width, self.sensor.camera.height);
        let read = read_depth(&FrameRef::file(0.0, path.clone()), width, height);
        let modified = modified(path);
        if read.is_err() {
            // Another machine's clock may be ahead.
            let since = self.unread_since.get_or_insert_with(Instant::now);
            if modified.elapsed().unwrap_or_else(|_| since.elapsed()) < MAX_WRITING {
                return None;
            }
        }
        self.unread_since = None;
        self.seen.extend(self.waiting.pop());
        let stamp = modified.duration_since(UNIX_EPOCH).map_or(0.0, |d| d.as_secs_f64());
        match read {
            Ok(depth) => Some(LiveFrame { stamp, depth, infrared: None }),
            Err(e) => {
                self.remarks.push(format!("frame left out: {e}"));
                None
            }
        }
    }
}

impl Source for Growing {
    fn sensor(&self) -> &Sensor {
        &self.sensor
    }

    fn next(&mut self, wait: Duration) -> Arrival {
        poll(wait, || self.frame()).map_or(Arrival::Nothing, Arrival::Frame)
    }

    fn remarks(&self) -> &[String] {
        &self.remarks
    }
}

/// The first image that can be read.
fn first_image(root: &Path, patience: Duration) -> Result<PathBuf> {
    let readable =
        || images(root).into_iter().find(|p| size_of(&FrameRef::file(0.0, p.clone())).is_ok());
    poll(patience, readable).ok_or_else(|| {
        let what = format!("no depth image in {} s", patience.as_secs());
        let remedy = "start the program that writes 16-bit PNGs (or fakenect-record) into it";
        Error::recording(root, what, remedy)
    })
}

/// Calls `look` repeatedly until it returns something, for at most `wait`.
fn poll<T>(wait: Duration, mut look: impl FnMut() -> Option<T>) -> Option<T> {
    let begun = Instant::now();
    loop {
        let found = look();
        if found.is_some() || begun.elapsed() >= wait {
            return found;
        }
        std::thread::sleep(POLL);
    }
}

fn modified(path: &Path) -> SystemTime {
    std::fs::metadata(path).and_then(|m| m.modified()).unwrap_or(UNIX_EPOCH)
}

/// Depth images in name order, numbers by their value.
fn images(root: &Path) -> Vec<PathBuf> {
    let inner = root.join("depth");
    let folder = if inner.is_dir() { &inner } else { root };
    let mut images = entries(folder).unwrap_or_default();
    images.retain(|path| is_depth(path));
    images.sort_by_cached_key(|path| by_number(path));
    images
}

fn is_depth(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let ends = |end: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(end));
    !name.starts_with('.') && (ends("png") || (ends("pgm") && name.starts_with("d-")))
}
