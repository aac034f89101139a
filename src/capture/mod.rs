//! Takes views from a running sensor and guides the user to those that are still wanted.
//!
//! ```text
//! Source -> LiveFrame -> Watcher -> Sighting -> Guide -> Event -> Session (disk), Interface (people)
//! ```
//! A [`Source`] is a Kinect through libfreenect, a folder that another program fills, or a
//! recording that is played back. The [`Guide`] is a pure state machine; a view on the disk is
//! whole or not there, so a capture resumes where it was interrupted.

mod advice;
mod advised;
mod drift;
mod folder;
mod freenect;
mod guide;
mod play;
mod run;
mod screen;
mod session;
mod source;
mod wanted;
mod watch;

pub use advice::far_side;
pub use drift::Drift;
pub use folder::Growing;
pub use freenect::{FreenectOptions, FreenectSource};
pub use guide::{Command, Event, Guide, Shutter};
pub use play::Playback;
pub use run::{Ending, Interface, Outcome, capture};
pub use screen::{Line, Status, Style, render};
pub use session::Session;
pub use source::{Arrival, End, LiveFrame, Source};
pub use wanted::{PAPER_DISTANCES_M, PAPER_TILTS_DEG, Pose, ViewState, Wanted, WantedView};
pub use watch::{Sighting, Watcher};
