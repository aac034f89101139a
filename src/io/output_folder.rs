//! Output folders: the one rule for what a command leaves behind.
//!
//! A folder is filled beside its final place and moved there when complete; until then no reader takes it for
//! a result, however the run ends. It goes to a new or empty place or over earlier results of the same
//! command; over anything else only if forced. It never goes into an input.

use std::ffi::OsString;
use std::fs;
use std::path::{Component, Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use super::layout::DESCRIPTIONS;
use super::output::{entries, listed, sync_folder, write_atomic};
use super::unfinished::{Open, UNFINISHED, discard, discard_stale, lock, register, unfinished};
use crate::error::{Error, Result};

/// Error for a folder that another run has locked.
const TAKEN: [&str; 2] = [
    "another run is writing into this folder",
    "wait until it has ended, or choose another folder",
];

/// What a command writes into its folder.
#[derive(Debug, Clone, Copy)]
pub enum Leaves {
    /// Files and folders of these names; a name ending in `-` is a prefix.
    Results {
        names: &'static [&'static [&'static str]],
        /// Names that no other command writes; without one of them the other files count as foreign.
        marks: &'static [&'static str],
    },
    /// Images: everything in a folder that holds one of these files belongs to them.
    Images { marks: &'static [&'static str] },
}

impl Leaves {
    /// A recording or a sequence.
    pub const RECORDING: Leaves = Leaves::Images { marks: &DESCRIPTIONS };
}

/// An output folder in preparation; discarded if dropped before [`OutputFolder::finish`].
#[derive(Debug)]
pub struct OutputFolder {
    place: PathBuf,
    staging: PathBuf,
    leaves: Leaves,
    stands: Stands,
    forced: bool,
    /// Parent folders created for this one, innermost first.
    parents: Vec<PathBuf>,
    /// Locks on the folder at the place, until this one is moved there, and on this one.
    _locks: [Option<fs::File>; 2],
    done: bool,
}

/// What was at the place when the run began.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Stands {
    Nothing,
    Empty,
    /// Results of the same command, or a recording to be replaced.
    Earlier,
    /// Files of others: they stay, except those of the same name.
    Others,
}

impl OutputFolder {
    /// Checks, before the work begins, that the place may be written. `inputs` are the files and folders that
    /// are read; `force` allows writing among files of others.
    /// Fails if the place must not or cannot be written.
    pub fn begin(place: &Path, leaves: Leaves, inputs: &[&Path], force: bool) -> Result<Self> {
        for input in inputs.iter().filter(|input| input.is_dir()) {
            refuse_inside(place, input)?;
        }
        let stands = what_stands(place, leaves, force)?;
        for input in inputs {
            refuse_replacing(place, leaves, input)?;
        }
        // If nothing exists yet, the first run to finish gets the place; the other fails.
        let of_place = if stands == Stands::Nothing { None } else { lock(place, TAKEN)? };
        let unique = format!("{}{}", unfinished(), next_number());
        let (parents, staging) = if stands == Stands::Nothing {
            let absolute = std::path::absolute(place).map_err(|e| Error::write(place, e))?;
            let parent = absolute.parent().unwrap_or(&absolute).to_path_buf();
            (make_parents(&parent).map_err(|e| Error::write(place, e))?, parent.join(unique))
        } else {
            // Inside, because it may be a mount or a link: the rename must stay on one disk.
            (Vec::new(), place.join(unique))
        };
        staging.parent().into_iter().for_each(discard_stale);
        let mut folder = OutputFolder {
            place: place.to_path_buf(),
            staging,
            leaves,
            stands,
            forced: force,
            parents,
            _locks: [of_place, None],
            done: false,
        };
        // Detects a name that is too long now, not when all the work is done.
        if let Err(e) = fs::symlink_metadata(place)
            && e.kind() != std::io::ErrorKind::NotFound
        {
            return Err(Error::write(place, e));
        }
        let mut register = register();
        fs::create_dir(&folder.staging).map_err(|e| Error::write(place, e))?;
        register.open.push(Open {
            place: folder.place.clone(),
            staging: folder.staging.clone(),
            parents: folder.parents.clone(),
            stood: stands != Stands::Nothing,
        });
        drop(register);
        folder._locks[1] = lock(&folder.staging, TAKEN)?;
        Ok(folder)
    }

    /// Folder to write into.
    pub fn path(&self) -> &Path {
        &self.staging
    }

    /// Final path of the folder.
    pub fn place(&self) -> &Path {
        &self.place
    }

    /// Whether it will replace earlier results.
    pub fn replaces(&self) -> bool {
        self.stands == Stands::Earlier
    }

