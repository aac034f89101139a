//! Views taken from a running sensor, guided to those that are still wanted.
//!
//! ```text
//! Source -> LiveFrame -> Watcher -> Seen -> Guide -> Event -> Session (disk), Audience (people)
//! ```
//! A [`Source`] is a Kinect through libfreenect, a folder that another program fills, or a
//! recording that is played. The [`Guide`] is a pure state machine; a view on the disk is whole
//! or not there, so a capture goes on where it was interrupted.

mod advice;
mod advised;
mod folder;
mod font;
mod freenect;
mod guide;
#[cfg(test)]
mod guide_tests;
mod lock;
mod play;
mod queue;
mod run;
mod screen;
mod session;
mod source;
mod wanted;
mod warmth;
mod watch;

pub use advice::Step;
pub use folder::Growing;
pub use freenect::{FreenectOptions, FreenectSource};
pub use guide::{Command, Event, Guide, Shutter};
pub use play::Playback;
pub use queue::Queued;
pub use run::{Audience, Ending, Outcome, capture};
pub use screen::{Line, Style, Surroundings, render};
pub use session::Session;
pub use source::{Arrival, End, LiveFrame, Source};
pub use wanted::{Pose, Tolerance, ViewState, Wanted, WantedView};
pub use warmth::{Drift, Warmth};
pub use watch::{Seen, Watcher};
