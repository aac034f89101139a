//! Losses too few to form a share of a patch: a view's total loss against how steeply or how far away it sees
//! the target.
//!
//! In most recordings almost nothing is lost except in the steepest or the farthest view, where a rise has
//! its foot: some hundred pixels of millions. Each view is one sample. The logarithm of its loss scatters as
//! the others' do, by no less than a factor of e, with the counting error on top; a clump counts once. Where
//! in a view the losses lie tells a rise in distance from one in tilt.

use rand_distr::{Distribution, StandardNormal};

use super::cells::{Cell, FEW, USUAL};
use super::clumps::clump;
use super::runs::{Lost, MANY, SLOPE, Toward, View};
use super::search::{Judged, MIN_EXCESS_OF_LOSSES, predicted};
use super::shapes::{Shape, Step, begun};
use crate::diagnose::search::noise_gains::NoiseGains;
use crate::rng::Seed;
use crate::stats::{between, paule_mandel};
use crate::terms::Extent;

/// Added to a count before its logarithm is taken (Anscombe 1948 has 3/8).
const HALF: f64 = 0.5;
/// Simulations of the null distribution.
const REPLICATES: u64 = 1000;

/// A step, and what it adds to each view: to its log rate, and along its runs.
struct Column {
    step: Step,
    levels: Vec<f64>,
    runs: Vec<Vec<f64>>,
}

/// The views as seen by the steps of one direction.
struct Foot {
    views: Vec<View>,
    lost: Vec<Lost>,
    rate: f64,
    columns: Vec<Column>,
}

