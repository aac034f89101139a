//! The search for missing terms: best first, each step judged on held-out views against what
//! noise alone would have brought.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::bias::{self, Reach};
use super::candidate::Candidate;
use super::evidence::{Evidence, Gain, Null, Rows, gain};
use super::field::Field;
use super::tiles::{Place, Tile, tiles};
use crate::camera::{Camera, Rays};
use crate::rng::Seed;
use crate::stats::measure_correlation;

/// The tiles of all views, with how much each view is worth.
pub struct Layer {
    pub views: Vec<ViewTiles>,
    pub reach: Reach,
}

pub struct ViewTiles {
    pub tiles: Vec<Tile>,
    /// Variance of a pixel's mean in units of the model's, times pixels per independent sample.
    pub inflation: f64,
}

/// A term that was accepted.
pub struct Found {
    pub candidate: Candidate,
    pub gain: Gain,
    /// Gain of the best nameless curve at the same step, nats.
    pub best_curve: f64,
    /// What noise alone brings at most, nats, at the step's error rate.
    pub threshold: f64,
    /// The next best family and its gain.
    pub runner_up: Option<(&'static str, f64)>,
}

impl Layer {
    pub fn of(fields: &[Field], camera: &Camera, rays: &Rays) -> Self {
        let start = fields.iter().map(|f| f.time_s).fold(f64::INFINITY, f64::min);
        let views: Vec<ViewTiles> = fields
            .par_iter()
            .map(|f| ViewTiles {
                tiles: tiles(f, camera, rays, start),
                inflation: inflation(f, camera),
            })
            .collect();
        let all = || views.iter().flat_map(|v| v.tiles.iter().map(|t| t.place));
        let range = |value: fn(&Place) -> f64| {
            all().map(|p| value(&p)).fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| {
                [a.min(v), b.max(v)]
            })
        };
        let reach = Reach {
            disparity: range(|p| p.disparity),
            right: range(|p| p.right),
            down: range(|p| p.down),
            edge: range(|p| p.edge)[1],
        };
        Layer { views, reach }
    }
}

/// How much less a pixel's mean is worth than the model says: its variance relative to the
/// model's, and how many pixels make one independent sample. Measured on what is left after a
/// smooth error is taken out.
fn inflation(field: &Field, camera: &Camera) -> f64 {
    let mut image = vec![f32::NAN; camera.pixels()];
    for (k, &i) in field.pixels.iter().enumerate() {
        image[i as usize] = field.mean[k] / field.sigma[k];
    }
    let rough = high_pass(&image, camera.width, camera.height);
    let (mut sum, mut n) = (0.0, 0.0);
    for r in rough.iter().filter(|r| r.is_finite()) {
        sum += f64::from(*r).powi(2);
        n += 1.0;
    }
    let correlation = measure_correlation(&rough, camera.width);
    if n > 0.0 { (sum / n * correlation.sum).max(1e-6) } else { f64::INFINITY }
}

/// Side of the box whose mean is taken out, px: several windows, and less than a lens's bowl.
const SMOOTH_PX: usize = 49;

/// Minus its mean over a box, where at least a quarter of the box is there.
pub fn high_pass(image: &[f32], width: usize, height: usize) -> Vec<f32> {
    // Summed-area tables of value and presence.
    let mut sums = vec![(0f64, 0f64); (width + 1) * (height + 1)];
    for v in 0..height {
        let mut row = (0.0, 0.0);
        for u in 0..width {
            let e = image[v * width + u];
            if e.is_finite() {
                row.0 += f64::from(e);
                row.1 += 1.0;
            }
            let above = sums[v * (width + 1) + u + 1];
            sums[(v + 1) * (width + 1) + u + 1] = (above.0 + row.0, above.1 + row.1);
        }
    }
    let half = SMOOTH_PX / 2;
    (0..width * height)
        .map(|i| {
            let (u, v) = (i % width, i / width);
            let (u0, u1) = (u.saturating_sub(half), (u + half + 1).min(width));
            let (v0, v1) = (v.saturating_sub(half), (v + half + 1).min(height));
            let at = |u: usize, v: usize| sums[v * (width + 1) + u];
            let box_of = |f: fn((f64, f64)) -> f64| {
                f(at(u1, v1)) - f(at(u0, v1)) - f(at(u1, v0)) + f(at(u0, v0))
            };
            let n = box_of(|s| s.1);
            if 4.0 * n < (SMOOTH_PX * SMOOTH_PX) as f64 {
                return f32::NAN;
            }
            image[i] - (box_of(|s| s.0) / n) as f32
        })
        .collect()
}

/// The views' residuals minus what is `fitted`, about a plane of their own each.
fn rows(layer: &Layer, fitted: &[Vec<f64>]) -> Vec<Rows> {
    layer
        .views
        .par_iter()
        .zip(fitted)
        .filter_map(|(view, fitted)| {
            let n = view.tiles.len();
            let response = view.tiles.iter().zip(fitted).map(|(t, f)| finite(t.mean - f)).collect();
            let weight = view.tiles.iter().map(|t| finite(t.pixels / t.variance / view.inflation));
            let nuisance = DMatrix::from_fn(n, 3, |i, q| {
                let p = &view.tiles[i].place;
                [1.0, p.x, p.y][q]
            });
            Rows::new(response, weight.collect(), nuisance)
        })
        .collect()
}

