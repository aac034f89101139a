//! Decides what to do with every frame: sightings in, events out, without access to disk or screen.

use super::drift::{Drift, DriftMonitor};
use super::wanted::{Pose, ViewState, Wanted, WantedView};
use super::watch::Sighting;

/// Largest movement that counts as still, root mean square of inverse depth, 1/m: two thirds of a step of a
/// Kinect's raw values, 2 mm at 1 m and 8 mm at 2 m.
const MAX_STILL_PER_M: f64 = 0.002;

/// How views are taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shutter {
    /// Frames per view.
    pub frames: usize,
    /// Frames for which the target must have been still before a view begins.
    pub hold: usize,
}

/// What to do with a frame, and what to report.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// A view begins with this frame.
    Begun(String),
    /// This frame belongs to the view.
    Keep,
    /// The view is complete.
    Finished(String),
    /// The view must be discarded.
    Abandoned { view: String, why: String },
    /// A complete view must be discarded at the user's request, and is wanted again.
    Rejected(String),
    /// The plane was watched long enough for a drift estimate.
    Drift(Drift),
    /// No more views are wanted.
    Done,
}

/// A user command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Command {
    /// Discard the last view and take it again.
    Again,
    /// Give up the view being taken or, if there is none, the suggested one.
    Skip,
    /// End the capture.
    Quit,
}

/// The state of a capture between two frames.
pub struct Guide {
    wanted: Wanted,
    shutter: Shutter,
    sighting: Result<Sighting, String>,
    /// Where the target came to rest, and for how many frames it has been still.
    still: Option<(Sighting, usize)>,
    taking: Option<Taking>,
    /// Indices of the suggested view and of the one finished last.
    suggestion: Option<usize>,
    last: Option<usize>,
    drift: DriftMonitor,
}

#[derive(Clone, Copy)]
struct Taking {
    view: usize,
    kept: usize,
    /// Whether it was added for this pose; if so, it is removed if it fails.
    new: bool,
}

impl Guide {
    pub fn new(wanted: Wanted, shutter: Shutter) -> Self {
        let suggestion = wanted.suggestion(None);
        Guide {
            wanted,
            shutter,
            sighting: Err("no frame yet".into()),
            still: None,
            taking: None,
            suggestion,
            last: None,
            drift: DriftMonitor::default(),
        }
    }

    /// Processes one frame, as the watcher saw it.
    pub fn see(&mut self, stamp: f64, sighting: Result<Sighting, String>) -> Vec<Event> {
        let mut events = Vec::new();
        self.sighting = sighting;
        if !self.is_still() {
            let why = self.sighting.clone().err().unwrap_or_else(|| "the target moved".into());
            events.extend(self.abandon(&why));
        }
        if let Ok(seen) = &self.sighting {
            events.extend(self.drift.add(stamp, seen.plane.q.z).map(Event::Drift));
        }
        self.shoot(&mut events);
        self.suggest();
        if self.wanted.is_done() && self.taking.is_none() {
            events.push(Event::Done);
        }
        events
    }

    /// Whether the target is where it was; if not, stillness starts anew.
    fn is_still(&mut self) -> bool {
        if let (Ok(seen), Some((anchor, frames))) = (&self.sighting, &mut self.still)
            && seen.moved_since(anchor) < MAX_STILL_PER_M
        {
            *frames += 1;
            return true;
        }
        self.still = self.sighting.clone().ok().map(|seen| (seen, 1));
        self.drift = DriftMonitor::default();
        false
    }

    fn shoot(&mut self, events: &mut Vec<Event>) {
        if self.taking.is_none() {
            self.taking = self.begin();
            events.extend(self.taking.map(|t| Event::Begun(self.name(t.view))));
        }
        let Some(taking) = &mut self.taking else { return };
        taking.kept += 1;
        events.push(Event::Keep);
        if taking.kept >= self.shutter.frames {
            let view = taking.view;
            (self.taking, self.last) = (None, Some(view));
            self.wanted.views[view].state = ViewState::Taken;
            events.push(Event::Finished(self.name(view)));
        }
    }