impl Foot {
    fn of(cells: &[Vec<Cell<'_>>], reach: &Extent, toward: Toward) -> Self {
        let clump = clump(cells, &|c| toward.along(c));
        let (views, lost): (Vec<View>, Vec<Lost>) =
            cells.iter().map(|v| View::of(v, clump, toward)).unzip();
        let rate = usual_rate(&views, &lost);
        let column = |step: Step| {
            let (levels, runs) = views.iter().map(|v| v.added(&step, rate)).unzip();
            Column { step, levels, runs }
        };
        let mut steps = toward.onsets(reach);
        steps.extend(begun(&steps, views.iter().map(|v| v.session_s)));
        let columns = steps.into_iter().map(column).collect();
        Foot { views, lost, rate, columns }
    }

    /// Log rates of the views over the usual rate. A view without losses never counts as above it.
    fn levels(&self, lost: &[Lost]) -> Vec<f64> {
        let rate = usual_rate(&self.views, lost);
        let level = |(lost, v): (&Lost, &View)| {
            let level = ((lost.all + HALF) / (v.asked * rate)).ln();
            if lost.all > 0.0 { level } else { level.min(0.0) }
        };
        lost.iter().zip(&self.views).map(level).collect()
    }

    /// Best step for the losses `lost`: by the views' log rates, which have the variance `scatter` without a
    /// cause, and by where in each view the losses lie.
    fn best(&self, lost: &[Lost], scatter: f64) -> Option<Best<'_>> {
        let y = self.levels(lost);
        let weights: Vec<f64> = lost.iter().map(|l| 1.0 / variance(l.all, scatter)).collect();
        // A random slope of the view would explain its losses too, which bounds their weight.
        let bound = |l: &Lost| 1.0 + l.all * SLOPE * SLOPE / 3.0;
        let (mut a, mut b) = (vec![0.0; y.len()], vec![0.0; y.len()]);
        let each = self.columns.iter().map(|column| {
            for (v, (h, w)) in column.levels.iter().zip(&weights).enumerate() {
                (a[v], b[v]) = (w * h * h, w * h * y[v]);
            }
            let (gain, size) = predicted(&a, &b);
            let along = || {
                let views = lost.iter().zip(&column.runs).filter(|(l, _)| l.all > 0.0);
                views.map(|(l, added)| dot(&l.runs, added) / bound(l)).sum()
            };
            let along = if gain > 0.0 { along() } else { 0.0 };
            Best { gain: gain + along - column.step.cost(), size, foot: self, column }
        });
        each.max_by(|a, b| a.gain.total_cmp(&b.gain))
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// A step and how well it predicts the views.
struct Best<'a> {
    gain: f64,
    size: f64,
    foot: &'a Foot,
    column: &'a Column,
}

/// Step whose foot the losses follow, at `rim` px or more from the target's edge, and its p-value; `None`
/// unless that is below `level`.
pub fn few_losses(
    fine: &[Vec<Cell<'_>>],
    rim: f64,
    reach: &Extent,
    level: f64,
    seed: Seed,
) -> Option<(Judged, f64)> {
    let inner = |c: &Cell<'_>| c.place.edge >= rim && c.asked > 0.0;
    let mut cells: Vec<Vec<Cell<'_>>> =
        fine.iter().map(|v| v.iter().copied().filter(inner).collect()).collect();
    cells.retain(|v| !v.is_empty());
    let sum = |v: &[Cell<'_>], of: fn(&Cell<'_>) -> f64| v.iter().map(|c| of(c)).sum::<f64>();
    let many = |v: &Vec<Cell<'_>>| sum(v, |c| c.lost) > MANY * sum(v, |c| c.asked);
    let none = |v: &Vec<Cell<'_>>| sum(v, |c| c.lost) == 0.0;
    if cells.iter().any(many) || cells.iter().all(none) {
        return None;
    }
    let feet = [Toward::Steep, Toward::Far, Toward::Near].map(|t| Foot::of(&cells, reach, t));
    let found = |scatter| {
        let each = feet.iter().filter_map(|f| f.best(&f.lost, scatter));
        each.max_by(|a, b| a.gain.total_cmp(&b.gain))
    };
    let Best { foot, column, .. } = found(USUAL.level)?;
    let (views, y) = (foot.views.len(), foot.levels(&foot.lost));
    let left: Vec<f64> = y.iter().zip(&column.levels).map(|(y, h)| (y - h).powi(2)).collect();
    let lost: Vec<f64> = foot.lost.iter().map(|l| l.all).collect();
    let scatter = ((1.0 + FEW / views as f64) * scatter(&left, &lost)).max(USUAL.level);
    let draw = |replicate: u64| {
        let mut rng = seed.stream(&format!("missing/few/{replicate}"));
        let own: Vec<f64> = (0..views).map(|_| StandardNormal.sample(&mut rng)).collect();
        let mut noise = |foot: &Foot| {
            let factor = own.iter().map(|own: &f64| (own * scatter.sqrt()).exp());
            let view = |(v, factor): (&View, f64)| v.draw(v.asked * foot.rate * factor, &mut rng);
            let lost: Vec<Lost> = foot.views.iter().zip(factor).map(view).collect();
            foot.best(&lost, scatter).map_or(0.0, |b| b.gain)
        };
        feet.iter().map(&mut noise).fold(0.0, f64::max)
    };
    let noise = NoiseGains::simulated(REPLICATES, MIN_EXCESS_OF_LOSSES, draw);
    let Best { gain, size, column, .. } = found(scatter)?;
    let shape = Shape::Step(column.step);
    (gain > noise.threshold(level))
        .then(|| (Judged { shape, gain, coefficients: vec![size] }, noise.p(gain)))
}

/// Share lost anyway: pooled over the half of the views with the smallest shares.
fn usual_rate(views: &[View], lost: &[Lost]) -> f64 {
    let mut each: Vec<[f64; 2]> = lost.iter().zip(views).map(|(l, v)| [l.all, v.asked]).collect();
    each.sort_by(|a, b| (a[0] / a[1]).total_cmp(&(b[0] / b[1])));
    let half = &each[..each.len().div_ceil(2)];
    let [lost, asked] = half.iter().fold([HALF, 0.0], |s, v| [s[0] + v[0], s[1] + v[1]]);
    lost / asked
}

/// Variance of the views' log rates without a cause, beyond their counting error: where the squared residuals
/// `left` over their expected values sum to one per view (Paule and Mandel 1982).
fn scatter(left: &[f64], lost: &[f64]) -> f64 {
    let views = left.iter().zip(lost);
    let each: Vec<(f64, f64)> =
        views.map(|(square, lost)| (*square, variance(*lost, 0.0))).collect();
    paule_mandel(each.len() as f64, |scatter| between(&each, scatter))
}

fn variance(lost: f64, scatter: f64) -> f64 {
    scatter + 1.0 / (lost + HALF)
}

#[cfg(test)]
#[path = "few_tests.rs"]
mod tests;
