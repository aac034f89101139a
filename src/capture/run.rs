//! The capture loop: takes a frame, analyses it, and does what the guide decides.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::guide::{Command, Event, Guide};
use super::session::Session;
use super::source::{Arrival, End, LiveFrame, Source};
use super::watch::Watcher;
use crate::error::{Error, Result};
use crate::view::ViewNotes;

/// User interface of a capture: a screen with keys, or a log.
pub trait Interface {
    /// Something happened that the guide already knows of.
    fn event(&mut self, event: &Event, guide: &Guide);

    /// A frame was processed.
    fn frame(&mut self, _guide: &Guide) {}

    /// No frame has arrived for this long.
    fn waiting(&mut self, _guide: &Guide, _silence: Duration) {}

    /// The next user command, if any.
    fn command(&mut self) -> Option<Command> {
        None
    }
}

/// How a capture ended.
#[derive(Debug)]
pub enum Ending {
    /// No more views are wanted.
    Complete,
    /// By a key.
    Quit,
    /// By a signal.
    Interrupted,
    /// The source ended before all views were taken.
    Ended(End),
    /// No frame arrived for this long.
    Stalled(Duration),
    /// The disk failed.
    Failed(Error),
}

/// Result of a capture.
#[derive(Debug)]
pub struct Outcome {
    pub ending: Ending,
    /// Views finished in this run, in order.
    pub finished: Vec<String>,
    /// Frames processed.
    pub frames: usize,
}

/// Duration of one wait for a frame; keys are answered between waits.
const WAIT: Duration = Duration::from_millis(50);

/// Takes views until none is wanted or something ends the capture, such as `stop` (Ctrl-C). Finished views
/// are always kept; `patience` is how long a stream may stall.
pub fn capture(
    source: &mut dyn Source,
    session: &mut Session,
    guide: &mut Guide,
    interface: &mut dyn Interface,
    patience: Duration,
    stop: &AtomicBool,
) -> Outcome {
    let watcher = Watcher::new(source.sensor());
    let last_frame = Instant::now();
    let (finished, frames) = (Vec::new(), 0);
    let mut run = Run { session, guide, interface, watcher, last_frame, finished, frames };
    let stopped = || stop.load(Ordering::Relaxed);
    let ending = loop {
        if stopped() {
            break Ending::Interrupted;
        }
        match run.step(source, patience) {
            Ok(None) => {}
            // A signal may have interrupted the library.
            Ok(Some(Ending::Ended(_))) if stopped() => break Ending::Interrupted,
            Ok(Some(ending)) => break ending,
            Err(e) => break Ending::Failed(e),
        }
    };
    let Run { session, guide, finished, frames, .. } = run;
    session.abandon();
    guide.leave();
    Outcome { ending, finished, frames }
}

struct Run<'a> {
    session: &'a mut Session,
    guide: &'a mut Guide,
    interface: &'a mut dyn Interface,
    watcher: Watcher,
    last_frame: Instant,
    finished: Vec<String>,
    frames: usize,
}

impl Run<'_> {
    /// Handles a key, then a frame. Returns the ending if either ends the capture.
    fn step(&mut self, source: &mut dyn Source, patience: Duration) -> Result<Option<Ending>> {
        if let Some(command) = self.interface.command() {
            let events = self.guide.obey(command);
            self.act(&events, None)?;
            if command == Command::Quit {
                return Ok(Some(Ending::Quit));
            }
            if self.guide.wanted().is_done() {
                return Ok(Some(Ending::Complete));
            }
        }
        let arrival = newest(source, self.guide.taking().is_some());
        let silence = self.last_frame.elapsed();
        match arrival {
            Arrival::Frame(frame) => return self.look(&frame),
            Arrival::End(end) => return Ok(Some(Ending::Ended(end))),
            Arrival::Nothing if silence > patience => return Ok(Some(Ending::Stalled(patience))),
            Arrival::Nothing => self.interface.waiting(self.guide, silence),
        }
        Ok(None)
    }

    fn look(&mut self, frame: &LiveFrame) -> Result<Option<Ending>> {
        self.last_frame = Instant::now();
        self.frames += 1;
        let sighting = self.watcher.look(&frame.depth);
        let events = self.guide.see(frame.stamp, sighting);
        self.act(&events, Some(frame))?;
        self.interface.frame(self.guide);
        Ok(events.contains(&Event::Done).then_some(Ending::Complete))
    }

    /// Carries out the events.
    fn act(&mut self, events: &[Event], frame: Option<&LiveFrame>) -> Result<()> {
        for event in events {
            match event {
                Event::Begun(view) => self.session.begin(view)?,
                Event::Keep => frame.map_or(Ok(()), |frame| self.session.keep(frame))?,
                Event::Finished(view) => {
                    self.session.finish(&ViewNotes::default())?;
                    self.finished.push(view.clone());
                }
                Event::Abandoned { .. } => self.session.abandon(),
                Event::Rejected(view) => {
                    self.session.reject(view)?;
                    self.finished.retain(|v| v != view);
                }
                Event::Drift(_) | Event::Done => {}
            }
            self.interface.event(event, self.guide);
        }
        Ok(())
    }
}

/// The next frame; from a live sensor the newest, unless `every` frame is wanted.
fn newest(source: &mut dyn Source, every: bool) -> Arrival {
    let mut arrival = source.next(WAIT);
    while source.live() && !every && matches!(arrival, Arrival::Frame(_)) {
        match source.next(Duration::ZERO) {
            Arrival::Nothing => break,
            newer => arrival = newer,
        }
    }
    arrival
}
