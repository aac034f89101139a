//! Concealed recordings by ray geometry: a ray meets the board, the projector sees the same point
//! at another column, the matched column errs, and the depth is triangulated back.
//!
//! One cause acts in one place of that path ([`Act`]) and carries its truth ([`Label`]).

mod advised;
pub(super) mod borrow;
mod cameras;
mod causes_bias;
mod causes_driver;
mod causes_missing;
mod causes_noise;
mod causes_variance;
mod choices;
mod exam;
mod eye;
mod gate;
mod geometry;
mod ground;
mod kernels;
mod nats;
mod outside;
mod poses;
pub mod question;
mod sealed;
mod sets;
mod shoot;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod tests_nats;
#[cfg(test)]
pub(super) mod tests_sealed;
mod trace;
mod weigh;
mod write;

pub use cameras::Unit;
pub use choices::CATALOGUE;
pub use geometry::{Board, Site, Stage};
pub use outside::OUTSIDE;
pub use sealed::seal;
pub use sets::{Order, Set};
#[cfg(test)]
pub(super) use shoot::Still;
pub use trace::Trace;
pub use write::write;

pub use question::Cell;

use kinoise::rng::Seed;

/// What a view's causes may look at beside the pixel.
pub struct Facts<'a> {
    /// The view's number.
    pub view: usize,
    pub stage: &'a Stage,
    /// Since the session began, s.
    pub session_s: f64,
    /// Light of the room, lx.
    pub lux: f64,
    pub temperature_c: f64,
}

/// Which frame, for causes that are fresh in each.
#[derive(Debug, Clone, Copy)]
pub struct Clock {
    pub seed: Seed,
    pub view: usize,
    /// Negative before the first frame that is kept.
    pub frame: i64,
    /// Since the view's first frame, s.
    pub view_s: f64,
    pub width: usize,
}

/// The order in which noise of unit variance is shaped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    InTime,
    AtRest,
    InSpace,
    Tails,
}

impl Phase {
    pub const ALL: [Phase; 4] = [Phase::InTime, Phase::AtRest, Phase::InSpace, Phase::Tails];
}

/// Disparity that whole rows and columns of one frame share, px.
pub struct Shake {
    pub rows: Vec<f32>,
    pub columns: Vec<f32>,
}

type AtSite = Box<dyn Fn(&Site, &Facts<'_>) -> f64 + Send + Sync>;
type Shaker = Box<dyn Fn(&Clock, &mut Shake) + Send + Sync>;
type Reshape = Box<dyn Fn(&mut [f32], &Clock) + Send + Sync>;

/// Where in the path a cause acts, and how.
pub enum Act {
    /// The ray a pixel looks along instead of (x, y, 1).
    Ray(Box<dyn Fn(f64, f64) -> (f64, f64) + Send + Sync>),
    /// Rise of the board towards the sensor at a place on it, m.
    Lift(Box<dyn Fn([f64; 2]) -> f64 + Send + Sync>),
    /// How far along its normal the board has gone, m.
    Move(Box<dyn Fn(&Clock) -> f64 + Send + Sync>),
    /// Error of the matched column, px of disparity.
    Mismatch(AtSite),
    /// Factor on sigma.
    Spread(AtSite),
    /// Standard deviation of where a pixel looks, px.
    Wander(f64),
    Grain(Phase, Reshape),
    Shake(Shaker),
    /// Probability of no answer.
    Loss(AtSite),
    /// Disparities that occur: `step` px apart, one of them at `phase` steps.
    Lattice {
        step: f64,
        phase: f64,
    },
    /// Factor on the stored depth.
    Gain(AtSite),
    /// Depth is cut down to whole steps, m.
    Floor(f64),
}

impl Act {
    fn mismatch(f: impl Fn(&Site, &Facts<'_>) -> f64 + Send + Sync + 'static) -> Self {
        Act::Mismatch(Box::new(f))
    }

    fn spread(f: impl Fn(&Site, &Facts<'_>) -> f64 + Send + Sync + 'static) -> Self {
        Act::Spread(Box::new(f))
    }

    fn loss(f: impl Fn(&Site, &Facts<'_>) -> f64 + Send + Sync + 'static) -> Self {
        Act::Loss(Box::new(f))
    }

    fn gain(f: impl Fn(&Site, &Facts<'_>) -> f64 + Send + Sync + 'static) -> Self {
        Act::Gain(Box::new(f))
    }

    fn grain(phase: Phase, f: impl Fn(&mut [f32], &Clock) + Send + Sync + 'static) -> Self {
        Act::Grain(phase, Box::new(f))
    }

    fn shake(f: impl Fn(&Clock, &mut Shake) + Send + Sync + 'static) -> Self {
        Act::Shake(Box::new(f))
    }
}

/// The sealed truth of one cause.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Label {
    /// As in the catalogue; `None` for what the catalogue lacks.
    pub id: Option<&'static str>,
    /// The formula that was used, in a word.
    pub form: &'static str,
    pub statistic: &'static str,
    pub axis: &'static str,
    /// Axes on which it shows as well.
    pub also: &'static [&'static str],
    pub interval: Option<[f64; 2]>,
    pub parameters: serde_json::Map<String, serde_json::Value>,
}

impl Label {
    fn new(
        id: Option<&'static str>,
        form: &'static str,
        [statistic, axis]: [&'static str; 2],
        parameters: &[(&str, f64)],
    ) -> Self {
        let parameters = parameters.iter().map(|(k, v)| ((*k).into(), (*v).into())).collect();
        Label { id, form, statistic, axis, also: &[], interval: None, parameters }
    }

    fn within(self, low: f64, high: f64) -> Self {
        Label { interval: Some([low, high]), ..self }
    }

    fn also(self, also: &'static [&'static str]) -> Self {
        Label { also, ..self }
    }
}

/// One thing that was left out of the model.
pub struct Cause {
    pub label: Label,
    pub act: Act,
    /// How its information is counted.
    pub trace: Trace,
}

impl Cause {
    fn new(label: Label, act: Act) -> Self {
        Cause { label, act, trace: Trace::Field }
    }

    fn tracing(self, trace: Trace) -> Self {
        Cause { trace, ..self }
    }
}
