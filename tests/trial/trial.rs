//! The trial: make the sets and commit to them, diagnose them, publish the verdicts, take the views
//! that were advised and diagnose again, and only then open the answers.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Duration;

use kinoise::error::Result;
use kinoise::io::OutputDir;

use crate::commitment::write_json;
use crate::judge::{mark, mark_advice, scores};
use crate::proof::{Advised, FORMAT, Order, PROOF, Proof, ProvenSet, SUMMARY};
use crate::rounds::{Progress, Round, refused, remove, take, take_advised};

/// What is wanted.
pub struct Trial {
    pub output: PathBuf,
    pub order: Order,
    /// Real recordings.
    pub data: Option<PathBuf>,
    /// Keep every set and all that the solver wrote.
    pub keep: bool,
    /// The program that diagnoses.
    pub program: PathBuf,
    /// Of one diagnosis.
    pub limit: Duration,
}

/// Hold the trial, or go on with one that was interrupted.
pub fn hold(trial: &Trial, progress: Progress<'_>) -> Result<Proof> {
    let out = OutputDir::create(&trial.output)?;
    if out.path().join(PROOF).exists() {
        return Err(refused(out.path(), "a finished trial is here"));
    }
    let sets = take(&trial.order, trial.data.as_deref(), progress)?;
    let first = Round { trial, root: out.path(), index: 0, progress };
    let one = first.run(&sets, None)?;
    let verdicts = one.solved.iter().map(|s| s.verdict.as_ref());
    let again = take_advised(&sets, verdicts, progress)?;
    let second = Round { index: 1, ..first };
    let two = second.run(&again, Some(&one.verdicts_sha256))?;
    // The answers are opened.
    let mut proven = Vec::new();
    let gains = first.examine_all(&sets, &one.commitments)?;
    for ((set, solved), gains) in sets.iter().zip(&one.solved).zip(gains) {
        let again = two.solved.iter().find(|s| s.name == set.name);
        let advised = again.map(|s| Advised {
            marks: mark_advice(&set.truth, solved.verdict.as_ref(), s.verdict.as_ref()),
            verdict: s.verdict.clone(),
            failure: s.failure.clone(),
            diagnosis_sha256: s.diagnosis_sha256.clone(),
        });
        proven.push(ProvenSet {
            name: set.name.clone(),
            marks: mark(&set.truth, solved.verdict.as_ref())?,
            truth: set.truth.clone(),
            verdict: solved.verdict.clone(),
            failure: solved.failure.clone(),
            diagnosis_sha256: solved.diagnosis_sha256.clone(),
            gains,
            advised,
            seconds: solved.seconds,
        });
    }
    let mut confinement = BTreeMap::new();
    for solved in one.solved.iter().chain(&two.solved) {
        *confinement.entry(solved.confinement.clone()).or_insert(0) += 1;
    }
    let proof = Proof {
        format: FORMAT.into(),
        order: trial.order.clone(),
        scores: scores(&proven),
        published: [
            one.commitments_sha256,
            one.verdicts_sha256,
            two.commitments_sha256,
            two.verdicts_sha256,
        ],
        commitments: [one.commitments, two.commitments],
        confinement,
        sets: proven,
    };
    write_json(&out.path().join(SUMMARY), &proof.summary())?;
    write_json(&out.path().join(PROOF), &proof)?;
    remove(&out.path().join("work"))?;
    Ok(proof)
}
