//! One capture at a time in a recording.

use std::fs::File;
use std::path::Path;

use crate::error::{Error, Result};

/// Held until dropped; the system lets go of it however the process ends.
pub struct Lock {
    _folder: Option<File>,
}

impl Lock {
    /// Lock a folder. Where folders cannot be locked (some network disks, systems without
    /// `flock`) nothing is held.
    ///
    /// # Errors
    /// When another process holds it.
    pub fn hold(root: &Path) -> Result<Self> {
        let Ok(folder) = File::open(root) else { return Ok(Lock { _folder: None }) };
        match system::lock(&folder) {
            Held::Ours => Ok(Lock { _folder: Some(folder) }),
            Held::Never => Ok(Lock { _folder: None }),
            Held::Others => Err(Error::recording(
                root,
                "another capture is writing into it",
                "end that one first (q, or Ctrl-C), or choose a new folder",
            )),
        }
    }
}

/// What came of asking.
#[cfg_attr(not(unix), expect(dead_code, reason = "only flock can tell"))]
enum Held {
    Ours,
    Others,
    Never,
}

#[cfg(unix)]
mod system {
    use std::fs::File;
    use std::io::{Error, ErrorKind};
    use std::os::fd::AsRawFd;

    use super::Held;

    pub fn lock(folder: &File) -> Held {
        // SAFETY: the descriptor is open as long as the borrow.
        let code = unsafe { libc::flock(folder.as_raw_fd(), libc::LOCK_EX | libc::LOCK_NB) };
        match Error::last_os_error().kind() {
            _ if code == 0 => Held::Ours,
            ErrorKind::WouldBlock => Held::Others,
            _ => Held::Never,
        }
    }
}

#[cfg(not(unix))]
mod system {
    pub fn lock(_: &std::fs::File) -> super::Held {
        super::Held::Never
    }
}
