//! What a view runs through on a step's axis, and where along it something is lost.

use rand::Rng;
use rand_distr::{Distribution, Poisson, StandardNormal};

use super::cells::Cell;
use super::clumps::{PARTS, parts};
use super::shapes::{Step, is_told_apart};
use crate::rng::Stream;
use crate::terms::{Axis, Extent};

/// A view that has lost more has shares to judge by.
pub const MANY: f64 = 0.1;
/// So many widths before its middle a logistic rise has lost a three-thousandth.
const ONSET_WIDTHS: f64 = 8.0;
/// Middles tried, over as many widths.
const ONSETS: usize = 16;
/// For no reason the logarithm of the rate changes so much over half of a view (standard deviation): what is
/// usual for its slope, over half of a Kinect's picture.
pub const SLOPE: f64 = 1.0;
/// At most so many losses of a simulated view are placed one by one; more are scaled up from them.
const PLACED: usize = 100;

/// Where a rise goes: what is steeper is lost, what is farther, or what is nearer.
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

    /// Steps of which the views may see the foot: beyond the steepest and the farthest, and before the
    /// nearest.
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

/// A view: how many clumps it could have lost, when, and where along the step's axis.
pub struct View {
    pub asked: f64,
    pub session_s: f64,
    /// What it runs through on the step's axis: where, and its share of the view.
    pub runs: Vec<[f64; 2]>,
}

/// Lost by a view: in all, and in each of its runs.
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

    /// Of nothing but noise, where so many are `expected`.
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

    /// What a step adds to the logarithm of the view's rate where `rate` is there anyway, and to that of
    /// each run beyond it.
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
