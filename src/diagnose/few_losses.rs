//! Losses too few to be a share of a patch: what a view has lost in all, against how steep or how far it
//! is seen.
//!
//! In most recordings nearly nothing is lost but in the steepest or the farthest view, where a rise
//! has its foot: some hundred pixels of millions. A view is one sample. The logarithm of what it loses
//! differs from the others' for no reason by as much as theirs do, and never by less than a factor
//! of e; a count has an error of its own beside that, and what is lost in one clump counts once.

use std::collections::HashMap;

use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

use super::missing_cells::{Cell, FEW, RIM_PX, USUAL};
use super::missing_search::{Chance, Judged, predicted};
use super::missing_shapes::{Shape, Step};
use crate::rng::Seed;
use crate::stats::median;
use crate::terms::{Axis, Extent};

/// A view that has lost more has shares to judge by.
const MANY: f64 = 0.1;
/// Added to a count whose logarithm is taken (Anscombe 1948 has 3/8).
const HALF: f64 = 0.5;
/// So many widths before its middle a logistic rise has lost a three-thousandth.
const FOOT: f64 = 8.0;
/// Middles tried, over as many widths.
const FEET: usize = 16;
/// Simulations of the null.
const REPLICATES: u64 = 1000;

/// What a view has lost, in clumps, of how many that there could be.
struct View {
    lost: f64,
    asked: f64,
    theta: f64,
    z: f64,
}

impl View {
    fn of(cells: &[&Cell], clump: f64) -> Option<Self> {
        let asked: f64 = cells.iter().map(|c| c.asked).sum();
        let mean =
            |of: fn(&Cell) -> f64| cells.iter().map(|c| c.asked * of(c)).sum::<f64>() / asked;
        (asked > 0.0).then(|| View {
            lost: cells.iter().map(|c| c.lost).sum::<f64>() / clump,
            asked: asked / clump,
            theta: mean(|c| c.place.theta),
            z: mean(|c| c.place.z),
        })
    }

    /// Logarithm of the rate.
    fn level(&self) -> f64 {
        ((self.lost + HALF) / self.asked).ln()
    }
}

/// Pixel-frames that are lost together: how much more patches scatter about their view's share than
/// single losses would, times how many of them are alike.
fn clump(views: &[Vec<&Cell>]) -> f64 {
    let (mut squares, mut lost, mut products, mut pairs, mut cells) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for view in views {
        let [mine, asked] = [|c: &Cell| c.lost, |c: &Cell| c.asked]
            .map(|of| view.iter().map(|c| of(c)).sum::<f64>());
        if mine == 0.0 {
            continue;
        }
        let off = |c: &&&Cell| {
            let side = c.place.side.max(1.0);
            let at = ((c.place.u / side) as i64, (c.place.v / side) as i64);
            (at, c.lost - mine / asked * c.asked)
        };
        let by_place: HashMap<(i64, i64), f64> = view.iter().map(|c| off(&c)).collect();
        for ((u, v), x) in &by_place {
            squares += x * x;
            cells += 1.0;
            for at in [(u + 1, *v), (*u, v + 1), (u + 1, v + 1), (u - 1, v + 1)] {
                if let Some(y) = by_place.get(&at) {
                    products += x * y;
                    pairs += 1.0;
                }
            }
        }
        lost += mine * (1.0 - mine / asked);
    }
    let alike = products / f64::max(pairs, 1.0) * cells / f64::max(squares, f64::MIN_POSITIVE);
    (squares / f64::max(lost, f64::MIN_POSITIVE)).max(1.0) * (1.0 + 8.0 * alike.clamp(0.0, 1.0))
}

