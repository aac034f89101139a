//! `proof.json`: everything that was committed to, said, opened and counted; and `summary.json`, a
//! row a set, for whoever has questions of their own.

use std::collections::BTreeMap;
use std::path::Path;

use kinoise::Error;
use kinoise::error::Result;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use crate::commitment::{Commitments, read_json};
use crate::gain::Gains;
use crate::judge::{AdviceMarks, Marks, Scores};
use crate::raytraced::question::Truth;
use crate::solver::Answer;

pub const FORMAT: &str = "kinoise-proof/2";
pub const PROOF: &str = "proof.json";
pub const SUMMARY: &str = "summary.json";

/// A finished trial.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Proof {
    pub format: String,
    pub order: Order,
    pub scores: Scores,
    /// Of the four files as they were written, each before what it commits to: the first round's
    /// commitments and verdicts, then the second's.
    pub published: Vec<String>,
    pub commitments: [Commitments; 2],
    /// What kept the solver from the rest of the machine, and for how many sets.
    pub confinement: BTreeMap<String, usize>,
    /// In the order in which they were put.
    pub sets: Vec<ProvenSet>,
}

/// What the trial was made from: the same again gives the same sets.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Order {
    pub sets: usize,
    pub seed: u64,
    /// With real recordings.
    pub real: bool,
}

/// The largest trial so far had 1000; a set takes seconds of a core, so many as this a week.
const MAX_SETS: usize = 100_000;

impl Order {
    /// An error when nobody can hold a trial of so many sets: the plan alone would fill the memory.
    pub fn check(&self) -> Result<()> {
        if (1..=MAX_SETS).contains(&self.sets) {
            return Ok(());
        }
        let what = format!("{} sets are no trial", self.sets);
        Err(Error::Argument { what, remedy: "give 1 to 100000 sets" })
    }
}

/// One set with everything about it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProvenSet {
    pub name: String,
    pub truth: Truth,
    #[serde(flatten)]
    pub answer: Answer,
    pub marks: Marks,
    pub gains: Option<Gains>,
    /// What came of the view that the diagnosis asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub advised: Option<Advised>,
    /// The diagnosis took so long; nothing else here depends on the machine.
    pub seconds: f64,
}

/// The set once more, with the view that was advised.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Advised {
    #[serde(flatten)]
    pub answer: Answer,
    pub marks: AdviceMarks,
}

impl Proof {
    /// Read `proof.json` of a folder.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(PROOF);
        let (proof, _): (Proof, _) = read_json(&path)?;
        if proof.format != FORMAT || proof.published.len() != 4 {
            return Err(Error::Text {
                path,
                line: 0,
                what: format!("format \"{}\"", proof.format),
                remedy: "give the folder of a trial made by this version",
            });
        }
        proof.order.check()?;
        Ok(proof)
    }

    /// The sets of a round, 0 or 1, and what was said to them.
    pub fn answers(&self, round: usize) -> impl Iterator<Item = (&ProvenSet, &Answer)> {
        self.sets.iter().filter_map(move |set| {
            let answer = if round == 0 { &set.answer } else { &set.advised.as_ref()?.answer };
            Some((set, answer))
        })
    }

    /// A row a set: the truth, what was said, how it was judged.
    pub fn summary(&self) -> Value {
        json!({"order": self.order, "scores": self.scores,
            "sets": self.sets.iter().map(row).collect::<Vec<_>>()})
    }
}

fn row(set: &ProvenSet) -> Value {
    let asked = &set.truth.asked;
    let hidden = set.truth.hidden.iter().map(|h| {
        json!({"names": h.names, "form": h.form, "statistic": h.statistic, "axis": h.axis,
            "nats": h.nats})
    });
    let verdict = set.answer.verdict.as_ref();
    let findings = verdict.and_then(|v| v.get("findings")?.as_array());
    let found = findings.into_iter().flatten().map(|f| {
        let keys = ["status", "effect", "alternatives", "statistic", "axis", "share", "size"];
        keys.iter().map(|k| ((*k).to_string(), f[*k].clone())).collect::<Map<_, _>>()
    });
    json!({
        "name": set.name, "world": asked.world, "cell": asked.cell, "nats": asked.nats,
        "picture_px": if asked.small { [160, 120] } else { [320, 240] },
        "hidden": hidden.collect::<Vec<_>>(),
        "verdict": verdict.map(|v| v["verdict"].clone()),
        "findings": found.collect::<Vec<_>>(),
        "first": set.marks.first, "answers": set.marks.answers,
        "gains": set.gains, "failure": set.answer.failure, "seconds": set.seconds,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trial_of_no_sets_or_of_more_than_memory_holds_is_refused() {
        for (sets, holds) in
            [(0, false), (1, true), (MAX_SETS, true), (MAX_SETS + 1, false), (usize::MAX, false)]
        {
            let checked = Order { sets, seed: 1, real: false }.check();
            assert_eq!(checked.is_ok(), holds, "{sets}");
            assert!(holds || checked.unwrap_err().to_string().contains("give 1 to 100000 sets"));
        }
    }
}
