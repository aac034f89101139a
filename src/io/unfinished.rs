//! The folders that this process is filling, so that one that is interrupted can take them away.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::error::{Error, Result};

/// Beginning of the names of folders that are being filled, and of files that are being written.
pub(super) const UNFINISHED: &str = ".kinoise-";

/// What an interruption found.
#[derive(Debug, Default)]
pub struct Interrupted {
    /// Places that were to be written, and whether something stood there, which still does.
    pub discarded: Vec<(PathBuf, bool)>,
    /// Places that were finished before.
    pub kept: Vec<PathBuf>,
}

/// Throw away all folders that are not whole yet, for a process that ends at once: no other folder
/// can be begun or finished after it.
pub fn discard_unfinished() -> Interrupted {
    let mut register = register();
    let open = std::mem::take(&mut register.open);
    for open in &open {
        // Other threads may still be writing: a file in its place keeps them from making it again.
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

/// Each takes longer than making a folder.
const MAX_ROUNDS: usize = 100;
/// Every thread meets an error of its next write by then, and stops.
const SETTLING: Duration = Duration::from_millis(100);

/// Remove a folder that is not whole, and the folders that were made for it.
pub(super) fn discard(staging: &Path, parents: &[PathBuf]) {
    let _ = fs::remove_dir_all(staging);
    // Fails, rightly, where something else stands in them by now.
    parents.iter().for_each(|parent| drop(fs::remove_dir(parent)));
}

/// Have a folder for this run alone until what is returned is dropped, however the process ends: two
/// would mix their files. An error of these words when another run has it.
pub(crate) fn lock(folder: &Path, [what, remedy]: [&'static str; 2]) -> Result<Option<fs::File>> {
    // Some systems open no folder, and some network disks know no locks.
    let Ok(file) = fs::File::open(folder) else { return Ok(None) };
    match file.try_lock() {
        Err(fs::TryLockError::WouldBlock) => Err(Error::recording(folder, what, remedy)),
        _ => Ok(Some(file)),
    }
}

/// A folder or a file is locked long before, should its process not be known.
const STALE: Duration = Duration::from_secs(60);

/// Remove from `parent` what runs left that were killed: nobody has it locked. What is set aside for
/// somebody has an extension, and stays.
pub fn discard_stale(parent: &Path) {
    // What a name alone lies in.
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

/// How the name of what this process has not finished begins.
pub(super) fn unfinished() -> String {
    format!("{UNFINISHED}{}-", std::process::id())
}

/// Is this the name of what a process had not finished that is no more? Where that cannot be told it is
/// not.
fn is_of_the_dead(name: &OsStr) -> bool {
    let name = name.to_string_lossy();
    let id = name.strip_prefix(UNFINISHED).and_then(|rest| rest.split_once('-'));
    let Some(id) = id.and_then(|(id, _)| id.parse::<u32>().ok()) else { return false };
    let processes = Path::new("/proc");
    processes.join("self").exists() && !processes.join(id.to_string()).exists()
}

/// Is `folder` part of an output that is not in its place yet?
pub(super) fn is_being_filled(folder: &Path) -> bool {
    register().open.iter().any(|open| folder.starts_with(&open.staging))
}

/// The folders of this process.
pub(super) struct Register {
    pub open: Vec<Open>,
    pub finished: Vec<PathBuf>,
}

pub(super) struct Open {
    /// Where it will stand.
    pub place: PathBuf,
    pub staging: PathBuf,
    /// Folders made for it, the innermost first.
    pub parents: Vec<PathBuf>,
    /// Something is at the place already.
    pub stood: bool,
}

static REGISTER: Mutex<Register> = Mutex::new(Register { open: Vec::new(), finished: Vec::new() });

pub(super) fn register() -> MutexGuard<'static, Register> {
    REGISTER.lock().unwrap_or_else(PoisonError::into_inner)
}
