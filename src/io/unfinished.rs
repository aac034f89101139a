//! The folders that this process is filling, so that one that is interrupted can take them away.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

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
