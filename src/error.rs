//! The library's error type: what went wrong, where, and what to do about it.

use std::path::{Path, PathBuf};

/// Every failure the library reports. `Display` is one line that a person can act on: where
/// (`path`, `line`, `view`), what is wrong there (`what`, `cause`, `why`), what to do (`remedy`).
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused to read or write.
    ///
    /// The message includes the cause, so it is not also the [`std::error::Error::source`]: printing the
    /// chain would repeat it.
    #[error("{}: {cause}; {remedy}", path.display())]
    Io { path: PathBuf, cause: std::io::Error, remedy: &'static str },
    /// A line of a text file (JSON, `depth.txt`, a table) that cannot be parsed; 0 means the whole file.
    #[error("{}{}: {what}; {remedy}", path.display(), at_line(*line))]
    Text { path: PathBuf, line: usize, what: String, remedy: &'static str },
    /// A file or folder that is damaged, contradicts itself, or is not of the expected kind.
    #[error("{}: {what}; {remedy}", path.display())]
    Recording { path: PathBuf, what: String, remedy: &'static str },
    /// A view in which no target plane can be found.
    #[error("view {view}: {what}; {remedy}")]
    View { view: String, what: String, remedy: &'static str },
    /// Too little, or too uniform, to fit what was asked for.
    #[error("{what}; {remedy}")]
    NotEnough { what: String, remedy: String },
    /// An option or argument outside its range.
    #[error("{what}; {remedy}")]
    Argument { what: String, remedy: &'static str },
    /// A live sensor that is not available.
    #[error("{what}; {remedy}")]
    Sensor { what: String, remedy: &'static str },
    /// A picture or page could not be drawn.
    #[error("{what}: drawing failed: {why}")]
    Drawing { what: &'static str, why: String },
    /// The numerical solver gave up; the data are usually the reason.
    #[error("fit: {what}; {remedy}")]
    Solver { what: String, remedy: &'static str },
}

pub type Result<T, E = Error> = std::result::Result<T, E>;

fn at_line(line: usize) -> String {
    if line == 0 { String::new() } else { format!(", line {line}") }
}

impl Error {
    pub fn read(path: &Path, cause: std::io::Error) -> Self {
        let remedy = "check that the path is right and readable";
        Error::Io { path: path.to_path_buf(), cause, remedy }
    }

    pub fn write(path: &Path, cause: std::io::Error) -> Self {
        use std::io::ErrorKind::{FileTooLarge, QuotaExceeded, StorageFull};
        let remedy = match cause.kind() {
            StorageFull | QuotaExceeded => {
                "make room on that disk, then give the same command again"
            }
            FileTooLarge => {
                "raise the limit of files' sizes (ulimit -f), then give the same command again"
            }
            _ => "choose a folder that can be written (-o of most commands)",
        };
        Error::Io { path: path.to_path_buf(), cause, remedy }
    }

    /// Adds the file or folder to a message that names none.
    pub fn of(self, path: &Path) -> Self {
        let named = |what: String| format!("{}: {what}", path.display());
        match self {
            Error::Argument { what, remedy } => Error::Argument { what: named(what), remedy },
            Error::NotEnough { what, remedy } => Error::NotEnough { what: named(what), remedy },
            Error::Solver { what, remedy } => Error::Solver { what: named(what), remedy },
            named => named,
        }
    }

    pub(crate) fn text(
        path: &Path,
        line: usize,
        what: impl Into<String>,
        remedy: &'static str,
    ) -> Self {
        Error::Text { path: path.to_path_buf(), line, what: what.into(), remedy }
    }

    pub fn recording(path: &Path, what: impl Into<String>, remedy: &'static str) -> Self {
        Error::Recording { path: path.to_path_buf(), what: what.into(), remedy }
    }

    pub(crate) fn sensor(what: impl Into<String>, remedy: &'static str) -> Self {
        Error::Sensor { what: what.into(), remedy }
    }
}
