//! The folders that this process is filling, so that an interrupted run can remove them.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::error::{Error, Result};

/// Prefix of the names of folders being filled and of files being written.
pub(super) const UNFINISHED: &str = ".kinoise-";

/// What an interruption discarded and kept.
#[derive(Debug, Default)]
pub struct Interrupted {
    /// Places still to be written, and whether something existed there, which remains.
    pub discarded: Vec<(PathBuf, bool)>,
    /// Places finished before.
    pub kept: Vec<PathBuf>,
}

/// Discards all unfinished folders, for a process that exits at once: the register stays locked, so no other
/// folder can be begun or finished afterwards.
pub fn discard_unfinished() -> Interrupted {
    let mut register = register();
    let open = std::mem::take(&mut register.open);
    for open in &open {
        // Other threads may still be writing: a file of this name keeps them from recreating the folder.
        let blocked = |staging: &Path| {
            let _ = fs::remove_dir_all(staging);
            fs::File::create_new(staging).is_ok()
        };
        let _ = (0..MAX_ROUNDS).any(|_| blocked(&open.staging));
    }
    std::thread::sleep(SETTLING);
    for open in &open {
        let _ = fs::remove_file(&open.staging);
        discard(&open.staging, &open.parents);
    }
    let kept = register.finished.clone();
    std::mem::forget(register);
    Interrupted { discarded: open.into_iter().map(|o| (o.place, o.stood)).collect(), kept }
}

/// Each round takes longer than creating a folder.
const MAX_ROUNDS: usize = 100;
/// By then every thread has failed at its next write and stopped.
const SETTLING: Duration = Duration::from_millis(100);

/// Removes an unfinished folder and the parent folders created for it.
pub(super) fn discard(staging: &Path, parents: &[PathBuf]) {
    let _ = fs::remove_dir_all(staging);
    // Fails, rightly, if something else is in them by now.
    parents.iter().for_each(|parent| drop(fs::remove_dir(parent)));
}

/// Locks a folder for this run until the returned file is dropped, however the process ends: two runs would
/// mix their files. Fails with this message if another run holds the lock.
pub(crate) fn lock(folder: &Path, [what, remedy]: [&'static str; 2]) -> Result<Option<fs::File>> {
    // Some systems cannot open folders, and some network disks have no locks.
    let Ok(file) = fs::File::open(folder) else { return Ok(None) };
    match file.try_lock() {
        Err(fs::TryLockError::WouldBlock) => Err(Error::recording(folder, what, remedy)),
        _ => Ok(Some(file)),
    }
}

/// Age from which an unlocked entry of an unknown process is stale; a live run locks it much sooner.
const STALE: Duration = Duration::from_secs(60);

/// Removes what killed runs left in `parent`: unlocked entries. Entries kept for the
/// user have an extension and stay.
pub fn discard_stale(parent: &Path) {
    // The parent of a bare name is empty.
    let parent = if parent.as_os_str().is_empty() { Path::new(".") } else { parent };
    let entries = fs::read_dir(parent).into_iter().flatten().flatten();
    for entry in entries.filter(|e| e.file_name().to_string_lossy().starts_with(UNFINISHED)) {
        let path = entry.path();
        let Ok(about) = entry.metadata() else { continue };
        let age = about.modified().ok().and_then(|time| time.elapsed().ok());
        let old = age.is_some_and(|age| age > STALE);
        let stale = path.extension().is_none() && (old || is_of_the_dead(&entry.file_name()));
        let free = || fs::File::open(&path).is_ok_and(|open| open.try_lock().is_ok());
        let _ = match (about.is_dir(), about.is_file()) {
            (true, _) if stale && free() => fs::remove_dir_all(&path),
            (_, true) if stale && free() => fs::remove_file(&path),
            _ => Ok(()),
        };
    }
}

/// Prefix of the names of this process's unfinished entries.
pub(super) fn unfinished() -> String {
    format!("{UNFINISHED}{}-", std::process::id())
}

/// Whether this is the name of an unfinished entry whose process no longer exists; false if that is unknown.
fn is_of_the_dead(name: &OsStr) -> bool {
    let name = name.to_string_lossy();
    let id = name.strip_prefix(UNFINISHED).and_then(|rest| rest.split_once('-'));
    let Some(id) = id.and_then(|(id, _)| id.parse::<u32>().ok()) else { return false };
    let processes = Path::new("/proc");
    processes.join("self").exists() && !processes.join(id.to_string()).exists()
}

/// Whether `folder` is part of an output that is not in its place yet.
pub(super) fn is_being_filled(folder: &Path) -> bool {
    register().open.iter().any(|open| folder.starts_with(&open.staging))
}

/// The output folders of this process.
pub(super) struct Register {
    pub open: Vec<Open>,
    pub finished: Vec<PathBuf>,
}

pub(super) struct Open {
    /// Final path.
    pub place: PathBuf,
    pub staging: PathBuf,
    /// Parent folders created for it, innermost first.
    pub parents: Vec<PathBuf>,
    /// Whether something already exists at the place.
    pub stood: bool,
}

static REGISTER: Mutex<Register> = Mutex::new(Register { open: Vec::new(), finished: Vec::new() });

pub(super) fn register() -> MutexGuard<'static, Register> {
    REGISTER.lock().unwrap_or_else(PoisonError::into_inner)
}
