//! All sets together: rates with their intervals, by every grouping that is asked for.

use std::collections::BTreeMap;

use kinoise::stats::{clopper_pearson, quantile};
use serde::{Deserialize, Serialize};

use super::endpoints::{Endpoint, endpoints};
use super::marks::Stated;
use crate::gain::{Gain, Gains};
use crate::proof::ProvenSet;
use crate::raytraced::question::{Cell, Truth};

/// So many of so many.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Rate {
    pub k: usize,
    pub n: usize,
    pub rate: f64,
    /// 95 %, Clopper and Pearson.
    pub interval: [f64; 2],
}

impl Rate {
    /// `None` where nothing was tried.
    pub fn of(answers: impl Iterator<Item = bool>) -> Option<Self> {
        let (mut k, mut n) = (0, 0);
        for yes in answers {
            n += 1;
            k += usize::from(yes);
        }
        let interval = clopper_pearson(k, n, 0.95);
        (n > 0).then(|| Rate { k, n, rate: k as f64 / n as f64, interval })
    }
}

/// Rates by question.
pub type Rates = BTreeMap<String, Rate>;

/// The whole trial.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Scores {
    pub sets: usize,
    /// By kind of set, "WORLD/CELL"; what the catalogue has no name for is "WORLD/nameless".
    pub by_kind: BTreeMap<String, Rates>,
    /// Single causes by kind and strength, nats (in the world of light the size that was ordered).
    pub by_strength: BTreeMap<String, BTreeMap<String, Rates>>,
    /// Single causes by name and strength; those outside the catalogue by form.
    pub by_effect: BTreeMap<String, BTreeMap<String, Rates>>,
    /// Of single causes that were detected: what was hidden, what was said first, how often.
    pub confusion: BTreeMap<String, BTreeMap<String, usize>>,
    /// Medians over all sets.
    pub overlap: Option<f64>,
    pub parameter_error: Option<f64>,
    /// Stated 90 % intervals that hold the truth.
    pub coverage: Option<Rate>,
    /// Stated probabilities of best names against how often they are right.
    pub calibration: Vec<Bin>,
    /// Mean distance of the two over the bins, and Brier's score.
    pub calibration_error: Option<f64>,
    pub brier: Option<f64>,
    /// Gains over the oracle's, by method, inside and outside the recording's distances and tilts.
    pub gains: BTreeMap<String, [Option<Ratio>; 2]>,
    /// Advised views after which the hidden name leads with 0.9 or more.
    pub advice: Option<Rate>,
    pub endpoints: Vec<Endpoint>,
}

/// Names stated with about the same probability.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Bin {
    /// Mean of the stated probabilities.
    pub stated: f64,
    pub right: Rate,
}

/// Gains of one method over the oracle's, over sets.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Ratio {
    /// Sets whose oracle gains something.
    pub n: usize,
    pub median: f64,
    /// 10th percentile.
    pub low: f64,
}

/// Score all sets.
pub fn scores(sets: &[ProvenSet]) -> Scores {
    let single = |s: &&ProvenSet| matches!(s.truth.asked.cell, Cell::Single | Cell::Outside);
    let singles: Vec<&ProvenSet> = sets.iter().filter(single).collect();
    let parameters = || sets.iter().flat_map(|s| &s.marks.parameters);
    let stated: Vec<&Stated> = sets.iter().flat_map(|s| &s.marks.stated).collect();
    let mut overlaps: Vec<f64> = sets.iter().filter_map(|s| s.marks.overlap).collect();
    let mut errors: Vec<f64> = parameters().map(|p| p.relative_error).collect();
    let calibration = calibration(&stated);
    let names = stated.len().max(1) as f64;
    let off = calibration.iter().map(|b| (b.stated - b.right.rate).abs() * b.right.n as f64);
    let calibration_error = (!stated.is_empty()).then(|| off.sum::<f64>() / names);
    let square = |s: &&Stated| (s.probability - f64::from(u8::from(s.right))).powi(2);
    let brier = (!stated.is_empty()).then(|| stated.iter().map(square).sum::<f64>() / names);
    let advice = sets.iter().filter_map(|s| s.advised.as_ref()?.marks.settled);
    Scores {
        sets: sets.len(),
        by_kind: grouped(sets.iter(), |s| Some(kind(&s.truth)))
            .into_iter()
            .map(|(kind, sets)| (kind, rates(&sets)))
            .collect(),
        by_strength: by_strength(&singles, |s| kind(&s.truth)),
        by_effect: by_strength(&singles, |s| hidden_name(&s.truth)),
        confusion: confusion(&singles),
        overlap: quantile(&mut overlaps, 0.5),
        parameter_error: quantile(&mut errors, 0.5),
        coverage: Rate::of(parameters().filter_map(|p| p.covered)),
        calibration,
        calibration_error,
        brier,
        gains: gains(sets),
        advice: Rate::of(advice),
        endpoints: endpoints(sets),
    }
}

/// Strengths as they are ordered, nats.
const LEVELS: [f64; 6] = [5.0, 15.0, 50.0, 150.0, 500.0, 5000.0];

/// What the weakest hidden cause is worth, as the nearest of the strengths that are ordered; what
/// its world says it reached, else what was ordered.
pub fn level(truth: &Truth) -> Option<f64> {
    let nats = truth.hidden.iter().filter_map(|h| h.nats.or(truth.asked.nats));
    let min = nats.reduce(f64::min).filter(|n| *n > 0.0)?;
    let away = |l: &f64| (min / l).ln().abs();
    LEVELS.into_iter().min_by(|a, b| away(a).total_cmp(&away(b)))
}