    /// Whether it was begun with `force`.
    pub fn forced(&self) -> bool {
        self.forced
    }

    /// Writes one file of the output.
    /// Fails if the folder has become unwritable or the disk is full.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<()> {
        write_atomic(&self.staging.join(name), bytes)
    }

    /// Moves the folder to its place.
    /// Fails if that has become impossible; the results are then kept where the message says.
    pub fn finish(mut self) -> Result<()> {
        // Synced before the rename: even a power cut leaves the folder whole or absent.
        let synced = sync_folders(&self.staging);
        // Held throughout: an interruption finds the folder whole or absent.
        let mut register = register();
        let put = synced.and_then(|()| match self.stands {
            Stands::Nothing => fs::rename(&self.staging, &self.place)
                .and_then(|()| self.staging.parent().map_or(Ok(()), sync_folder)),
            _ => self.put_inside().and_then(|()| sync_folder(&self.place)),
        });
        self.done = true;
        register.open.retain(|open| open.staging != self.staging);
        put.map_err(|cause| {
            // Renamed so that no later run takes it for the leftovers of a killed one.
            let kept = self.staging.with_extension("kept");
            let kept = fs::rename(&self.staging, &kept).map_or(&self.staging, |()| &kept);
            Error::Recording {
                path: self.place.clone(),
                what: format!("{cause}: the results are kept in {}", kept.display()),
                remedy: "move them where they shall be",
            }
        })?;
        register.finished.push(self.place.clone());
        Ok(())
    }

    /// Moves the files into the existing folder. The files that mark results as complete are removed first
    /// and added last, so that a kill leaves no mixture that has them.
    fn put_inside(&self) -> std::io::Result<()> {
        let mut new = names(&self.staging)?;
        new.sort_by_key(|name| (self.comes_last(name), name.clone()));
        let mut replaced = names(&self.place)?;
        replaced.retain(|name| !is_unfinished(name) && self.is_replaced(name, new.contains(name)));
        replaced.sort_by_key(|name| (!self.comes_last(name), name.clone()));
        let old = self.staging.with_extension("old");
        for name in &replaced {
            fs::create_dir_all(&old)?;
            fs::rename(self.place.join(name), old.join(name))?;
        }
        for name in &new {
            fs::rename(self.staging.join(name), self.place.join(name))?;
        }
        fs::remove_dir(&self.staging)?;
        if old.exists() { fs::remove_dir_all(&old) } else { Ok(()) }
    }

    /// Whether new results remove this name from the place.
    fn is_replaced(&self, name: &OsString, comes: bool) -> bool {
        match (self.leaves, self.stands) {
            (Leaves::Images { .. }, _) => true,
            (_, Stands::Earlier) if !self.place.join(name).is_dir() => true,
            _ => self.place.join(name).is_dir() && comes,
        }
    }

    fn comes_last(&self, name: &OsString) -> bool {
        let name = name.to_string_lossy();
        let (Leaves::Images { marks } | Leaves::Results { marks, .. }) = self.leaves;
        marks.contains(&&*name)
    }
}

impl Drop for OutputFolder {
    fn drop(&mut self) {
        if !self.done {
            let mut register = register();
            register.open.retain(|open| open.staging != self.staging);
            discard(&self.staging, &self.parents);
        }
    }
}

fn next_number() -> usize {
    static NEXT: AtomicUsize = AtomicUsize::new(0);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

/// Syncs a folder and everything below it.
fn sync_folders(folder: &Path) -> std::io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            sync_folders(&entry.path())?;
        }
    }
    sync_folder(folder)
}

fn names(folder: &Path) -> std::io::Result<Vec<OsString>> {
    fs::read_dir(folder)?.map(|entry| Ok(entry?.file_name())).collect()
}

fn is_unfinished(name: &OsString) -> bool {
    name.to_string_lossy().starts_with(UNFINISHED)
}

/// Creates the missing folders and returns them, innermost first.
fn make_parents(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let missing = folder.ancestors().take_while(|f| !f.exists()).map(Path::to_path_buf).collect();
    fs::create_dir_all(folder).map(|()| missing)
}

fn no_folder(file: &Path) -> Error {
    Error::recording(file, "this is a file, not a folder", "give another folder, such as with -o")
}

