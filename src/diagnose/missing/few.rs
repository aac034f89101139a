//! Losses too few to be a share of a patch: what a view has lost in all, against how steep or how far it
//! is seen.
//!
//! In most recordings nearly nothing is lost but in the steepest or the farthest view, where a rise
//! has its foot: some hundred pixels of millions. A view is one sample. The logarithm of what it loses
//! differs from the others' for no reason by as much as theirs do, and never by less than a factor
//! of e; a count has an error of its own beside that, and what is lost in one clump counts once.

use std::collections::BTreeMap;

use rand_distr::{Distribution, StandardNormal};

use super::cells::{Cell, FEW, USUAL};
use super::search::{Judged, MIN_EXCESS_OF_LOSSES, predicted};
use super::shapes::{Shape, Step};
use crate::diagnose::search::noise_gains::NoiseGains;
use crate::rng::Seed;
use crate::stats::median;
use crate::terms::{Axis, Extent};

/// A view that has lost more has shares to judge by.
const MANY: f64 = 0.1;
/// Added to a count whose logarithm is taken (Anscombe 1948 has 3/8).
const HALF: f64 = 0.5;
/// So many widths before its middle a logistic rise has lost a three-thousandth.
const ONSET_WIDTHS: f64 = 8.0;
/// Middles tried, over as many widths.
const ONSETS: usize = 16;
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
        let by_place: BTreeMap<(i64, i64), f64> = view.iter().map(|c| off(&c)).collect();
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

/// The step whose foot the views' losses follow, at `rim` px or more from the target's edge, where noise
/// alone brings as much with a chance of no more than `level`.
pub fn few_losses(
    fine: &[Vec<Cell>],
    rim: f64,
    reach: &Extent,
    level: f64,
    seed: Seed,
) -> Option<(Judged, f64)> {
    let cells: Vec<Vec<&Cell>> =
        fine.iter().map(|v| v.iter().filter(|c| c.place.edge >= rim).collect()).collect();
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
        step_onsets(reach).into_iter().map(|s| (s, column(&s, &views, usual))).collect();
    let best = |y: &[f64], scatter: f64| {
        let each = columns.iter().map(|(step, h)| (gain(h, y, &views, scatter), *step, h));
        each.max_by(|a, b| a.0.0.total_cmp(&b.0.0))
    };
    let (_, _, column) = best(&y, USUAL.level)?;
    let left: Vec<f64> = y.iter().zip(column).map(|(y, h)| (y - h).powi(2)).collect();
    let scatter = ((1.0 + FEW / views.len() as f64) * scatter(&left, &views)).max(USUAL.level);
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
    let noise = NoiseGains::simulated(REPLICATES, MIN_EXCESS_OF_LOSSES, draw);
    let coefficients = vec![size];
    (found > noise.threshold(level))
        .then(|| (Judged { shape: Shape::Step(step), gain: found, coefficients }, noise.p(found)))
}

