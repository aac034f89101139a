//! Files that hold a film: ROS bags (.bag, .mcap, .db3) and NumPy stacks (.npy, .npz).
//!
//! A film in a file is processed like a folder of images. [`open`] returns [`Footage`] and a [`Sensor`], as
//! the readers of `folder.rs` do, and everything after it (cutting into still views, measuring, mapping,
//! correcting) takes its frames one at a time. Only the location of the pixels differs: a
//! [`FrameRef`](crate::view::FrameRef) names the file and, in `within`, a
//! [`FrameStore`](crate::view::FrameStore) and a number.
//!
//! ```text
//! ros1.rs  mcap.rs  db3.rs          the formats: where each message starts, and its bytes    (bag.rs: Bag)
//!     \      |      /
//!      blocks.rs                    lengths checked against the file; chunks decompressed, a few cached
//! messages.rs on wire.rs            a message's fields, in ROS 1 and CDR serialisation
//! pixels.rs                         an image's depths: 16UC1, 32FC1, compressedDepth
//! topics.rs camera.rs (lens.rs)      which topic holds the depth, and its camera;
//! realsense.rs                      in librealsense's own recordings, its device
//! film.rs                           a topic as a FrameStore
//! stack.rs on npy.rs, npz.rs        arrays in place of messages
//! scale.rs                          16-bit words for float depths
//! ```
//!
//! Memory holds an index (a position and a time for each message of the types that are read), a few
//! decompressed chunks and the frames in use, whatever the length of the file. Lengths that a file claims are
//! checked against its size before they are used. A file that is truncated or has no index is refused, with
//! the name of the tool that repairs it: part of a film is not what was recorded.

mod bag;
mod blocks;
mod camera;
#[cfg(feature = "db3")]
mod db3;
mod film;
mod lens;
mod mcap;
mod messages;
mod npy;
mod npz;
mod pixels;
mod realsense;
mod ros1;
mod scale;
mod stack;
mod topics;
mod wire;

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::assumed::Assumed;
use super::layout::DESCRIPTIONS;
use super::output::entries;
use super::stills::Footage;
use crate::error::{Error, Result};
use crate::view::Sensor;

/// Detected from the first bytes: names can be wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Ros1,
    Mcap,
    Db3,
    Npy,
    Npz,
}

/// Magic bytes of each kind, and the file extension that promises it, so that a damaged file
/// is not taken for something else.
const KINDS: [(&[u8], &str, Kind); 5] = [
    (b"#ROSBAG V", "bag", Kind::Ros1),
    (b"\x89MCAP0\r\n", "mcap", Kind::Mcap),
    (b"SQLite format 3\0", "db3", Kind::Db3),
    (b"\x93NUMPY", "npy", Kind::Npy),
    (b"PK\x03\x04", "npz", Kind::Npz),
];

impl Kind {
    fn of(path: &Path) -> Option<Self> {
        let mut first = [0; 16];
        let mut file = path.is_file().then(|| File::open(path).ok()).flatten()?;
        let n = file.read(&mut first).ok()?;
        let begins = |(magic, ..): &&(&[u8], &str, Kind)| first[..n].starts_with(magic);
        let named = |(_, name, _): &&(&[u8], &str, Kind)| {
            path.extension().is_some_and(|e| e.eq_ignore_ascii_case(name))
        };
        let known = KINDS.iter().find(begins).or_else(|| KINDS.iter().find(named));
        known.map(|(.., kind)| *kind)
    }
}

/// A rosbag2 folder stands for the file in it.
const METADATA: &str = "metadata.yaml";

pub(super) fn is_one(path: &Path) -> bool {
    let described = || DESCRIPTIONS.iter().any(|name| path.join(name).is_file());
    Kind::of(path).is_some() || path.join(METADATA).is_file() && !described()
}

/// The only bag in a rosbag2 folder.
fn bag_in(folder: &Path) -> Result<PathBuf> {
    let mut bags = entries(folder)?;
    bags.retain(|path| matches!(Kind::of(path), Some(Kind::Mcap | Kind::Db3)));
    match &bags[..] {
        [only] => Ok(only.clone()),
        _ => {
            let what = format!("{} bags are in this folder of rosbag2", bags.len());
            let remedy = "give the file itself; parts of a recording: ros2 bag convert makes one";
            Err(Error::recording(folder, what, remedy))
        }
    }
}

/// Opens the film in a file and describes the sensor that took it. A film of floats is scanned completely,
/// because its depths decide how it is stored. Fails if the file is damaged or lacks required information.
pub(super) fn open(path: &Path, assumed: &Assumed) -> Result<(Footage, Sensor)> {
    match Kind::of(path) {
        None if path.is_dir() => open(&bag_in(path)?, assumed),
        Some(Kind::Mcap) => film::open(mcap::Mcap::open(path)?, assumed),
        #[cfg(feature = "db3")]
        Some(Kind::Db3) => film::open(db3::Db3::open(path)?, assumed),
        #[cfg(not(feature = "db3"))]
        Some(Kind::Db3) => Err(Error::recording(
            path,
            "this kinoise was built without SQLite",
            "build it with the feature db3, or convert the bag: ros2 bag convert to mcap",
        )),
        Some(Kind::Ros1) => film::open(ros1::Ros1Bag::open(path)?, assumed),
        Some(Kind::Npy) => stack::open_npy(path, assumed),
        Some(Kind::Npz) => stack::open_npz(path, assumed),
        None => Err(Error::recording(
            path,
            "no bag and no stack",
            "give a .bag, .mcap, .db3, .npy or .npz file",
        )),
    }
}
