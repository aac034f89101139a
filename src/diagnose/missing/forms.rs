//! Errors of a step's reported parameters, whatever the form of its rise.
//!
//! A recording often shows only the foot of a rise; where its middle lies then depends on the form. The
//! posterior is therefore summed over several forms, on a grid that closes in on it: the middle anywhere the
//! effect's card allows, the width within a factor of e or so of the card's typical value.

use rayon::prelude::*;
use statrs::function::erf::erfc;

use super::points::{Point, misfit};
use super::shapes::Step;
use crate::diagnose::search::posterior::Posterior;
use crate::effects;
use crate::stats::even;
use crate::terms::Axis;

/// Rises from nothing lost to everything, one half at 0. A pattern's contrast falls short of a threshold by
/// logistic or Gaussian noise, or by the noise of the best or the worst of many places. Each is in the unit
/// its own formula calls a width, since others will report that.
const RISES: [fn(f64) -> f64; 4] = [
    |t| 1.0 / (1.0 + (-t).exp()),
    |t| 0.5 * erfc(-t * std::f64::consts::FRAC_1_SQRT_2),
    |t| (-std::f64::consts::LN_2 * (-t).exp()).exp(),
    |t| 1.0 - (-std::f64::consts::LN_2 * t.exp()).exp(),
];

/// Nodes along each side of a grid, and number of grids.
const NODES: usize = 24;
const ROUNDS: usize = 3;
/// Nodes this many nats below the best are dropped.
const NEGLIGIBLE: f64 = 8.0;
/// Smallest width tried, as a share of the largest.
const NARROWEST: f64 = 1e-3;
/// Narrowest edge a fit may follow; a driver's limit has no width at all.
const NARROWEST_EDGE: f64 = 1e-4;

/// RMS deviations of middle and width from those `reported`. `scatter` is the dispersion of the points: their
/// variance over what is expected.
pub fn errors(reported: &Step, base: f64, points: &[Point], scatter: f64) -> Option<[f64; 2]> {
    let allowed = &allowed(reported)?;
    let rising =
        |rise: &fn(f64) -> f64| Rising { reported, base, points, scatter, allowed, rise: *rise };
    let nodes: Vec<Node> = RISES.par_iter().flat_map_iter(|rise| rising(rise).nodes()).collect();
    let posterior = Posterior::of(nodes, |n| (-n.misfit, n.area))?;
    let of_middle = posterior.rms(|n| n.middle - reported.middle);
    let errors = [of_middle, posterior.rms(|n| n.width - reported.width.abs())];
    errors.iter().all(|e| e.is_finite()).then_some(errors)
}

/// Catalogue limits in the axis's own unit; widths are absolute.
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

    /// Deviation of a width from the typical one, in standard deviations; a factor of e is one.
    pub fn untypical(&self, width: f64) -> f64 {
        (width / self.typical).ln()
    }
}

/// Returns what the catalogue allows for such a step.
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

/// A node of the grid.
#[derive(Debug, Clone, Copy)]
struct Node {
    middle: f64,
    width: f64,
    area: f64,
    /// Negative log posterior, nats.
    misfit: f64,
}

/// A form of the rise, compared with the points.
struct Rising<'a> {
    reported: &'a Step,
    base: f64,
    points: &'a [Point],
    scatter: f64,
    allowed: &'a Allowed,
    rise: fn(f64) -> f64,
}

impl Rising<'_> {
    /// Nats below a perfect fit of typical width; infinite as soon as it exceeds `limit`.
    fn misfit(&self, middle: f64, width: f64, limit: f64) -> f64 {
        let lost = self.reported.share * (1.0 - self.base);
        let toward = self.reported.width.signum() / width;
        let mut sum = 0.5 * self.allowed.untypical(width).powi(2);
        for p in self.points {
            let loss = self.base + lost * (self.rise)((p.x - middle) * toward);
            sum += 0.5 * misfit(p, loss).powi(2) / self.scatter;
            if sum > limit {
                return f64::INFINITY;
            }
        }
        sum
    }

    /// Nodes of the last grid that are not negligible.
    fn nodes(&self) -> Vec<Node> {
        let Allowed { middles, widths, .. } = *self.allowed;
        let mut across = around(self.reported.middle, self.reported.width.abs(), middles);
        let mut along: Vec<f64> = even(widths.map(f64::ln), NODES).collect();
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

/// Grid around a place, in steps that grow from a fraction of `width` to the whole allowed range.
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

/// Half the distance between a node's neighbours.
fn side(grid: &[f64], k: usize) -> f64 {
    let at = |k: usize| grid[k.min(grid.len() - 1)];
    0.5 * (at(k + 1) - at(k.saturating_sub(1)))
}

/// Finer grid over the range of these nodes and their neighbours.
fn closer(grid: &[f64], nodes: impl Iterator<Item = usize>) -> Vec<f64> {
    let (first, last) = nodes.fold((grid.len(), 0), |(a, b), k| (a.min(k), b.max(k)));
    let last_node = grid.len().saturating_sub(1);
    match (grid.get(first.saturating_sub(1).min(last_node)), grid.get((last + 1).min(last_node))) {
        (Some(low), Some(high)) => even([*low, *high], NODES).collect(),
        _ => grid.to_vec(),
    }
}
