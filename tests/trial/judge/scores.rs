//! All sets together: rates with their intervals, by every grouping that is asked for.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::certainty::Certainty;
use super::endpoints::{Endpoint, endpoints};
use super::learnt::{Learnt, learnt};
use super::marks::{Marks, names_alone};
use crate::gains::Gains;
use crate::raytraced::question::{Cell, Truth, World};
use kinoise::stats::{clopper_pearson, quantile};

/// A set that was judged.
#[derive(Debug, Clone, Copy)]
pub struct Judged<'a> {
    pub truth: &'a Truth,
    pub marks: &'a Marks,
    pub gains: Option<&'a Gains>,
    /// Ids of the catalogue by baseline, best first.
    pub named_by_others: &'a BTreeMap<String, Vec<String>>,
}

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

/// Rates by the name of the mark.
pub type Rates = BTreeMap<String, Rate>;

/// The whole trial.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Scores {
    pub sets: usize,
    pub all: Rates,
    pub by_cell: BTreeMap<String, Rates>,
    pub by_world: BTreeMap<String, Rates>,
    /// World and cell, "rays/single".
    pub by_world_and_cell: BTreeMap<String, Rates>,
    /// Single causes made by rays, in the catalogue and outside it, by what they are worth, nats.
    pub by_nats: BTreeMap<String, Rates>,
    /// Single causes by kind ("rays/single", "rays/outside", "light/single", "light/nameless") and
    /// strength: nats, but in the world of light the size that was ordered.
    #[serde(default)]
    pub by_strength: BTreeMap<String, BTreeMap<String, Rates>>,
    /// Single causes by name; those outside the catalogue by form.
    pub by_effect: BTreeMap<String, Rates>,
    /// Of single causes: what was hidden, what was said first, how often.
    pub confusion: BTreeMap<String, BTreeMap<String, usize>>,
    /// Of pairs and triples: harmonic mean of the names' precision and recall.
    pub names_f1: Option<f64>,
    /// Medians over all sets.
    pub overlap: Option<f64>,
    pub parameter_error: Option<f64>,
    /// Stated 90 % intervals that hold the truth.
    pub coverage: Option<Rate>,
    /// Of every finding's best name.
    pub certainty: Certainty,
    /// Of every name offered.
    pub certainty_of_all: Certainty,
    pub learnt: BTreeMap<String, Learnt>,
    /// The names that baselines give, by baseline.
    pub others: BTreeMap<String, Rates>,
    pub endpoints: Vec<Endpoint>,
}