    /// Begins a view if the target has been still long enough at a wanted pose.
    fn begin(&mut self) -> Option<Taking> {
        let pose = self.pose()?;
        if self.held() < self.shutter.hold {
            return None;
        }
        let before = self.wanted.views.len();
        let view = self.wanted.claim(&pose)?;
        Some(Taking { view, kept: 0, new: self.wanted.views.len() > before })
    }

    /// Abandons the view being taken, if there is one.
    fn abandon(&mut self, why: &str) -> Option<Event> {
        let taking = self.taking.take()?;
        let view = self.name(taking.view);
        if taking.new {
            self.wanted.views.pop();
        }
        Some(Event::Abandoned { view, why: why.into() })
    }

    /// Keeps a suggestion until it is taken or another is much nearer, so that the advice does not flicker.
    fn suggest(&mut self) {
        let pose = self.pose();
        let best = self.wanted.suggestion(pose.as_ref());
        let open = |i: Option<usize>| self.wanted.views.get(i?).filter(|v| v.is_open());
        let keep = match (open(self.suggestion), open(best), pose) {
            (Some(_), Some(_), None) => true,
            (Some(old), Some(new), Some(pose)) => old.distance(&pose) < 2.0 * new.distance(&pose),
            _ => false,
        };
        if !keep {
            self.suggestion = best;
        }
    }

    /// Executes a user command; the events say what must be undone.
    pub fn obey(&mut self, command: Command) -> Vec<Event> {
        match command {
            Command::Again => self.again(),
            Command::Skip => self.skip().into_iter().collect(),
            Command::Quit => self.leave().into_iter().collect(),
        }
    }

    /// Ends the capture: an incomplete view is abandoned.
    pub fn leave(&mut self) -> Option<Event> {
        self.abandon("stopped")
    }

    fn again(&mut self) -> Vec<Event> {
        let Some(last) = self.last.take() else { return Vec::new() };
        let mut events = Vec::from_iter(self.abandon("the one before comes first"));
        self.wanted.views[last].state = ViewState::Open;
        self.suggestion = Some(last);
        // The target must settle anew before it is taken again.
        self.still = None;
        events.push(Event::Rejected(self.name(last)));
        events
    }

    fn skip(&mut self) -> Option<Event> {
        let taking = self.taking.take();
        let view = taking.map(|t| t.view).or(self.suggestion)?;
        self.wanted.views.get_mut(view)?.state = ViewState::Skipped;
        self.suggest();
        let view = self.name(view);
        taking.map(|_| Event::Abandoned { view, why: "skipped".into() })
    }

    fn name(&self, view: usize) -> String {
        self.wanted.views[view].name.clone()
    }

    /// The wanted views and their states.
    pub fn wanted(&self) -> &Wanted {
        &self.wanted
    }

    /// The last frame's target, or why there is none.
    pub fn sighting(&self) -> &Result<Sighting, String> {
        &self.sighting
    }

    /// Pose of the target, if it is seen.
    pub fn pose(&self) -> Option<Pose> {
        self.sighting.as_ref().ok().map(Sighting::pose)
    }

    /// Number of frames for which it has been still.
    pub fn held(&self) -> usize {
        self.still.as_ref().map_or(0, |(_, frames)| *frames)
    }

    /// How far it has moved since it came to rest, as a change of depth, m.
    pub fn moved_m(&self) -> Option<f64> {
        let (Ok(seen), Some((anchor, _))) = (&self.sighting, &self.still) else { return None };
        Some(seen.moved_since(anchor) * seen.pose().z_m.powi(2))
    }

    /// The view being taken, and the number of its frames so far.
    pub fn taking(&self) -> Option<(&str, usize)> {
        self.taking.map(|t| (self.wanted.views[t.view].name.as_str(), t.kept))
    }

    /// The wanted view to go to next.
    pub fn suggestion(&self) -> Option<&WantedView> {
        self.wanted.views.get(self.suggestion?)
    }

    pub fn shutter(&self) -> Shutter {
        self.shutter
    }

    /// Drift during the current still period.
    pub fn drift(&self) -> Option<Drift> {
        self.drift.drift()
    }
}

#[cfg(test)]
mod tests;
