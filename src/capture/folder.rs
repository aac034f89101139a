//! A folder that another program is filling: every new image is a frame.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use super::source::{Arrival, LiveFrame, Source};
use crate::error::{Error, Result};
use crate::io::{Assumed, describe_folder, read_depth};
use crate::view::Sensor;

/// How often the folder is looked at.
const LOOK_EVERY: Duration = Duration::from_millis(30);
/// A file that cannot be read is still being written, for so long at most.
const WRITING: Duration = Duration::from_secs(2);

/// 16-bit PNGs, or a dump's d-*.pgm, in the folder itself or in its `depth` folder.
pub struct Growing {
    root: PathBuf,
    sensor: Sensor,
    seen: BTreeSet<PathBuf>,
    waiting: Vec<PathBuf>,
    remarks: Vec<String>,
}

impl Growing {
    /// Wait for the first image for at most `patience`, as the size of the frames is in it.
    /// Images that are there already are frames too.
    ///
    /// # Errors
    /// When there is no such folder, no image comes, or the intrinsics are not known.
    pub fn open(root: &Path, assumed: &Assumed, patience: Duration) -> Result<Self> {
        if !root.is_dir() {
            return Err(Error::recording(
                root,
                "there is no such folder",
                "start the program that fills it first, or make it",
            ));
        }
        let begun = Instant::now();
        let first = loop {
            if let Some(first) = images(root).into_iter().find(|p| size(p).is_some()) {
                break first;
            }
            if begun.elapsed() > patience {
                return Err(Error::recording(
                    root,
                    format!("no depth image in {} s", patience.as_secs()),
                    "start the program that writes 16-bit PNGs (or fakenect-record) into it",
                ));
            }
            std::thread::sleep(LOOK_EVERY);
        };
        let (sensor, remarks) = describe_folder(root, size(&first).unwrap_or_default(), assumed)?;
        Ok(Growing {
            root: root.into(),
            sensor,
            seen: BTreeSet::new(),
            waiting: Vec::new(),
            remarks,
        })
    }

    /// The next image, when it can be read; younger ones wait for it.
    fn frame(&mut self) -> Option<LiveFrame> {
        if self.waiting.is_empty() {
            self.waiting = images(&self.root);
            self.waiting.retain(|p| !self.seen.contains(p));
            self.waiting.reverse();
        }
        let path = self.waiting.last()?.clone();
        let camera = &self.sensor.camera;
        let read = read_depth(&path, camera.width, camera.height);
        let modified = modified(&path);
        if read.is_err() && modified.elapsed().is_ok_and(|age| age < WRITING) {
            return None;
        }
        self.waiting.pop();
        self.seen.insert(path);
        match read {
            Ok(depth) => Some(LiveFrame { stamp: seconds(modified), depth, infrared: None }),
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

    fn next(&mut self, wait: Duration) -> Result<Arrival> {
        let begun = Instant::now();
        loop {
            if let Some(frame) = self.frame() {
                return Ok(Arrival::Frame(frame));
            }
            if begun.elapsed() >= wait {
                return Ok(Arrival::Nothing);
            }
            std::thread::sleep(LOOK_EVERY);
        }
    }

    fn remarks(&self) -> &[String] {
        &self.remarks
    }
}

fn size(path: &Path) -> Option<(usize, usize)> {
    crate::io::size_of(path).ok()
}

fn modified(path: &Path) -> SystemTime {
    std::fs::metadata(path).and_then(|m| m.modified()).unwrap_or(UNIX_EPOCH)
}

fn seconds(time: SystemTime) -> f64 {
    time.duration_since(UNIX_EPOCH).map_or(0.0, |d| d.as_secs_f64())
}

/// Depth images in name order.
fn images(root: &Path) -> Vec<PathBuf> {
    let inner = root.join("depth");
    let folder = if inner.is_dir() { inner } else { root.to_path_buf() };
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| is_depth(path))
        .collect();
    files.sort();
    files
}

fn is_depth(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let ends = |end: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(end));
    !name.starts_with('.') && (ends("png") || (ends("pgm") && name.starts_with("d-")))
}
