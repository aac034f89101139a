//! A view's span along a step's axis, and where along it readings are lost.

use rand::Rng;
use rand_distr::{Distribution, Poisson, StandardNormal};

use super::cells::Cell;
use super::clumps::{PARTS, parts};
use super::shapes::{Step, is_told_apart};
use crate::rng::Stream;
use crate::terms::{Axis, Extent};

/// Share lost from which a view is judged by shares instead.
pub const MANY: f64 = 0.1;
/// Widths before its middle at which a logistic rise has lost a three-thousandth.
const ONSET_WIDTHS: f64 = 8.0;
/// Middles tried over this many widths.
const ONSETS: usize = 16;
/// Standard deviation of the log rate over half of a view without a cause: the usual slope over half of a
/// Kinect's picture.
pub const SLOPE: f64 = 1.0;
/// Most losses of a simulated view that are placed one by one; more are scaled up from them.
const PLACED: usize = 100;

/// Direction of a rise: towards steeper tilts, larger distances or smaller ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Toward {
    Steep,
    Far,
    Near,
}

impl Toward {
    pub fn along(self, cell: &Cell<'_>) -> f64 {
        match self {
            Toward::Steep => cell.place.theta,
            Toward::Far => cell.place.z,
            Toward::Near => -cell.place.z,
        }
    }

    /// Steps whose foot the views may see: beyond the steepest or the farthest, or before the nearest.
    pub fn onsets(self, reach: &Extent) -> Vec<Step> {
        let axis = if self == Toward::Steep { Axis::Theta } else { Axis::Z };
        if !is_told_apart(axis, reach) {
            return Vec::new();
        }
        let ([_, steepest], [near, far]) = (reach.theta, reach.z);
        let step = |width: f64, beyond: f64| match self {
            Toward::Steep => {
                let width = width.to_radians();
                Step::whole(Axis::Theta, steepest + beyond * width, width)
            }
            Toward::Far => Step::whole(Axis::Z, far * (1.0 + beyond * width), far * width),
            Toward::Near => Step::whole(Axis::Z, near * (1.0 - beyond * width), -near * width),
        };
        let widths = if self == Toward::Steep { [1.0, 2.0, 4.0] } else { [0.015, 0.03, 0.06] };
        let beyond = (0..ONSETS).map(|k| ONSET_WIDTHS * k as f64 / (ONSETS - 1) as f64);
        beyond.flat_map(|beyond| widths.map(|width| step(width, beyond))).collect()
    }
}

/// A view: how many clumps it could have lost, its time, and its span along the step's axis.
pub struct View {
    pub asked: f64,
    pub session_s: f64,
    /// Places along the step's axis, each with its share of the view.
    pub runs: Vec<[f64; 2]>,
}

/// Losses of a view, in all and in each of its runs.
pub struct Lost {
    pub all: f64,
    pub runs: Vec<f64>,
}

impl View {
    pub fn of(cells: &[Cell<'_>], clump: f64, toward: Toward) -> (Self, Lost) {
        let mut sums = vec![[0.0; 3]; PARTS];
        for (c, part) in cells.iter().zip(parts(cells, &|c| toward.along(c))) {
            let [x, asked, lost] = sums[part];
            sums[part] = [x + c.asked * toward.along(c).abs(), asked + c.asked, lost + c.lost];
        }
        sums.retain(|s| s[1] > 0.0);
        let [asked, lost] = [1, 2].map(|k| sums.iter().map(|s| s[k]).sum::<f64>());
        let view = View {
            asked: asked / clump,
            session_s: cells[0].place.session_s,
            runs: sums.iter().map(|[x, mine, _]| [x / mine, mine / asked]).collect(),
        };
        let runs = sums.iter().map(|s| s[2] / clump).collect();
        (view, Lost { all: lost / clump, runs })
    }

    /// Draws losses of noise alone, `expected` of them on average.
    pub fn draw(&self, expected: f64, rng: &mut Stream) -> Lost {
        let all = Poisson::new(expected).map_or(0.0, |p| p.sample(rng));
        let mut runs = vec![0.0; self.runs.len()];
        let placed = (all as usize).min(PLACED);
        let normal: f64 = StandardNormal.sample(rng);
        let leaning = |(k, [_, share]): (usize, &[f64; 2])| {
            let across = (2 * k + 1) as f64 / runs.len() as f64 - 1.0;
            share * (SLOPE * normal * across).exp()
        };
        let shares: Vec<f64> = self.runs.iter().enumerate().map(leaning).collect();
        for _ in 0..placed {
            let mut left = rng.random::<f64>() * shares.iter().sum::<f64>();
            let here = |share: &f64| {
                left -= share;
                left < 0.0
            };
            let run = shares.iter().position(here).unwrap_or(runs.len() - 1);
            runs[run] += all / placed as f64;
        }
        Lost { all, runs }
    }

    /// Increase in the view's log rate due to a step, where `rate` is lost anyway, and in each run's beyond
    /// the view's.
    pub fn added(&self, step: &Step, rate: f64) -> (f64, Vec<f64>) {
        if step.before(self.session_s) {
            return (0.0, Vec::new());
        }
        let loss = |x: f64| step.loss(x, 0.0).min(MANY);
        let level = 1.0 + self.runs.iter().map(|[x, share]| share * loss(*x)).sum::<f64>() / rate;
        let run = |[x, _]: &[f64; 2]| ((1.0 + loss(*x) / rate) / level).ln();
        (level.ln(), self.runs.iter().map(run).collect())
    }
}