/// What is at the place. Fails if it must not be written.
fn what_stands(place: &Path, leaves: Leaves, force: bool) -> Result<Stands> {
    if fs::symlink_metadata(place).is_err() {
        // A file among its ancestors would otherwise show only when the folder is created.
        let standing = place.ancestors().find(|p| fs::symlink_metadata(p).is_ok());
        return match standing.filter(|p| !p.as_os_str().is_empty() && !p.is_dir()) {
            Some(file) => Err(no_folder(file)),
            None => Ok(Stands::Nothing),
        };
    }
    if !place.is_dir() {
        return Err(no_folder(place));
    }
    let there: Vec<String> = entries(place)?
        .iter()
        .filter_map(|path| path.file_name().map(|name| name.to_string_lossy().into_owned()))
        .filter(|name| !name.starts_with(UNFINISHED))
        .collect();
    if there.is_empty() {
        return Ok(Stands::Empty);
    }
    let refuse = |what: String, remedy| Err(Error::recording(place, what, remedy));
    match leaves {
        Leaves::Images { marks } if !there.iter().any(|name| marks.contains(&&**name)) => refuse(
            format!("the folder is not empty (it holds {})", listed(&there)),
            "choose a new folder",
        ),
        Leaves::Images { .. } if force => Ok(Stands::Earlier),
        Leaves::Images { .. } => refuse(
            "the folder is not empty: it holds an earlier output".into(),
            "choose a new folder, or give --force to replace what is there",
        ),
        Leaves::Results { names, marks } => {
            let known = |name: &str| names.iter().any(|names| is_one_of(names, name));
            let mut others = there.clone();
            // A file of a common name is this command's only if a mark is there too.
            let marked = there.iter().any(|name| marks.contains(&name.as_str()));
            others.retain(|name| !(marked && known(name)));
            match (others.is_empty(), force) {
                (true, _) => Ok(Stands::Earlier),
                (_, true) => Ok(Stands::Others),
                _ => refuse(
                    format!("the folder holds {}, not of this command", listed(&others)),
                    "choose a new folder, or give --force to write beside it and over what has the same name",
                ),
            }
        }
    }
}

/// Whether `name` is one of these; a name that ends in `-` stands for all that begin so.
fn is_one_of(names: &[&str], name: &str) -> bool {
    names.iter().any(|n| *n == name || (n.ends_with('-') && name.starts_with(n)))
}

/// Fails if the output would replace `input`.
fn refuse_replacing(place: &Path, leaves: Leaves, input: &Path) -> Result<()> {
    // A missing input is reported by its reader.
    let Ok(input) = input.canonicalize() else { return Ok(()) };
    let place_is = settled(place)?;
    let Ok(within) = input.strip_prefix(&place_is) else { return Ok(()) };
    let first = within.iter().next().unwrap_or_default().to_string_lossy();
    let replaced = match leaves {
        Leaves::Images { .. } => true,
        Leaves::Results { names, .. } => names.iter().any(|names| is_one_of(names, &first)),
    };
    if replaced {
        let what = format!("the output would replace {}, which is read", input.display());
        return Err(Error::recording(place, what, "choose a folder elsewhere"));
    }
    Ok(())
}

/// Fails if `place` is the folder `input` or lies inside it: it would become part of what is read.
pub fn refuse_inside(place: &Path, input: &Path) -> Result<()> {
    let input = input.canonicalize().map_err(|e| Error::read(input, e))?;
    if settled(place)?.starts_with(input) {
        let what = "the output would lie inside the recording that is read";
        return Err(Error::recording(place, what, "choose a folder elsewhere"));
    }
    Ok(())
}

/// Fails if two outputs are the same folder or one lies inside the other: they would interfere.
pub fn refuse_nested(one: &Path, other: &Path) -> Result<()> {
    let (a, b) = (settled(one)?, settled(other)?);
    if !a.starts_with(&b) && !b.starts_with(&a) {
        return Ok(());
    }
    let what = format!("{} and this folder would lie one in the other", other.display());
    Err(Error::recording(one, what, "choose a folder beside it"))
}

/// Absolute path without links. A path that does not exist yet has no canonical form; an ancestor has.
pub fn settled(place: &Path) -> Result<PathBuf> {
    let absolute = std::path::absolute(place).map_err(|e| Error::write(place, e))?;
    for folder in absolute.ancestors() {
        if let Ok(standing) = folder.canonicalize() {
            let rest = absolute.strip_prefix(folder).unwrap_or(Path::new(""));
            return Ok(rest.components().fold(standing, |mut path, part| {
                // The rest does not exist yet, so it contains no links.
                match part {
                    Component::ParentDir => drop(path.pop()),
                    part => path.push(part),
                }
                path
            }));
        }
    }
    Ok(absolute)
}

#[cfg(test)]
mod tests;
