//! A recording on disk that grows view by view: each is whole or not there.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use super::lock::Lock;
use super::source::LiveFrame;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::io::{
    DEPTH_LIST, DESCRIPTION, encode_png16_quickly, entries, read_description, write_recording_file,
    write_view_notes,
};
use crate::view::{RecordingFile, Sensor, ViewNotes};

/// Views in the making stand in here; readers look for a depth list one level higher.
const WORKSHOP: &str = ".partial";
/// A view that is being replaced, until the new one stands.
const OLD: &str = "old-";
/// A view that nobody wants any more, on its way out.
const BAD: &str = "bad-";

/// An open recording.
pub struct Session {
    root: PathBuf,
    making: Option<Making>,
    remarks: Vec<String>,
    _lock: Lock,
}

struct Making {
    name: String,
    folder: PathBuf,
    depth_list: String,
    infrared_list: String,
    frames: usize,
    infrared: usize,
}

impl Session {
    /// Begin a recording in a new or empty folder, or go on with the one that is there.
    ///
    /// # Errors
    /// When something else is in the folder, another sensor took what is there, another capture
    /// is writing into it, or it cannot be written.
    pub fn open(root: &Path, sensor: &Sensor) -> Result<Self> {
        if root.exists() && !root.is_dir() {
            let remedy = "choose a new folder for the recording";
            return Err(Error::recording(root, "this is a file", remedy));
        }
        fs::create_dir_all(root).map_err(|e| failed(root, e))?;
        let lock = Lock::hold(root)?;
        let mut session =
            Session { root: root.into(), making: None, remarks: Vec::new(), _lock: lock };
        let description = root.join(DESCRIPTION);
        if description.is_file() {
            session.same_sensor(&read_description(&description)?, sensor)?;
            session.tidy()?;
        } else {
            session.tidy()?;
            crate::io::refuse_full(root)?;
            write_recording_file(root, sensor)?;
        }
        Ok(session)
    }

    fn same_sensor(&mut self, before: &Sensor, now: &Sensor) -> Result<()> {
        let description = self.root.join(DESCRIPTION);
        let refuse = |what: String| {
            let remedy = "plug that sensor in (with the same options), or choose a new folder";
            Err(Error::Recording { path: description.clone(), what, remedy })
        };
        if let (Some(old), Some(new)) = (&before.serial, &now.serial)
            && old != new
        {
            return refuse(format!("these views are of sensor {old}, and this one is {new}"));
        }
        let numbers = |s: &Sensor| RecordingFile {
            serial: None,
            sensor: String::new(),
            ..RecordingFile::of(s)
        };
        if numbers(before) != numbers(now) {
            return refuse(
                "these views were taken with another calibration (size, intrinsics, depth code)"
                    .into(),
            );
        }
        Ok(())
    }

    /// Take up what an interrupted run left: half views go, a view that was being replaced stays.
    fn tidy(&mut self) -> Result<()> {
        let workshop = self.root.join(WORKSHOP);
        if !workshop.is_dir() {
            return Ok(());
        }
        for folder in entries(&workshop)? {
            let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
            match name.strip_prefix(OLD) {
                Some(view) if !self.root.join(view).exists() => {
                    fs::rename(&folder, self.root.join(view)).map_err(|e| failed(&folder, e))?;
                    self.remarks.push(format!("view {view} was being replaced; the old one stays"));
                }
                Some(_) => {}
                None if name.starts_with(BAD) => {}
                None => self
                    .remarks
                    .push(format!("half of view {name} from an interrupted run was removed")),
            }
        }
        fs::remove_dir_all(&workshop).map_err(|e| failed(&workshop, e))
    }

    /// What was found and done while opening, in words.
    pub fn remarks(&self) -> &[String] {
        &self.remarks
    }

    /// Names of the views that are whole.
    ///
    /// # Errors
    /// When the folder cannot be read.
    pub fn taken(&self) -> Result<Vec<String>> {
        let whole = entries(&self.root)?.into_iter().filter(|p| p.join(DEPTH_LIST).is_file());
        Ok(whole.filter_map(|p| Some(p.file_name()?.to_string_lossy().into_owned())).collect())
    }

    /// Begin a view.
    ///
    /// # Errors
    /// When its folder cannot be made.
    pub fn begin(&mut self, name: &str) -> Result<()> {
        self.abandon();
        let folder = self.root.join(WORKSHOP).join(name);
        let depth = folder.join("depth");
        fs::create_dir_all(&depth).map_err(|e| failed(&depth, e))?;
        let header = String::from("# timestamp path\n");
        self.making = Some(Making {
            name: name.into(),
            folder,
            depth_list: header.clone(),
            infrared_list: header,
            frames: 0,
            infrared: 0,
        });
        Ok(())
    }