/// The step whose foot the views' losses follow, where noise alone brings as much with a chance of no
/// more than `level`.
pub fn few_losses(
    fine: &[Vec<Cell>],
    reach: &Extent,
    level: f64,
    seed: Seed,
) -> Option<(Judged, f64)> {
    let cells: Vec<Vec<&Cell>> =
        fine.iter().map(|v| v.iter().filter(|c| c.place.edge >= RIM_PX).collect()).collect();
    let clump = clump(&cells);
    let views: Vec<View> = cells.iter().filter_map(|v| View::of(v, clump)).collect();
    let many = |v: &View| v.lost > MANY * v.asked;
    if views.iter().any(many) || views.iter().all(|v| v.lost == 0.0) {
        return None;
    }
    let levels: Vec<f64> = views.iter().map(View::level).collect();
    let usual = median(&mut levels.clone());
    let y: Vec<f64> = levels.iter().map(|l| l - usual).collect();
    let columns: Vec<(Step, Vec<f64>)> =
        feet(reach).into_iter().map(|s| (s, column(&s, &views, usual))).collect();
    let best = |y: &[f64], scatter: f64| {
        let each = columns.iter().map(|(step, h)| (gain(h, y, &views, scatter), *step, h));
        each.max_by(|a, b| a.0.0.total_cmp(&b.0.0))
    };
    let (_, _, column) = best(&y, USUAL.level)?;
    let left: f64 = y.iter().zip(column).map(|(y, h)| (y - h).powi(2)).sum();
    let n = views.len() as f64;
    let scatter = ((1.0 + FEW / n) * left / n).max(USUAL.level);
    let ((found, size), step, _) = best(&y, scatter)?;
    let draw = |replicate: u64| {
        let mut rng = seed.stream(&format!("missing/few/{replicate}"));
        let mut noise = |v: &View| {
            let normal: f64 = StandardNormal.sample(&mut rng);
            normal * variance(v, scatter).sqrt()
        };
        let mut y: Vec<f64> = views.iter().map(&mut noise).collect();
        let usual = median(&mut y.clone());
        y.iter_mut().for_each(|y| *y -= usual);
        best(&y, scatter).map_or(0.0, |b| b.0.0)
    };
    let chance = Chance::of((0..REPLICATES).into_par_iter().map(draw).collect());
    let coefficients = vec![size];
    (found > chance.threshold(level)).then(|| {
        (Judged { shape: Shape::Step(step), gain: found, coefficients }, chance.of_gain(found))
    })
}

fn variance(view: &View, scatter: f64) -> f64 {
    scatter + 1.0 / (view.lost + HALF)
}

fn gain(column: &[f64], y: &[f64], views: &[View], scatter: f64) -> (f64, f64) {
    let weight = || views.iter().map(|v| 1.0 / variance(v, scatter));
    let a: Vec<f64> = column.iter().zip(weight()).map(|(h, w)| w * h * h).collect();
    let b: Vec<f64> = column.iter().zip(y).zip(weight()).map(|((h, y), w)| w * h * y).collect();
    predicted(&a, &b)
}

/// What a step adds to the views' levels where `usual` is there anyway.
fn column(step: &Step, views: &[View], usual: f64) -> Vec<f64> {
    let of = |v: &View| {
        let at = if step.axis == Axis::Theta { v.theta } else { v.z };
        let anyway = usual.exp();
        (1.0 + step.loss(at, 0.0).min(MANY) / anyway).ln()
    };
    views.iter().map(of).collect()
}

/// Steps of which the views may see the foot: beyond the steepest and the farthest, and before the
/// nearest.
fn feet(reach: &Extent) -> Vec<Step> {
    let along = |k: usize| FOOT * k as f64 / (FEET - 1) as f64;
    let mut all = Vec::new();
    let [_, steepest] = reach.theta;
    for width in [1.0f64, 2.0, 4.0].map(f64::to_radians) {
        for k in 0..FEET {
            let middle = steepest + along(k) * width;
            all.push(Step { axis: Axis::Theta, middle, width, share: 1.0 });
        }
    }
    let [near, far] = reach.z;
    for width in [0.015, 0.03, 0.06] {
        for k in 0..FEET {
            let beyond = along(k) * width;
            let step = |middle, width| Step { axis: Axis::Z, middle, width, share: 1.0 };
            all.push(step(far * (1.0 + beyond), far * width));
            all.push(step(near * (1.0 - beyond), -near * width));
        }
    }
    all
}