fn strength(truth: &Truth) -> Option<String> {
    level(truth).map(|l| format!("{:04}", l as u32))
}

/// As in the files.
pub fn word(of: impl Serialize) -> String {
    serde_json::to_value(of).ok().and_then(|v| v.as_str().map(String::from)).unwrap_or_default()
}

/// A switch of the world of light that has no name in the catalogue stands apart: its name cannot be
/// right.
fn kind(truth: &Truth) -> String {
    let (world, cell) = (word(truth.asked.world), truth.asked.cell);
    let nameless = truth.hidden.iter().all(|h| h.names.is_empty());
    match cell {
        Cell::Single if nameless => format!("{world}/nameless"),
        cell => format!("{world}/{}", word(cell)),
    }
}

fn hidden_name(truth: &Truth) -> String {
    let name = |h: &crate::raytraced::question::Hidden| {
        h.names.first().map_or(h.form.clone(), String::clone)
    };
    truth.hidden.iter().map(name).collect::<Vec<_>>().join("+")
}

fn grouped<'a>(
    sets: impl Iterator<Item = &'a ProvenSet>,
    key: impl Fn(&ProvenSet) -> Option<String>,
) -> BTreeMap<String, Vec<&'a ProvenSet>> {
    let mut groups: BTreeMap<String, Vec<&ProvenSet>> = BTreeMap::new();
    for set in sets {
        if let Some(key) = key(set) {
            groups.entry(key).or_default().push(set);
        }
    }
    groups
}

fn rates(sets: &[&ProvenSet]) -> Rates {
    let mut answers: BTreeMap<&String, Vec<bool>> = BTreeMap::new();
    for (question, yes) in sets.iter().flat_map(|s| &s.marks.answers) {
        answers.entry(question).or_default().push(*yes);
    }
    let rate = |(q, all): (&String, Vec<bool>)| Some((q.clone(), Rate::of(all.into_iter())?));
    answers.into_iter().filter_map(rate).collect()
}

fn by_strength(
    singles: &[&ProvenSet],
    key: impl Fn(&ProvenSet) -> String,
) -> BTreeMap<String, BTreeMap<String, Rates>> {
    let by_key = grouped(singles.iter().copied(), |s| Some(key(s)));
    let levels = |sets: Vec<&ProvenSet>| {
        let by_level = grouped(sets.into_iter(), |s| strength(&s.truth));
        by_level.into_iter().map(|(level, sets)| (level, rates(&sets))).collect()
    };
    by_key.into_iter().map(|(key, sets)| (key, levels(sets))).collect()
}

fn confusion(singles: &[&ProvenSet]) -> BTreeMap<String, BTreeMap<String, usize>> {
    let mut table: BTreeMap<String, BTreeMap<String, usize>> = BTreeMap::new();
    for set in singles.iter().filter(|s| s.marks.answers.get("detected") == Some(&true)) {
        let row = table.entry(hidden_name(&set.truth)).or_default();
        *row.entry(set.marks.first.clone()).or_insert(0) += 1;
    }
    table
}

/// Ten bins of the same width.
fn calibration(stated: &[&Stated]) -> Vec<Bin> {
    let bin = |p: f64| ((p * 10.0) as usize).min(9);
    let of = |k: usize| {
        let all: Vec<&&Stated> = stated.iter().filter(|s| bin(s.probability) == k).collect();
        let right = Rate::of(all.iter().map(|s| s.right))?;
        let sum: f64 = all.iter().map(|s| s.probability).sum();
        Some(Bin { stated: sum / all.len() as f64, right })
    };
    (0..10).filter_map(of).collect()
}

/// Less than this, nats per 1000 pixels, the oracle itself has not gained: a ratio to it means
/// nothing. It is 15 nats over a recording of 1.5 million pixels, 20 small views of 4 frames.
const MIN_ORACLE: f64 = 0.01;

/// Gain of `method` over the oracle's, where both are there.
pub fn ratio(gains: &Gains, method: &str, side: fn(&Gain) -> f64) -> Option<f64> {
    let (gain, oracle) = (side(gains.methods.get(method)?), side(&gains.oracle));
    (oracle >= MIN_ORACLE).then(|| gain / oracle).filter(|r| r.is_finite())
}

pub const SIDES: [fn(&Gain) -> f64; 2] = [|g| g.within, |g| g.beyond];

fn gains(sets: &[ProvenSet]) -> BTreeMap<String, [Option<Ratio>; 2]> {
    let all: Vec<&Gains> = sets.iter().filter_map(|s| s.gains.as_ref()).collect();
    let mut names: Vec<&String> = all.iter().flat_map(|g| g.methods.keys()).collect();
    names.sort();
    names.dedup();
    let of = |name: &str, side: fn(&Gain) -> f64| {
        let mut ratios: Vec<f64> = all.iter().filter_map(|g| ratio(g, name, side)).collect();
        let (median, low) = (quantile(&mut ratios, 0.5)?, quantile(&mut ratios, 0.1)?);
        Some(Ratio { n: ratios.len(), median, low })
    };
    names.into_iter().map(|n| (n.clone(), SIDES.map(|side| of(n, side)))).collect()
}
