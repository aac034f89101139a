//! Scores over all sets: rates with their intervals, in several groupings.

use std::collections::BTreeMap;

use kinoise::stats::{clopper_pearson, quantile};
use serde::{Deserialize, Serialize};

use super::endpoints::{Endpoint, endpoints};
use super::marks::Stated;
use crate::gain::{Gain, Gains};
use crate::proof::ProvenSet;
use crate::raytraced::question::{Cell, Hidden, Truth};

/// A rate, `k` of `n`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Rate {
    pub k: usize,
    pub n: usize,
    pub rate: f64,
    /// 95 % interval of Clopper and Pearson.
    pub interval: [f64; 2],
}

impl Rate {
    /// Share of yes; `None` without answers.
    pub fn of(answers: impl Iterator<Item = bool>) -> Option<Self> {
        let (k, n) = answers.fold((0, 0), |(k, n), yes| (k + usize::from(yes), n + 1));
        let interval = clopper_pearson(k, n, 0.95);
        (n > 0).then(|| Rate { k, n, rate: k as f64 / n as f64, interval })
    }
}

/// Rates by question.
pub type Rates = BTreeMap<String, Rate>;
/// Rates by name, then by strength.
pub type ByStrength = BTreeMap<String, BTreeMap<String, Rates>>;

/// Scores of a whole trial.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Scores {
    pub sets: usize,
    /// By kind of set, "WORLD/CELL"; single causes without a name in the catalogue are "WORLD/nameless".
    pub by_kind: BTreeMap<String, Rates>,
    /// Single causes by kind and strength, nats (in the light world the size that was ordered).
    pub by_strength: ByStrength,
    /// Single causes by name and strength; those outside the catalogue by form.
    pub by_effect: ByStrength,
    /// Detected single causes: what was hidden, what was said first, how often.
    pub confusion: BTreeMap<String, BTreeMap<String, usize>>,
    /// Medians over all overlaps and all parameters.
    pub overlap: Option<f64>,
    pub parameter_error: Option<f64>,
    /// Stated 90 % intervals that hold the truth.
    pub coverage: Option<Rate>,
    /// Stated probabilities of best names against how often they are right.
    pub calibration: Vec<Bin>,
    /// Expected calibration error over the bins, and the Brier score.
    pub calibration_error: Option<f64>,
    pub brier: Option<f64>,
    /// Ratios to the oracle's gain by method, inside and outside the recording's distances and tilts.
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

/// One method's gains as ratios to the oracle's, over sets.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Ratio {
    /// Sets whose oracle gains something.
    pub n: usize,
    pub median: f64,
    /// 10th percentile.
    pub low: f64,
}

pub fn scores(sets: &[ProvenSet]) -> Scores {
    let all: Vec<&ProvenSet> = sets.iter().collect();
    let mut singles = all.clone();
    singles.retain(|s| matches!(s.truth.asked.cell, Cell::Single | Cell::Outside));
    let parameters = || sets.iter().flat_map(|s| &s.marks.parameters);
    let stated: Vec<&Stated> = sets.iter().flat_map(|s| &s.marks.stated).collect();
    let median = |values: Vec<f64>| quantile(&mut { values }, 0.5);
    let calibration = calibration(&stated);
    let mean = |sum: f64| (!stated.is_empty()).then(|| sum / stated.len() as f64);
    let off = calibration.iter().map(|b| (b.stated - b.right.rate).abs() * b.right.n as f64);
    let square = |s: &&Stated| (s.probability - f64::from(u8::from(s.right))).powi(2);
    Scores {
        sets: sets.len(),
        by_kind: grouped(&all, |s| Some(kind(&s.truth)), rates),
        by_strength: by_strength(&singles, kind),
        by_effect: by_strength(&singles, hidden_name),
        confusion: confusion(&singles),
        overlap: median(sets.iter().filter_map(|s| s.marks.overlap).collect()),
        parameter_error: median(parameters().map(|p| p.relative_error).collect()),
        coverage: Rate::of(parameters().filter_map(|p| p.covered)),
        calibration_error: mean(off.sum()),
        brier: mean(stated.iter().map(square).sum()),
        calibration,
        gains: gains(sets),
        advice: Rate::of(sets.iter().filter_map(|s| s.advised.as_ref()?.marks.settled)),
        endpoints: endpoints(sets),
    }
}

/// Strengths that can be ordered, nats.
const LEVELS: [f64; 6] = [5.0, 15.0, 50.0, 150.0, 500.0, 5000.0];