/// Score all sets.
pub fn scores(sets: &[Judged<'_>]) -> Scores {
    let single = |s: &&Judged<'_>| matches!(s.truth.asked.cell, Cell::Single | Cell::Outside);
    let singles: Vec<Judged<'_>> = sets.iter().filter(single).copied().collect();
    let by_rays = |s: &&Judged<'_>| s.truth.asked.world == World::Rays;
    let of_rays: Vec<Judged<'_>> = singles.iter().filter(by_rays).copied().collect();
    let parameters = || sets.iter().flat_map(|s| &s.marks.parameters);
    let stated = || sets.iter().flat_map(|s| &s.marks.stated);
    let mut overlaps: Vec<f64> = sets.iter().filter_map(|s| s.marks.overlap).collect();
    let mut errors: Vec<f64> = parameters().map(|p| p.relative_error).collect();
    let gains: Vec<&Gains> = sets.iter().filter_map(|s| s.gains).collect();
    Scores {
        sets: sets.len(),
        all: rates(sets.iter()),
        by_cell: grouped(sets, |t| Some(word(t.asked.cell))),
        by_world: grouped(sets, |t| Some(word(t.asked.world))),
        by_world_and_cell: grouped(sets, |t| {
            Some(format!("{}/{}", word(t.asked.world), word(t.asked.cell)))
        }),
        by_nats: grouped(&of_rays, strength),
        by_strength: by_strength(&singles),
        by_effect: grouped(&singles, |t| Some(hidden_name(t))),
        confusion: confusion(&singles),
        names_f1: names_f1(sets),
        overlap: quantile(&mut overlaps, 0.5),
        parameter_error: quantile(&mut errors, 0.5),
        coverage: Rate::of(parameters().filter_map(|p| p.covered)),
        certainty: Certainty::of(stated().filter(|s| s.best)),
        certainty_of_all: Certainty::of(stated()),
        learnt: learnt(&gains),
        others: others(sets),
        endpoints: endpoints(sets),
    }
}

/// Strengths as they are ordered, nats.
pub const LEVELS: [f64; 6] = [5.0, 15.0, 50.0, 150.0, 500.0, 5000.0];

/// What the weakest hidden cause is worth, as the nearest of the strengths that are ordered; what
/// its world says it reached, else what was ordered.
pub fn level(truth: &Truth) -> Option<f64> {
    let nats = truth.hidden.iter().filter_map(|h| h.nats.or(truth.asked.nats));
    let least = nats.reduce(f64::min).filter(|n| *n > 0.0)?;
    let away = |l: &f64| (least / l).ln().abs();
    LEVELS.into_iter().min_by(|a, b| away(a).total_cmp(&away(b)))
}

/// The least strength at which a cause is worth knowing, nats.
const WORTH_NATS: f64 = 50.0;

/// Every hidden cause is worth [`WORTH_NATS`] or more, rounded as [`level`] does; `false` where nothing
/// is hidden.
pub fn worth(truth: &Truth) -> bool {
    level(truth).is_some_and(|nats| nats >= WORTH_NATS)
}

fn strength(truth: &Truth) -> Option<String> {
    level(truth).map(|l| format!("{:04}", l as u32))
}

/// A switch of the world of light that has no name in the catalogue stands apart: its name cannot be
/// right.
fn kind(truth: &Truth) -> String {
    let nameless = truth.hidden.iter().all(|h| h.names.is_empty());
    match truth.asked.world {
        World::Light if nameless => "light/nameless".into(),
        world => format!("{}/{}", word(world), word(truth.asked.cell)),
    }
}

fn by_strength(singles: &[Judged<'_>]) -> BTreeMap<String, BTreeMap<String, Rates>> {
    let mut kinds: BTreeMap<String, Vec<Judged<'_>>> = BTreeMap::new();
    for set in singles {
        kinds.entry(kind(set.truth)).or_default().push(*set);
    }
    kinds.into_iter().map(|(kind, sets)| (kind, grouped(&sets, strength))).collect()
}

/// As in the files.
pub(super) fn word(of: impl Serialize) -> String {
    serde_json::to_value(of).ok().and_then(|v| v.as_str().map(String::from)).unwrap_or_default()
}

fn hidden_name(truth: &Truth) -> String {
    let names: Vec<&str> = truth
        .hidden
        .iter()
        .map(|h| h.names.first().map_or(h.form.as_str(), String::as_str))
        .collect();
    if names.is_empty() { "nothing".into() } else { names.join("+") }
}

fn rates<'a>(sets: impl Iterator<Item = &'a Judged<'a>>) -> Rates {
    let mut answers: BTreeMap<&str, Vec<bool>> = BTreeMap::new();
    for set in sets {
        for (name, answer) in set.marks.yes_no() {
            answers.entry(name).or_default().extend(answer);
        }
    }
    answers.into_iter().filter_map(|(k, v)| Some((k.into(), Rate::of(v.into_iter())?))).collect()
}

fn grouped(sets: &[Judged<'_>], key: impl Fn(&Truth) -> Option<String>) -> BTreeMap<String, Rates> {
    let mut groups: BTreeMap<String, Vec<&Judged<'_>>> = BTreeMap::new();
    for set in sets {
        if let Some(key) = key(set.truth) {
            groups.entry(key).or_default().push(set);
        }
    }
    groups.into_iter().map(|(key, sets)| (key, rates(sets.into_iter()))).collect()
}

fn confusion(singles: &[Judged<'_>]) -> BTreeMap<String, BTreeMap<String, usize>> {
    let mut table: BTreeMap<String, BTreeMap<String, usize>> = BTreeMap::new();
    for set in singles {
        let row = table.entry(hidden_name(set.truth)).or_default();
        *row.entry(set.marks.first.clone()).or_insert(0) += 1;
    }
    table
}

/// A baseline's names, judged as ours are.
fn others(sets: &[Judged<'_>]) -> BTreeMap<String, Rates> {
    let mut marks: BTreeMap<String, Vec<(&str, bool)>> = BTreeMap::new();
    for set in sets {
        for (baseline, names) in set.named_by_others {
            marks.entry(baseline.clone()).or_default().extend(names_alone(set.truth, names));
        }
    }
    let of = |all: &[(&str, bool)], mark: &str| {
        Rate::of(all.iter().filter(|m| m.0 == mark).map(|m| m.1)).map(|r| (mark.to_string(), r))
    };
    marks
        .into_iter()
        .map(|(baseline, all)| {
            let rates = ["false_alarm", "detected", "first_name", "exact"];
            (baseline, rates.into_iter().filter_map(|m| of(&all, m)).collect())
        })
        .collect()
}

fn names_f1(sets: &[Judged<'_>]) -> Option<f64> {
    let several = |s: &&Judged<'_>| matches!(s.truth.asked.cell, Cell::Pair | Cell::Triple);
    let (mut right, mut all) = (0, 0);
    for set in sets.iter().filter(several) {
        let names = set.marks.names;
        right += 2 * names.right;
        all += names.hidden + names.said;
    }
    (all > 0).then(|| right as f64 / all as f64)
}
