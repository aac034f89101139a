//! The search for missing terms: best first, each step judged on held-out views against what
//! noise alone would have brought.

use rayon::prelude::*;

use super::candidate::Candidate;
use super::evidence::{Evidence, Gain, Null, Rows, gain};
use super::tiles::Place;
use crate::rng::Seed;

/// One view's places and its data there.
pub struct ViewRows<'a> {
    pub places: &'a [Place],
    pub rows: Rows,
}

/// A term that was accepted.
pub struct Found {
    pub candidate: Candidate,
    pub gain: Gain,
    /// Gain of the best family and the best nameless curve at the same step, nats.
    pub best_family: f64,
    pub best_curve: f64,
    /// What noise alone brings at most, nats, at the step's error rate.
    pub threshold: f64,
    /// Families by their gain at this step, best first, one entry each.
    pub ranking: Vec<(&'static str, f64)>,
}

/// How a step decides.
#[derive(Debug, Clone, Copy)]
pub struct Rules {
    /// Chance that noise alone is taken for a term.
    pub level: f64,
    /// Precision of a coefficient nothing is known about, in its own unit.
    pub prior: f64,
    /// A name must explain this share of what the best curve does.
    pub adequacy: f64,
}

/// Simulations of the null at each step.
const REPLICATES: u64 = 1000;
/// Of families that predict as well as the best, the one with the fewest columns is meant.
const AS_GOOD_NATS: f64 = 2.0;

/// The best candidate, if it brings more than noise can.
pub fn step(
    views: &[ViewRows<'_>],
    candidates: Vec<Candidate>,
    rules: &Rules,
    seed: Seed,
) -> Option<Found> {
    let judged: Vec<Option<(Null, Gain)>> = candidates
        .par_iter()
        .map(|c| {
            let e = evidence(views, c);
            Some((Null::of(&e, rules.prior)?, gain(&e, rules.prior)?))
        })
        .collect();
    let nulls: Vec<&Null> = judged.iter().flatten().map(|j| &j.0).collect();
    let threshold = threshold(&nulls, rules.level, seed);
    let total = |i: usize| judged[i].as_ref().map_or(f64::NEG_INFINITY, |j| j.1.total);
    let ranked = |named: bool| {
        let mut order: Vec<usize> =
            (0..candidates.len()).filter(|&i| candidates[i].family.is_some() == named).collect();
        order.sort_by(|&a, &b| total(b).total_cmp(&total(a)));
        order
    };
    let (families, curves) = (ranked(true), ranked(false));
    let best_curve = curves.first().map_or(f64::NEG_INFINITY, |&i| total(i));
    let best_family = families.first().map_or(f64::NEG_INFINITY, |&i| total(i));
    trace(&candidates, &total, threshold);
    let named = families
        .iter()
        .copied()
        .filter(|&i| total(i) > best_family - AS_GOOD_NATS)
        .min_by_key(|&i| candidates[i].count)
        .filter(|&i| total(i) > threshold && total(i) > rules.adequacy * best_curve);
    let winner = named.or_else(|| curves.first().copied().filter(|&i| total(i) > threshold))?;
    let mut ranking: Vec<(&'static str, f64)> = Vec::new();
    for &i in &families {
        let Some(family) = candidates[i].family else { continue };
        if ranking.iter().all(|r| r.0 != family) {
            ranking.push((family, total(i)));
        }
    }
    let gain = judged.into_iter().nth(winner)??.1;
    let candidate = candidates.into_iter().nth(winner)?;
    Some(Found { candidate, gain, best_family, best_curve, threshold, ranking })
}

fn evidence(views: &[ViewRows<'_>], candidate: &Candidate) -> Vec<Evidence> {
    let reduce = |view: &ViewRows<'_>| {
        view.rows.reduce(candidate.count, |i, g| (candidate.columns)(&view.places[i], g))
    };
    views.iter().map(reduce).collect()
}

fn trace(candidates: &[Candidate], total: &dyn Fn(usize) -> f64, threshold: f64) {
    if std::env::var_os("KINOISE_TRACE").is_none() {
        return;
    }
    let mut order: Vec<usize> = (0..candidates.len()).collect();
    order.sort_by(|&a, &b| total(b).total_cmp(&total(a)));
    eprintln!("threshold {threshold:.1}");
    for &i in order.iter().take(8) {
        let c = &candidates[i];
        eprintln!("  {:9.1}  {:?} {} {:?}", total(i), c.family, c.axis, c.settled);
    }
}

/// The greatest gain over all candidates that noise alone exceeds with probability `level`.
fn threshold(nulls: &[&Null], level: f64, seed: Seed) -> f64 {
    let mut greatest: Vec<f64> = (0..REPLICATES)
        .into_par_iter()
        .map(|replicate| {
            let mut rng = seed.stream(&format!("diagnose/null/{replicate}"));
            nulls.iter().map(|null| null.draw(&mut rng)).fold(0.0, f64::max)
        })
        .collect();
    greatest.sort_by(f64::total_cmp);
    // Beyond the cut the tail of a log likelihood falls as an exponential.
    const TAIL: f64 = 0.1;
    let cut = greatest[((REPLICATES - 1) as f64 * (1.0 - TAIL)) as usize];
    let tail: Vec<f64> = greatest.iter().filter(|g| **g > cut).map(|g| g - cut).collect();
    let mean_excess = tail.iter().sum::<f64>() / tail.len().max(1) as f64;
    cut + mean_excess * (TAIL / level).ln().max(0.0)
}