/// Worth of the weakest hidden cause, as the nearest of the strengths that can be ordered; by what its world
/// says it reached, otherwise by what was ordered.
pub fn level(truth: &Truth) -> Option<f64> {
    let nats = truth.hidden.iter().filter_map(|h| h.nats.or(truth.asked.nats));
    let min = nats.reduce(f64::min).filter(|n| *n > 0.0)?;
    let away = |l: &f64| (min / l).ln().abs();
    LEVELS.into_iter().min_by(|a, b| away(a).total_cmp(&away(b)))
}

/// Name of a variant as in the files.
pub fn word(of: impl Serialize) -> String {
    serde_json::to_value(of).ok().and_then(|v| v.as_str().map(String::from)).unwrap_or_default()
}

/// Kind of a set. Switches of the light world that have no name in the catalogue are kept apart: no name
/// said of them can be right.
fn kind(truth: &Truth) -> String {
    let (world, cell) = (word(truth.asked.world), truth.asked.cell);
    let nameless = truth.hidden.iter().all(|h| h.names.is_empty());
    match cell {
        Cell::Single if nameless => format!("{world}/nameless"),
        cell => format!("{world}/{}", word(cell)),
    }
}

fn hidden_name(truth: &Truth) -> String {
    truth.hidden.iter().map(Hidden::name).collect::<Vec<_>>().join("+")
}

/// Applies `of` to each group of sets that share a key.
fn grouped<T>(
    sets: &[&ProvenSet],
    key: impl Fn(&ProvenSet) -> Option<String>,
    of: impl Fn(&[&ProvenSet]) -> T,
) -> BTreeMap<String, T> {
    let mut groups: BTreeMap<String, Vec<&ProvenSet>> = BTreeMap::new();
    for set in sets {
        if let Some(key) = key(set) {
            groups.entry(key).or_default().push(set);
        }
    }
    groups.into_iter().map(|(key, sets)| (key, of(&sets))).collect()
}

fn rates(sets: &[&ProvenSet]) -> Rates {
    let mut answers: BTreeMap<&String, Vec<bool>> = BTreeMap::new();
    for (question, yes) in sets.iter().flat_map(|s| &s.marks.answers) {
        answers.entry(question).or_default().push(*yes);
    }
    let rate = |(q, all): (&String, Vec<bool>)| Some((q.clone(), Rate::of(all.into_iter())?));
    answers.into_iter().filter_map(rate).collect()
}

fn by_strength(singles: &[&ProvenSet], key: fn(&Truth) -> String) -> ByStrength {
    let strength = |s: &ProvenSet| level(&s.truth).map(|l| format!("{:04}", l as u32));
    grouped(singles, |s| Some(key(&s.truth)), |sets| grouped(sets, strength, rates))
}

fn confusion(singles: &[&ProvenSet]) -> BTreeMap<String, BTreeMap<String, usize>> {
    let detected = |s: &ProvenSet| s.marks.answers.get("detected") == Some(&true);
    let hidden = |s: &ProvenSet| detected(s).then(|| hidden_name(&s.truth));
    grouped(singles, hidden, |sets| {
        grouped(sets, |s| Some(s.marks.first.clone()), |sets| sets.len())
    })
}

/// Ten bins of equal width.
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

/// Minimum gain of the oracle, nats per 1000 pixels; below it a ratio to it means nothing. It is 15 nats
/// over a recording of 1.5 million pixels, 20 small views of 4 frames.
const MIN_ORACLE: f64 = 0.01;

/// Gain of `method` over the oracle's; `None` without the method or where the oracle gains too little.
pub fn ratio(gains: &Gains, method: &str, side: fn(&Gain) -> f64) -> Option<f64> {
    let (gain, oracle) = (side(gains.methods.get(method)?), side(&gains.oracle));
    (oracle >= MIN_ORACLE).then(|| gain / oracle).filter(|r| r.is_finite())
}

pub const SIDES: [fn(&Gain) -> f64; 2] = [|g| g.within, |g| g.beyond];

fn gains(sets: &[ProvenSet]) -> BTreeMap<String, [Option<Ratio>; 2]> {
    let all = || sets.iter().filter_map(|s| s.gains.as_ref());
    let of = |name: &str, side: fn(&Gain) -> f64| {
        let mut ratios: Vec<f64> = all().filter_map(|g| ratio(g, name, side)).collect();
        let (median, low) = (quantile(&mut ratios, 0.5)?, quantile(&mut ratios, 0.1)?);
        Some(Ratio { n: ratios.len(), median, low })
    };
    let names = all().flat_map(|g| g.methods.keys());
    names.map(|n| (n.clone(), SIDES.map(|side| of(n, side)))).collect()
}
