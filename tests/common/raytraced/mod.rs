//! Concealed recordings by ray geometry: a ray meets the board, the projector sees the same point at another
//! column, the matched column errs, and the depth is triangulated back.
//!
//! A cause acts at one place of that path ([`Act`]), says what it is ([`question::Hidden`]) and what knowing
//! it is worth ([`Worth`]). No formula is shared with the library's effects, simulators or diagnosis.

mod causes_bias;
mod causes_noise;
pub mod choices;
mod confine;
mod exam;
pub mod eye;
pub mod geometry;
pub mod kernels;
pub mod nats;
mod outside;
pub mod poses;
pub mod question;
mod set;
pub mod shoot;
#[cfg(test)]
pub mod tests;
#[cfg(test)]
mod tests_nats;
mod unit;
pub mod weigh;
mod worth;
pub mod write;

pub use choices::CATALOGUE;
pub use outside::OUTSIDE;
pub use question::Cell;
pub use set::{Order, Set};
pub use unit::Unit;
pub use write::{conceal, write};

use confine::Gate;
use eye::Site;
use kernels::Window;
use kinoise::rng::{Seed, Stream};
use nats::Ground;
use poses::Plan;
use question::Hidden;

/// A frame, for causes that are drawn anew in each.
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

impl Clock {
    /// Random numbers of this frame for one purpose.
    pub fn stream(&self, what: &str) -> Stream {
        self.seed.stream(&format!("rays/{what}/{}/{}", self.view, self.frame))
    }
}

/// Order in which noise of unit variance is shaped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Phase {
    InTime,
    AtRest,
    InSpace,
    Tails,
}

/// Disparity that each row of one frame adds, px.
pub type Rows = [f32];

type AtSite = Box<dyn Fn(&Site, &Plan) -> f64 + Send + Sync>;

type Reshape = Box<dyn Fn(&mut [f32], &Clock) + Send + Sync>;
type Shaker = Box<dyn Fn(&Clock, &mut Rows) + Send + Sync>;

/// Where in the path a cause acts, and how.
pub enum Act {
    /// The ray a pixel looks along instead of (x, y, 1).
    Ray(Box<dyn Fn(f64, f64) -> (f64, f64) + Send + Sync>),
    /// Height of the board towards the sensor at a position on it, m.
    Lift(Box<dyn Fn([f64; 2]) -> f64 + Send + Sync>),
    /// Displacement of the board along its normal since the view's first frame, s to m.
    Move(Box<dyn Fn(f64) -> f64 + Send + Sync>),
    /// Error of the matched column, px of disparity.
    Mismatch(AtSite),
    /// Factor on sigma.
    Spread(AtSite),
    /// Standard deviation of a pixel's viewing direction, px.
    Wander(f64),
    /// Shapes a frame's noise of unit variance.
    Grain(Phase, Reshape),
    /// Adds to the error shared by a row's pixels.
    Shake(Shaker),
    /// Probability of no answer.
    Loss(AtSite),
    /// Disparities that occur: `step` px apart, with one at `phase` steps.
    Lattice { step: f64, phase: f64 },
    /// Factor on the stored depth.
    Gain(AtSite),
    /// Truncates depth to whole steps, m.
    Floor(f64),
}

/// How the worth of knowing a cause is computed, nats.
pub enum Worth {
    /// From noise-free views with and without the cause.
    Seen,
    /// By a formula, for causes that show in neither a mean nor a spread.
    Formula(Box<dyn Fn(&Ground<'_>) -> f64 + Send + Sync>),
    /// No strength makes it weak: values that do not occur are seen or not seen, whatever the noise.
    Never,
}

/// One cause, known to the model or left out of it.
pub struct Cause {
    pub label: Hidden,
    pub act: Act,
    worth: Worth,
    /// Window that filters the noise, and the share of the variance that goes through it.
    window: Option<(Window, f64)>,
    /// Where it acts; `None` for everywhere.
    only: Option<Gate>,
}

/// Context in which a cause is drawn.
#[derive(Clone, Copy)]
pub struct Draw<'a> {
    /// 1 is the middle of what real units show.
    pub strength: f64,
    /// Share of a shadow's pixels that have no answer.
    pub shadow: f64,
    pub unit: &'a Unit,
    /// Half the board's width, m.
    pub half_m: f64,
    pub seed: Seed,
}

impl Cause {
    fn new(
        name: &str,
        form: &str,
        [statistic, axis]: [&str; 2],
        parameters: &[(&str, f64)],
        act: Act,
    ) -> Self {
        let names: &[&str] = if CATALOGUE.contains(&name) { &[name] } else { &[] };
        let mut label = Hidden::new(names, form, [statistic, axis]);
        label.parameters = parameters.iter().map(|(k, v)| ((*k).into(), (*v).into())).collect();
        Cause { label, act, worth: Worth::Seen, window: None, only: None }
    }

    /// Limits where it shows on its axis.
    fn within(mut self, low: f64, high: f64) -> Self {
        self.label.interval = Some([low, high]);
        self
    }

    /// Adds axes on which it shows as well.
    fn also(mut self, axes: &[&str]) -> Self {
        self.label.also = axes.iter().map(ToString::to_string).collect();
        self
    }

    fn worth(self, formula: impl Fn(&Ground<'_>) -> f64 + Send + Sync + 'static) -> Self {
        Cause { worth: Worth::Formula(Box::new(formula)), ..self }
    }
}

/// Causes that act at every pixel by a function of the site.
macro_rules! at_sites {
    ($($(#[$doc:meta])* $name:ident: $statistic:literal, $act:path;)*) => {$(
        $(#[$doc])*
        pub fn $name(
            name: &str,
            form: &str,
            axis: &str,
            parameters: &[(&str, f64)],
            f: impl Fn(&Site, &Plan) -> f64 + Send + Sync + 'static,
        ) -> Cause {
            Cause::new(name, form, [$statistic, axis], parameters, $act(Box::new(f)))
        }
    )*};
}

at_sites! {
    /// Error of the matched disparity, px.
    bias: "bias", Act::Mismatch;
    /// Factor on sigma.
    spread: "variance", Act::Spread;
    /// Probability of no answer.
    loss: "missing", Act::Loss;
}