fn evidence(layer: &Layer, rows: &[Rows], candidate: &Candidate) -> Vec<Evidence> {
    let reduce = |(view, rows): (&ViewTiles, &Rows)| {
        rows.reduce(candidate.count, |i, g| (candidate.columns)(&view.tiles[i].place, g))
    };
    layer.views.iter().zip(rows).map(reduce).collect()
}

fn finite(v: f64) -> f64 {
    if v.is_finite() { v } else { 0.0 }
}

/// A coefficient nothing is known about is a few px at most.
const PRIOR_PER_PX2: f64 = 0.1;
/// Simulations of the null at each step.
const REPLICATES: u64 = 1000;
/// No more terms than this are looked for in a layer.
const MOST_TERMS: usize = 6;

/// Terms of the mean, best first.
pub fn search_bias(layer: &Layer, camera: &Camera, seed: Seed) -> Vec<Found> {
    let mut fitted: Vec<Vec<f64>> =
        layer.views.iter().map(|v| vec![0.0; v.tiles.len()]).collect();
    let mut found = Vec::new();
    while found.len() < MOST_TERMS {
        let candidates: Vec<Candidate> = bias::families(camera, &layer.reach)
            .into_iter()
            .chain(bias::curves(camera, &layer.reach))
            .collect();
        let rows = rows(layer, &fitted);
        let judged: Vec<(Option<Null>, Option<Gain>)> = candidates
            .par_iter()
            .map(|c| {
                let e = evidence(layer, &rows, c);
                (Null::of(&e, PRIOR_PER_PX2), gain(&e, PRIOR_PER_PX2))
            })
            .collect();
        let nulls: Vec<&Null> = judged.iter().filter_map(|j| j.0.as_ref()).collect();
        let threshold = threshold(&nulls, seed);
        let total = |i: usize| judged[i].1.as_ref().map_or(f64::NEG_INFINITY, |g| g.total);
        let best = |named: bool| {
            (0..candidates.len())
                .filter(|&i| candidates[i].family.is_some() == named)
                .max_by(|&a, &b| total(a).total_cmp(&total(b)))
        };
        let (Some(family), Some(curve)) = (best(true), best(false)) else { break };
        if std::env::var_os("KINOISE_TRACE").is_some() {
            trace(&candidates, &total, threshold);
        }
        let winner = if total(family) > threshold { family } else { curve };
        if total(winner) <= threshold {
            break;
        }
        let name = candidates[winner].family;
        let runner_up = (0..candidates.len())
            .filter(|&i| candidates[i].family.is_some() && candidates[i].family != name)
            .max_by(|&a, &b| total(a).total_cmp(&total(b)))
            .and_then(|i| candidates[i].family.map(|f| (f, total(i))));
        let best_curve = total(curve);
        let gain = judged[winner].1.clone().expect("a winner has a gain");
        let candidate = candidates.into_iter().nth(winner).expect("a winner is a candidate");
        let beta: Vec<f64> = gain.beta.iter().copied().collect();
        let mut row = Vec::new();
        for (view, fitted) in layer.views.iter().zip(&mut fitted) {
            for (t, f) in view.tiles.iter().zip(fitted) {
                *f += candidate.value(&beta, &t.place, &mut row);
            }
        }
        found.push(Found { candidate, gain, best_curve, threshold, runner_up });
    }
    found
}

fn trace(candidates: &[Candidate], total: &dyn Fn(usize) -> f64, threshold: f64) {
    let mut order: Vec<usize> = (0..candidates.len()).collect();
    order.sort_by(|&a, &b| total(b).total_cmp(&total(a)));
    eprintln!("threshold {threshold:.1}");
    for &i in order.iter().take(8) {
        let c = &candidates[i];
        eprintln!("  {:9.1}  {:?} {} {:?}", total(i), c.family, c.axis, c.settled);
    }
}

/// The greatest gain over all candidates that noise alone brings in 99 of 100 recordings.
fn threshold(nulls: &[&Null], seed: Seed) -> f64 {
    let mut greatest: Vec<f64> = (0..REPLICATES)
        .into_par_iter()
        .map(|replicate| {
            let mut rng = seed.stream(&format!("diagnose/null/{replicate}"));
            nulls.iter().map(|null| null.draw(&mut rng)).fold(0.0, f64::max)
        })
        .collect();
    greatest.sort_by(f64::total_cmp);
    // The tail beyond the simulated ones is exponential in a log likelihood.
    let at = |level: f64| greatest[((REPLICATES as f64 - 1.0) * level) as usize];
    let mean_excess = {
        let cut = at(0.8);
        let tail: Vec<f64> = greatest.iter().filter(|g| **g > cut).map(|g| g - cut).collect();
        tail.iter().sum::<f64>() / tail.len().max(1) as f64
    };
    at(0.8) + mean_excess * (0.2f64 / 0.01).ln()
}
