//! How far the numbers told of a step may be off, whatever the form of its rise.
//!
//! A recording often shows no more than the foot of a rise; where its middle lies then depends on
//! the form. So the posterior is summed over several forms, on a grid that closes in on it: the middle
//! anywhere that the card allows, the width within a factor of e or so of what the card calls typical.

use rayon::prelude::*;
use statrs::function::erf::erfc;

use super::points::{Point, misfit};
use super::shapes::Step;
use crate::diagnose::search::posterior::Posterior;
use crate::effects;
use crate::stats::even;
use crate::terms::Axis;

/// From nothing lost to all, one half at 0. A pattern's contrast falls short of a threshold: by
/// logistic or Gaussian noise, or by the noise of the best or of the worst of many places.
/// Each is in the unit that its own formula calls a width, since that is what others will state.
const RISES: [fn(f64) -> f64; 4] = [
    |t| 1.0 / (1.0 + (-t).exp()),
    |t| 0.5 * erfc(-t * std::f64::consts::FRAC_1_SQRT_2),
    |t| (-std::f64::consts::LN_2 * (-t).exp()).exp(),
    |t| 1.0 - (-std::f64::consts::LN_2 * t.exp()).exp(),
];

/// Nodes along each side of a grid, and how often it closes in.
const NODES: usize = 24;
const ROUNDS: usize = 3;
/// What is this much less probable, in nats, is left out.
const NEGLIGIBLE: f64 = 8.0;
/// The least width that is tried, as a share of the greatest.
const NARROWEST: f64 = 1e-3;
/// As narrow as an edge need be followed: a driver's limit has no width at all.
const NARROWEST_EDGE: f64 = 1e-4;

/// Root mean square distances of middle and width from those `reported`; the points scatter by the
/// factor `scatter` more, in variance, than they are expected to.
pub fn errors(reported: &Step, base: f64, points: &[Point], scatter: f64) -> Option<[f64; 2]> {
    let Allowed { middles, widths, typical } = allowed(reported)?;
    let rising =
        |rise: &fn(f64) -> f64| Rising { reported, base, points, scatter, typical, rise: *rise };
    let nodes: Vec<Node> = RISES
        .par_iter()
        .flat_map_iter(|rise| rising(rise).nodes(middles, widths.map(f64::ln)))
        .collect();
    let posterior = Posterior::of(nodes, |n| (-n.misfit, n.area))?;
    let of_middle = posterior.rms(|n| n.middle - reported.middle);
    let errors = [of_middle, posterior.rms(|n| n.width - reported.width.abs())];
    errors.iter().all(|e| e.is_finite()).then_some(errors)
}

/// In the axis's own unit; widths by their size.
pub struct Allowed {
    middles: [f64; 2],
    widths: [f64; 2],
    typical: f64,
}

impl Allowed {
    pub fn admits(&self, step: &Step) -> bool {
        let within = |x: f64, [low, high]: [f64; 2]| (low..=high).contains(&x);
        within(step.middle, self.middles)
            && within(step.width.abs(), [NARROWEST_EDGE, self.widths[1]])
    }

    /// See [`untypical`].
    pub fn untypical(&self, step: &Step) -> f64 {
        untypical(step.width.abs(), self.typical)
    }
}

/// How far a width is from the typical one, in standard deviations: a factor of e is one.
fn untypical(width: f64, typical: f64) -> f64 {
    (width / typical).ln()
}

/// What the catalogue allows of such a step.
pub fn allowed(step: &Step) -> Option<Allowed> {
    let unit = if step.axis == Axis::Theta { 1f64.to_radians() } else { 1.0 };
    let card = effects::find(step.family())?.card();
    let [_, middle, width] = card.parameters else { return None };
    let widest = unit * width.range[1];
    Some(Allowed {
        middles: middle.range.map(|x| unit * x),
        widths: [NARROWEST * widest, widest],
        typical: unit * width.typical,
    })
}

/// A place of the grid.
#[derive(Debug, Clone, Copy)]
struct Node {
    middle: f64,
    width: f64,
    area: f64,
    /// Nats.
    misfit: f64,
}

/// A form of the rise, held against the points.
struct Rising<'a> {
    reported: &'a Step,
    base: f64,
    points: &'a [Point],
    scatter: f64,
    typical: f64,
    rise: fn(f64) -> f64,
}

impl Rising<'_> {
    /// Nats below a perfect fit of a typical width; infinite as soon as it is beyond `limit`.
    fn misfit(&self, middle: f64, width: f64, limit: f64) -> f64 {
        let lost = self.reported.share * (1.0 - self.base);
        let toward = self.reported.width.signum() / width;
        let mut sum = 0.5 * untypical(width, self.typical).powi(2);
        for p in self.points {
            let loss = self.base + lost * (self.rise)((p.x - middle) * toward);
            sum += 0.5 * misfit(p, loss).powi(2) / self.scatter;
            if sum > limit {
                return f64::INFINITY;
            }
        }
        sum
    }

    /// The last grid's nodes that matter.
    fn nodes(&self, middles: [f64; 2], logs: [f64; 2]) -> Vec<Node> {
        let mut across = around(self.reported.middle, self.reported.width.abs(), middles);
        let mut along: Vec<f64> = even(logs, NODES).collect();
        let mut nodes = Vec::new();
        for _ in 0..ROUNDS {
            let mut best = f64::INFINITY;
            nodes.clear();
            for (i, middle) in across.iter().enumerate() {
                for (j, log) in along.iter().enumerate() {
                    let misfit = self.misfit(*middle, log.exp(), best + NEGLIGIBLE);
                    best = best.min(misfit);
                    let area = side(&across, i) * side(&along, j);
                    nodes.push((i, j, Node { middle: *middle, width: log.exp(), area, misfit }));
                }
            }
            nodes.retain(|n: &(usize, usize, Node)| n.2.misfit < best + NEGLIGIBLE);
            across = closer(&across, nodes.iter().map(|n| n.0));
            along = closer(&along, nodes.iter().map(|n| n.1));
        }
        nodes.into_iter().map(|n| n.2).collect()
    }
}

/// Denser near a place: in steps that grow from a fraction of `width` to all that is allowed.
fn around(place: f64, width: f64, [low, high]: [f64; 2]) -> Vec<f64> {
    let first = 0.1 * width;
    let growth = |reach: f64| (reach / first).max(2.0).powf(1.0 / (NODES - 1) as f64);
    let side = |reach: f64, sign: f64| {
        let growth = growth(reach);
        (0..NODES).map(move |k| place + sign * first * growth.powi(k as i32))
    };
    let mut all = vec![place];
    all.extend(side(place - low, -1.0).chain(side(high - place, 1.0)));
    all.retain(|x| (low..=high).contains(x));
    all.sort_by(f64::total_cmp);
    all
}

/// Half of the way to either neighbour.
fn side(grid: &[f64], k: usize) -> f64 {
    let at = |k: usize| grid[k.min(grid.len() - 1)];
    0.5 * (at(k + 1) - at(k.saturating_sub(1)))
}

/// A finer grid over what these nodes and their neighbours hold.
fn closer(grid: &[f64], nodes: impl Iterator<Item = usize>) -> Vec<f64> {
    let (first, last) = nodes.fold((grid.len(), 0), |(a, b), k| (a.min(k), b.max(k)));
    let last_node = grid.len().saturating_sub(1);
    match (grid.get(first.saturating_sub(1).min(last_node)), grid.get((last + 1).min(last_node))) {
        (Some(low), Some(high)) => even([*low, *high], NODES).collect(),
        _ => grid.to_vec(),
    }
}