/// By how much the views' logarithms differ for no reason, in square, beside what their counts err by:
/// where the squares that are `left`, over what is expected of them, come to one a view (Paule and
/// Mandel 1982).
fn scatter(left: &[f64], views: &[View]) -> f64 {
    let excess = |scatter: f64| {
        let each = left.iter().zip(views).map(|(square, v)| square / variance(v, scatter));
        each.sum::<f64>() - views.len() as f64
    };
    let [mut low, mut high] = [0.0, left.iter().sum()];
    if excess(low) <= 0.0 {
        return low;
    }
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if excess(middle) > 0.0 { low = middle } else { high = middle }
    }
    high
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
fn step_onsets(reach: &Extent) -> Vec<Step> {
    let along = |k: usize| ONSET_WIDTHS * k as f64 / (ONSETS - 1) as f64;
    let mut all = Vec::new();
    let [_, steepest] = reach.theta;
    for width in [1.0f64, 2.0, 4.0].map(f64::to_radians) {
        for k in 0..ONSETS {
            let middle = steepest + along(k) * width;
            all.push(Step { axis: Axis::Theta, middle, width, share: 1.0 });
        }
    }
    let [near, far] = reach.z;
    for width in [0.015, 0.03, 0.06] {
        for k in 0..ONSETS {
            let beyond = along(k) * width;
            let step = |middle, width| Step { axis: Axis::Z, middle, width, share: 1.0 };
            all.push(step(far * (1.0 + beyond), far * width));
            all.push(step(near * (1.0 - beyond), -near * width));
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::terms::PixelContext;
    use rand::Rng;

    const VIEWS: usize = 16;
    const SIDE: f64 = 4.0;
    const ACROSS: usize = 30;

    /// Views ever steeper and, in another order, ever farther; `lost` says what a patch loses.
    fn session(mut lost: impl FnMut(usize, usize) -> f64) -> (Vec<Vec<Cell>>, Extent) {
        let view = |view: usize| -> Vec<(usize, PixelContext)> {
            let theta = (4.5 * view as f64).to_radians();
            let z = 0.8 + 0.15 * (7 * view % VIEWS) as f64;
            let place = |i: usize| PixelContext {
                u: SIDE * (i % ACROSS) as f64 + 2.0,
                v: SIDE * (i / ACROSS) as f64 + 2.0,
                theta,
                z,
                edge: 30.0,
                side: SIDE,
                ..Default::default()
            };
            (0..ACROSS * ACROSS).map(|i| (i, place(i))).collect()
        };
        let cells: Vec<Vec<Cell>> = (0..VIEWS)
            .map(|v| {
                let cell = |(i, place)| Cell { place, lost: lost(v, i), asked: 64.0 };
                view(v).into_iter().map(cell).collect()
            })
            .collect();
        let reach = Extent::of(cells.iter().flatten().map(|c| &c.place));
        (cells, reach)
    }

    fn found((cells, reach): &(Vec<Vec<Cell>>, Extent)) -> Option<Axis> {
        few_losses(cells, 8.0, reach, 0.001, Seed(1)).map(|(judged, _)| judged.shape.axis())
    }

    #[test]
    fn the_foot_of_a_rise_is_seen_in_the_steepest_view_and_in_the_farthest() {
        let mut rng = Seed(5).stream("few");
        // Of seven times its number modulo 16 the tenth view has the most.
        for (view, axis) in [(VIEWS - 1, Axis::Theta), (9, Axis::Z)] {
            let lossy = session(|v, _| f64::from(u8::from(v == view && rng.random_bool(0.08))));
            assert_eq!(found(&lossy), Some(axis), "view {view}");
        }
    }

    /// A clump counts once, views in the middle of both axes follow none, and what is lost alike in
    /// all views follows nothing.
    #[test]
    fn clumps_other_views_and_even_losses_are_no_foot() {
        let mut rng = Seed(6).stream("few");
        let hole = |v: usize, i: usize| v == VIEWS - 1 && i % ACROSS < 5 && i / ACROSS < 5;
        assert_eq!(found(&session(|v, i| if hole(v, i) { 40.0 } else { 0.0 })), None);
        let mut some = |p: f64| f64::from(u8::from(rng.random_bool(p)));
        assert_eq!(found(&session(|v, _| if v == 8 { some(0.08) } else { 0.0 })), None);
        for _ in 0..5 {
            assert_eq!(found(&session(|_, _| some(0.01))), None);
        }
        assert_eq!(found(&session(|_, _| 0.0)), None);
    }

    /// Views that differ for no reason by a factor of e: the level that was asked for holds.
    #[test]
    fn views_that_differ_for_no_reason_seldom_look_like_a_foot() {
        let mut alarms = 0;
        for seed in 0..60 {
            let mut rng = Seed(seed).stream("few/null");
            let levels: Vec<f64> = (0..VIEWS)
                .map(|_| {
                    let normal: f64 = StandardNormal.sample(&mut rng);
                    (0.004 * normal.exp()).min(0.2)
                })
                .collect();
            let lossy = session(|v, _| f64::from(u8::from(rng.random_bool(levels[v]))));
            alarms += u32::from(found(&lossy).is_some());
        }
        assert!(alarms <= 1, "{alarms} of 60");
    }
}
