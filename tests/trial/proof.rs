//! `proof.json`: commitments, answers, truths and scores of a finished trial; and `summary.json`, one row
//! per set, for readers with questions of their own.

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
    /// SHA-256 of the four published files: the first round's commitments and verdicts, then the second's.
    /// Each file was written before the step that it commits to.
    pub published: Vec<String>,
    pub commitments: [Commitments; 2],
    /// What confined the solver, and in how many diagnoses.
    pub confinement: BTreeMap<String, usize>,
    /// In the order of the plan.
    pub sets: Vec<ProvenSet>,
}

/// What the trial was made from; the same order gives the same sets.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Order {
    pub sets: usize,
    pub seed: u64,
    /// Whether some sets are made of real recordings.
    pub real: bool,
}

/// The largest trial so far had 1000; at seconds of a core per set, this many take a week.
const MAX_SETS: usize = 100_000;

impl Order {
    /// Fails on zero sets, and on so many that the plan alone would fill the memory.
    pub fn check(&self) -> Result<()> {
        if (1..=MAX_SETS).contains(&self.sets) {
            return Ok(());
        }
        let what = format!("{} sets are no trial", self.sets);
        Err(Error::Argument { what, remedy: "give 1 to 100000 sets" })
    }
}

/// Everything recorded about one set.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ProvenSet {
    pub name: String,
    pub truth: Truth,
    #[serde(flatten)]
    pub answer: Answer,
    pub marks: Marks,
    pub gains: Option<Gains>,
    /// Outcome with the view that the diagnosis asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub advised: Option<Advised>,
    /// Duration of the diagnosis; nothing else here depends on the machine.
    pub seconds: f64,
}

/// The set diagnosed again with the advised view.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Advised {
    #[serde(flatten)]
    pub answer: Answer,
    pub marks: AdviceMarks,
}

impl Proof {
    /// Reads `proof.json` of a folder.
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

    /// The sets of a round, 0 or 1, with their answers.
    pub fn answers(&self, round: usize) -> impl Iterator<Item = (&ProvenSet, &Answer)> {
        self.sets.iter().filter_map(move |set| {
            let answer = if round == 0 { &set.answer } else { &set.advised.as_ref()?.answer };
            Some((set, answer))
        })
    }

    /// One row per set: the truth, the findings and the marks.
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