    /// Add a frame to the view that was begun.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn keep(&mut self, frame: &LiveFrame) -> Result<()> {
        let Some(making) = &mut self.making else { return Ok(()) };
        making.add(frame)
    }

    /// The view is whole: put it where it belongs, in place of one of that name.
    ///
    /// # Errors
    /// When it cannot be written; an older view of that name then stands as it stood.
    pub fn finish(&mut self, notes: &ViewNotes) -> Result<()> {
        let Some(making) = &self.making else { return Ok(()) };
        making.close(notes)?;
        let place = self.root.join(&making.name);
        let old = self.root.join(WORKSHOP).join(format!("{OLD}{}", making.name));
        let replaced = place.exists();
        if replaced {
            fs::rename(&place, &old).map_err(|e| failed(&place, e))?;
        }
        if let Err(e) = fs::rename(&making.folder, &place) {
            if replaced {
                let _ = fs::rename(&old, &place);
            }
            return Err(failed(&place, e));
        }
        self.making = None;
        if replaced {
            fs::remove_dir_all(&old).map_err(|e| failed(&old, e))?;
        }
        sync(&self.root)
    }

    /// Throw a whole view away, at once: it shall not count as taken, however this run ends.
    ///
    /// # Errors
    /// When it cannot be moved; it then stands as it stood.
    pub fn reject(&mut self, name: &str) -> Result<()> {
        let workshop = self.root.join(WORKSHOP);
        fs::create_dir_all(&workshop).map_err(|e| failed(&workshop, e))?;
        let (place, bad) = (self.root.join(name), workshop.join(format!("{BAD}{name}")));
        fs::rename(&place, &bad).map_err(|e| failed(&place, e))?;
        fs::remove_dir_all(&bad).map_err(|e| failed(&bad, e))?;
        sync(&self.root)
    }

    /// Throw the view that was begun away.
    pub fn abandon(&mut self) {
        if let Some(making) = self.making.take() {
            let _ = fs::remove_dir_all(making.folder);
        }
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        self.abandon();
        // Fails, rightly, when an old view stands in it.
        let _ = fs::remove_dir(self.root.join(WORKSHOP));
    }
}

impl Making {
    fn add(&mut self, frame: &LiveFrame) -> Result<()> {
        let name = format!("{:04}.png", self.frames);
        self.image("depth", &name, &frame.depth)?;
        let _ = writeln!(self.depth_list, "{:.6} depth/{name}", frame.stamp);
        self.frames += 1;
        if let Some(infrared) = &frame.infrared {
            self.image("ir", &name, infrared)?;
            let _ = writeln!(self.infrared_list, "{:.6} ir/{name}", frame.stamp);
            self.infrared += 1;
        }
        Ok(())
    }

    fn image(&self, kind: &str, name: &str, frame: &Frame) -> Result<()> {
        let folder = self.folder.join(kind);
        fs::create_dir_all(&folder).map_err(|e| failed(&folder, e))?;
        let path = folder.join(name);
        fs::write(&path, encode_png16_quickly(frame)?).map_err(|e| failed(&path, e))
    }

    /// Everything on the disk itself, the list of the frames last.
    fn close(&self, notes: &ViewNotes) -> Result<()> {
        write_view_notes(&self.folder, notes)?;
        for kind in ["depth", "ir"].map(|kind| self.folder.join(kind)) {
            if kind.is_dir() {
                for image in entries(&kind)? {
                    sync(&image)?;
                }
                sync(&kind)?;
            }
        }
        if self.infrared > 0 {
            write_synced(&self.folder.join("ir.txt"), &self.infrared_list)?;
        }
        write_synced(&self.folder.join(DEPTH_LIST), &self.depth_list)?;
        sync(&self.folder)
    }
}

fn write_synced(path: &Path, text: &str) -> Result<()> {
    fs::write(path, text).map_err(|e| failed(path, e))?;
    sync(path)
}

/// Of folders too, where they can be opened.
fn sync(path: &Path) -> Result<()> {
    if cfg!(not(unix)) && path.is_dir() {
        return Ok(());
    }
    fs::File::open(path).and_then(|file| file.sync_all()).map_err(|e| failed(path, e))
}

fn failed(path: &Path, cause: std::io::Error) -> Error {
    let remedy =
        "make room or choose a folder that can be written, then give the same command again";
    Error::Io { path: path.into(), cause, remedy }
}

#[cfg(test)]
#[path = "session_tests.rs"]
mod tests;
