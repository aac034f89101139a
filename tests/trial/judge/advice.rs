//! Whether the view that was advised did what it was advised for.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::scores::{Rate, Rates};
use crate::raytraced::question::{Truth, World};
use crate::verdict::{Said, Verdict};

/// Two causes are apart by so many standard errors.
const APART: f64 = 2.0;

/// One set before and after the view. `None`: the question does not arise.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct AdviceMarks {
    /// A second diagnosis came. One that did not settles nothing.
    pub ran: bool,
    /// The two names in doubt, the better first, with their probabilities before.
    pub doubt: Vec<(String, f64)>,
    /// Standard errors between them, as the advice expects them: before, and with the view.
    pub promised: Option<[f64; 2]>,
    /// What is said first, of the same statistic, with the view.
    pub after: String,
    /// Probability of the hidden name among the two, before and after; 0 where it is not offered.
    pub right: Option<[f64; 2]>,
    /// That name leads its finding, before and after.
    pub leads: Option<[bool; 2]>,
    /// Its probability rose.
    pub surer: Option<bool>,
    /// Afterwards it leads with 0.9 or more.
    pub settled: Option<bool>,
    /// Neither name in doubt is hidden, and afterwards a name that is not hidden has 0.9 or more.
    pub misled: Option<bool>,
}

impl AdviceMarks {
    /// Where the view was expected to tell the names apart.
    pub fn settled_as_promised(&self) -> Option<bool> {
        self.settled.filter(|_| self.promised.is_some_and(|p| p[1] >= APART))
    }

    fn yes_no(&self) -> [(&'static str, Option<bool>); 7] {
        [
            ("right_in_doubt", Some(self.right.is_some())),
            ("led_before", self.leads.map(|l| l[0])),
            ("leads_after", self.leads.map(|l| l[1])),
            ("surer", self.surer),
            ("settled", self.settled),
            ("settled_as_promised", self.settled_as_promised()),
            ("misled", self.misled),
        ]
    }
}

/// Judge one set's second verdict beside its first.
pub fn mark_advice(truth: &Truth, first: Option<&Value>, second: Option<&Value>) -> AdviceMarks {
    let read = |v: Option<&Value>| -> Option<Verdict> { serde_json::from_value(v?.clone()).ok() };
    let (before, after) = (read(first), read(second));
    let Some((before, doubted)) = before.as_ref().and_then(|v| Some((v, v.in_doubt()?))) else {
        return AdviceMarks::default();
    };
    // What another finding claims for itself is not what this one is about.
    let elsewhere =
        |id: &str| before.claims().any(|f| !std::ptr::eq(f, doubted) && f.name() == Some(id));
    let hidden = |id: &str| truth.hidden.iter().any(|h| h.names.iter().any(|n| n == id));
    let two = || doubted.alternatives.iter().take(2).map(|a| a.effect.as_str());
    let wanted: Vec<&str> = two().filter(|id| hidden(id) && !elsewhere(id)).collect();
    let same = |f: &&Said| f.statistic == doubted.statistic;
    let later = || after.iter().flat_map(Verdict::claims).filter(same);
    let offered = |f: &Said| {
        let of = |id: &&str| f.probability(id);
        wanted.iter().map(of).fold(0.0, f64::max)
    };
    let is_wanted = |f: &Said| f.name().is_some_and(|id| wanted.contains(&id));
    let asked = !wanted.is_empty();
    let right = [offered(doubted), later().map(offered).fold(0.0, f64::max)];
    let leads = [is_wanted(doubted), later().any(is_wanted)];
    let sure = |f: &Said| f.certain_name().is_some_and(|id| wanted.contains(&id));
    let wrong = |f: &Said| f.certain_name().is_some_and(|id| !hidden(id));
    AdviceMarks {
        ran: after.is_some(),
        doubt: doubted.offers().take(2).collect(),
        promised: doubted.separations(),
        after: later().next().map_or("nothing", |f| f.name().unwrap_or(&f.status)).into(),
        right: asked.then_some(right),
        leads: asked.then_some(leads),
        surer: asked.then_some(right[1] > right[0]),
        settled: asked.then(|| later().any(sure)),
        misled: (!asked).then(|| later().any(wrong)),
    }
}

/// All second verdicts together.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct AdviceScores {
    pub sets: usize,
    pub all: Rates,
    pub by_world: BTreeMap<String, Rates>,
}

pub fn advice_scores(sets: &[(World, &AdviceMarks)]) -> AdviceScores {
    let rates = |of: &[&AdviceMarks]| -> Rates {
        let names = AdviceMarks::default().yes_no().map(|m| m.0);
        let rate = |k: usize| Rate::of(of.iter().filter_map(|m| m.yes_no()[k].1));
        names.iter().enumerate().filter_map(|(k, n)| Some(((*n).to_string(), rate(k)?))).collect()
    };
    let mut worlds: BTreeMap<String, Vec<&AdviceMarks>> = BTreeMap::new();
    for (world, marks) in sets {
        worlds.entry(super::scores::word(*world)).or_default().push(marks);
    }
    AdviceScores {
        sets: sets.len(),
        all: rates(&sets.iter().map(|s| s.1).collect::<Vec<_>>()),
        by_world: worlds.into_iter().map(|(world, of)| (world, rates(&of))).collect(),
    }
}
