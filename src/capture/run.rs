//! The loop: a frame comes, is looked at, and what the guide says about it is done.

use std::time::{Duration, Instant};

use super::guide::{Command, Event, Guide};
use super::session::Session;
use super::source::{Arrival, LiveFrame, Source};
use super::watch::Watcher;
use crate::error::{Error, Result};
use crate::view::ViewNotes;

/// Who looks on: a screen, or a log.
pub trait Audience {
    /// Something happened.
    fn event(&mut self, event: &Event);

    /// A frame was dealt with.
    fn frame(&mut self, guide: &Guide);

    /// There has been no frame for so long.
    fn waiting(&mut self, guide: &Guide, silence: Duration);

    /// What a person asks for, if anything.
    fn command(&mut self) -> Option<Command>;

    /// Must all end now (Ctrl-C)?
    fn interrupted(&self) -> bool;
}

/// How a capture came to its end.
#[derive(Debug)]
pub enum Ending {
    /// Nothing is wanted any more.
    Complete,
    /// By a key.
    Quit,
    /// By a signal.
    Interrupted,
    /// The source ended before all was taken; `lost` when it was needed still.
    Ended { why: String, lost: bool },
    /// No frame for so long.
    Stalled(Duration),
    /// The disk or the source failed.
    Failed(Error),
}

/// What was done.
#[derive(Debug)]
pub struct Outcome {
    pub ending: Ending,
    /// Views finished in this run, in order.
    pub finished: Vec<String>,
    /// Frames looked at.
    pub frames: usize,
}

/// How long one wait for a frame lasts: keys are answered between two.
const WAIT: Duration = Duration::from_millis(50);

/// Take views until nothing is wanted, or something ends it. Finished views are kept whatever
/// happens; `patience` is how long a stream may stand still.
pub fn capture(
    source: &mut dyn Source,
    session: &mut Session,
    guide: &mut Guide,
    audience: &mut dyn Audience,
    patience: Duration,
) -> Outcome {
    let mut watcher = Watcher::new(source.sensor());
    let mut done = Outcome { ending: Ending::Complete, finished: Vec::new(), frames: 0 };
    let mut last_frame = Instant::now();
    let ending = loop {
        match asked(guide, session, audience, &mut done.finished) {
            Ok(None) => {}
            Ok(Some(ending)) => break ending,
            Err(e) => break Ending::Failed(e),
        }
        let frame = match newest(source, guide.taking().is_some()) {
            Ok(Arrival::Frame(frame)) => frame,
            Ok(Arrival::Nothing) if last_frame.elapsed() > patience => {
                break Ending::Stalled(patience);
            }
            Ok(Arrival::Nothing) => {
                audience.waiting(guide, last_frame.elapsed());
                continue;
            }
            // A signal may have woken the library.
            Ok(Arrival::End(_)) | Err(_) if audience.interrupted() => break Ending::Interrupted,
            Ok(Arrival::End(end)) => break Ending::Ended { why: end.why, lost: end.lost },
            Err(e) => break Ending::Failed(e),
        };
        last_frame = Instant::now();
        done.frames += 1;
        let sight = watcher.look(&frame.depth);
        match follow(guide.see(frame.stamp, sight), &frame, session, audience, &mut done.finished) {
            Ok(false) => audience.frame(guide),
            Ok(true) => {
                audience.frame(guide);
                break Ending::Complete;
            }
            Err(e) => break Ending::Failed(e),
        }
    };
    session.abandon();
    guide.leave("stopped");
    done.ending = ending;
    done
}

/// The next frame; of a live sensor, the newest, unless every one is wanted.
fn newest(source: &mut dyn Source, every: bool) -> Result<Arrival> {
    let mut arrival = source.next(WAIT)?;
    while source.live() && !every && matches!(arrival, Arrival::Frame(_)) {
        match source.next(Duration::ZERO)? {
            Arrival::Nothing => break,
            newer => arrival = newer,
        }
    }
    Ok(arrival)
}

/// Do what was asked for; does that end it?
fn asked(
    guide: &mut Guide,
    session: &mut Session,
    audience: &mut dyn Audience,
    finished: &mut Vec<String>,
) -> Result<Option<Ending>> {
    if audience.interrupted() {
        return Ok(Some(Ending::Interrupted));
    }
    let Some(command) = audience.command() else { return Ok(None) };
    for event in guide.obey(command) {
        match &event {
            Event::Abandoned { .. } => session.abandon(),
            Event::Rejected(view) => {
                session.reject(view)?;
                finished.retain(|v| v != view);
            }
            _ => {}
        }
        audience.event(&event);
    }
    Ok(match command {
        Command::Quit => Some(Ending::Quit),
        _ if guide.wanted().is_done() => Some(Ending::Complete),
        _ => None,
    })
}

/// Do what the events say; true when all is done.
fn follow(
    events: Vec<Event>,
    frame: &LiveFrame,
    session: &mut Session,
    audience: &mut dyn Audience,
    finished: &mut Vec<String>,
) -> Result<bool> {
    let mut done = false;
    for event in &events {
        match event {
            Event::Begun(view) => session.begin(view)?,
            Event::Keep => session.keep(frame)?,
            Event::Finished(view) => {
                session.finish(&ViewNotes::default())?;
                finished.push(view.clone());
            }
            Event::Abandoned { .. } => session.abandon(),
            // Of keys, not of frames.
            Event::Rejected(_) | Event::Drift(_) => {}
            Event::Done => done = true,
        }
        audience.event(event);
    }
    Ok(done)
}
