//! A recording on the disk that grows view by view; each view is complete or absent.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use super::source::LiveFrame;
use crate::error::{Error, Result};
use crate::io::{
    DEPTH_LIST, DESCRIPTION, encode_png16_quickly, entries, lock, read_description, refuse_full,
    sync_folder, write_recording_file, write_view_notes,
};
use crate::view::{Sensor, ViewNotes};

/// Folder of unfinished views; readers look for a depth list one level higher.
const PARTIAL: &str = ".partial";
/// Prefix of a view that is being replaced, until the new one is in place.
const OLD: &str = "old-";
/// Prefix of a rejected view that is being removed.
const REJECTED: &str = "bad-";
/// Error if another capture has locked the recording.
const TAKEN: [&str; 2] = [
    "another capture is writing into it",
    "end that one first (q, or Ctrl-C), or choose a new folder",
];

/// An open recording.
pub struct Session {
    root: PathBuf,
    partial: Option<PartialView>,
    remarks: Vec<String>,
    _lock: Option<File>,
}

struct PartialView {
    name: String,
    folder: PathBuf,
    frames: usize,
    /// Kind of image, which names its folder, and the list of these images.
    lists: [(&'static str, String); 2],
}

impl Session {
    /// Begins a recording in a new or empty folder, or resumes the one that is there.
    /// Fails if something else is in the folder, another sensor took the existing views, another capture is
    /// writing into it, or it cannot be written.
    pub fn open(root: &Path, sensor: &Sensor) -> Result<Self> {
        if root.exists() && !root.is_dir() {
            let remedy = "choose a new folder for the recording";
            return Err(Error::recording(root, "this is a file", remedy));
        }
        fs::create_dir_all(root).map_err(|e| failed(root, e))?;
        let _lock = lock(root, TAKEN)?;
        let mut session = Session { root: root.into(), partial: None, remarks: vec![], _lock };
        let description = root.join(DESCRIPTION);
        if description.is_file() {
            refuse_another(&description, sensor)?;
            session.recover()?;
        } else {
            refuse_full(root)?;
            write_recording_file(root, sensor)?;
        }
        Ok(session)
    }

    /// Cleans up after an interrupted run: incomplete views are removed, a view that
    /// was being replaced is restored.
    fn recover(&mut self) -> Result<()> {
        let partial = self.root.join(PARTIAL);
        if !partial.is_dir() {
            return Ok(());
        }
        for folder in entries(&partial)? {
            let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
            match name.strip_prefix(OLD) {
                Some(view) if !self.root.join(view).exists() => {
                    fs::rename(&folder, self.root.join(view)).map_err(|e| failed(&folder, e))?;
                    self.remarks.push(format!("view {view} was being replaced; the old one stays"));
                }
                None if !name.starts_with(REJECTED) => self
                    .remarks
                    .push(format!("half of view {name} from an interrupted run was removed")),
                _ => {}
            }
        }
        fs::remove_dir_all(&partial).map_err(|e| failed(&partial, e))
    }

    /// What was found and done while opening, one sentence each.
    pub fn remarks(&self) -> &[String] {
        &self.remarks
    }

    /// Names of the complete views.
    /// Fails if the folder cannot be read.
    pub fn taken(&self) -> Result<Vec<String>> {
        let whole = entries(&self.root)?.into_iter().filter(|p| p.join(DEPTH_LIST).is_file());
        Ok(whole.filter_map(|p| Some(p.file_name()?.to_string_lossy().into_owned())).collect())
    }

    /// Begins a view.
    /// Fails if its folder cannot be created.
    pub fn begin(&mut self, name: &str) -> Result<()> {
        self.abandon();
        let folder = self.root.join(PARTIAL).join(name);
        fs::create_dir_all(&folder).map_err(|e| failed(&folder, e))?;
        let lists = ["ir", "depth"].map(|kind| (kind, String::new()));
        self.partial = Some(PartialView { name: name.into(), folder, frames: 0, lists });
        Ok(())
    }

    /// Adds a frame to the view that was begun.
    /// Fails if it cannot be written.
    pub fn keep(&mut self, frame: &LiveFrame) -> Result<()> {
        self.partial.as_mut().map_or(Ok(()), |view| view.keep(frame))
    }

    /// Completes the view and moves it to its place, replacing any view of that name.
    /// Fails if it cannot be written; an older view of that name is then kept.
    pub fn finish(&mut self, notes: &ViewNotes) -> Result<()> {
        let Some(view) = &self.partial else { return Ok(()) };
        view.close(notes)?;
        let place = self.root.join(&view.name);
        let old = self.root.join(PARTIAL).join(format!("{OLD}{}", view.name));
        let replaced = place.exists();
        // What an earlier retake could not remove; the rename says so if it still stands.
        let _ = fs::remove_dir_all(&old);
        if replaced {
            fs::rename(&place, &old).map_err(|e| failed(&place, e))?;
        }
        if let Err(e) = fs::rename(&view.folder, &place) {
            if replaced {
                let _ = fs::rename(&old, &place);
            }
            return Err(failed(&place, e));
        }
        self.partial = None;
        if replaced {
            // The new view is in its place: what is left of the old one goes with the next session's leftovers.
            let _ = fs::remove_dir_all(&old);
        }
        sync(&self.root)
    }

    /// Discards a complete view at once: it must not count as taken, however this run ends.
    /// Fails if it cannot be moved; it is then kept.
    pub fn reject(&mut self, name: &str) -> Result<()> {
        let partial = self.root.join(PARTIAL);
        fs::create_dir_all(&partial).map_err(|e| failed(&partial, e))?;
        let (place, bad) = (self.root.join(name), partial.join(format!("{REJECTED}{name}")));
        fs::rename(&place, &bad).map_err(|e| failed(&place, e))?;
        fs::remove_dir_all(&bad).map_err(|e| failed(&bad, e))?;
        sync(&self.root)
    }

    /// Discards the view that was begun.
    pub fn abandon(&mut self) {
        if let Some(view) = self.partial.take() {
            let _ = fs::remove_dir_all(view.folder);
        }
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        self.abandon();
        // Fails, rightly, if an old view is still in it.
        let _ = fs::remove_dir(self.root.join(PARTIAL));
    }
}

impl PartialView {
    fn keep(&mut self, frame: &LiveFrame) -> Result<()> {
        let images = [frame.infrared.as_ref(), Some(&frame.depth)];
        for ((kind, list), image) in self.lists.iter_mut().zip(images) {
            let Some(image) = image else { continue };
            // Infrared images carry the number of their depth image.
            let path = format!("{kind}/{:04}.png", self.frames);
            let (folder, file) = (self.folder.join(kind), self.folder.join(&path));
            fs::create_dir_all(&folder).map_err(|e| failed(&folder, e))?;
            fs::write(&file, encode_png16_quickly(image)?).map_err(|e| failed(&file, e))?;
            *list += &format!("{:.6} {path}\n", frame.stamp);
        }
        self.frames += 1;
        Ok(())
    }

    /// Writes everything to the disk, the list of the depth frames last.
    fn close(&self, notes: &ViewNotes) -> Result<()> {
        write_view_notes(&self.folder, notes)?;
        for (kind, list) in self.lists.iter().filter(|(_, list)| !list.is_empty()) {
            let images = self.folder.join(kind);
            entries(&images)?.iter().try_for_each(|image| sync(image))?;
            sync(&images)?;
            let path = self.folder.join(format!("{kind}.txt"));
            let text = format!("# timestamp path\n{list}");
            fs::write(&path, text).map_err(|e| failed(&path, e))?;
            sync(&path)?;
        }
        sync(&self.folder)
    }
}

/// Fails unless a recording is resumed with the sensor that it was begun with.
fn refuse_another(description: &Path, now: &Sensor) -> Result<()> {
    let before = read_description(description)?;
    let refuse = |what: String| {
        let remedy = "plug that sensor in (with the same options), or choose a new folder";
        Err(Error::recording(description, what, remedy))
    };
    if let (Some(old), Some(new)) = (&before.serial, &now.serial)
        && old != new
    {
        return refuse(format!("these views are of sensor {old}, and this one is {new}"));
    }
    let nameless = |s: &Sensor| Sensor { serial: None, name: String::new(), ..s.clone() };
    if nameless(&before) != nameless(now) {
        let what = "these views were taken with another calibration (size, intrinsics, depth code)";
        return refuse(what.into());
    }
    Ok(())
}

/// Flushes a file or a folder to the disk.
fn sync(path: &Path) -> Result<()> {
    let synced = if path.is_dir() {
        sync_folder(path)
    } else {
        File::open(path).and_then(|file| file.sync_all())
    };
    synced.map_err(|e| failed(path, e))
}

fn failed(path: &Path, cause: std::io::Error) -> Error {
    let remedy =
        "make room or choose a folder that can be written, then give the same command again";
    Error::Io { path: path.into(), cause, remedy }
}

#[cfg(test)]
mod tests;
