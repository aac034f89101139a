//! The trial: makes the sets and commits to them, diagnoses them, publishes the verdicts, takes the advised
//! views and diagnoses again, and only then opens the answers.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Duration;

use kinoise::error::Result;
use kinoise::io::write_atomic;

use crate::commitment::{hash_file, write_json};
use crate::judge::{mark, mark_advice, scores};
use crate::plan::plan;
use crate::proof::{Advised, FORMAT, Order, PROOF, Proof, ProvenSet, SUMMARY};
use crate::rounds::{Progress, Round, refused, remove, take, take_advised};

/// Options of a trial.
pub struct Trial {
    pub output: PathBuf,
    pub order: Order,
    /// Folder of real recordings.
    pub data: Option<PathBuf>,
    /// Keep every set and all that the solver wrote.
    pub keep: bool,
    /// The program that diagnoses.
    pub program: PathBuf,
    /// Time limit of one diagnosis.
    pub limit: Duration,
}

/// Runs the trial, or resumes one that was interrupted.
pub fn hold(trial: &Trial, progress: Progress<'_>) -> Result<Proof> {
    let out = &trial.output;
    std::fs::create_dir_all(out).map_err(|e| kinoise::Error::write(out, e))?;
    if out.join(PROOF).exists() {
        return Err(refused(out, "a finished trial is here"));
    }
    let binary_sha256 = &hash_file(&trial.program)?;
    let sets = take(&plan(&trial.order), trial.data.as_deref(), progress)?;
    let first = Round { trial, binary_sha256, index: 0, progress };
    let one = first.run(&sets, None)?;
    let verdicts = one.solved.iter().map(|s| s.answer.verdict.as_ref());
    let again = take_advised(&sets, verdicts, progress)?;
    let two = Round { index: 1, ..first }.run(&again, Some(&one.published[1]))?;
    // From here on the answers are open.
    let gains = first.examine_all(&sets, &one.commitments)?;
    let mut confinement = BTreeMap::new();
    for solved in one.solved.iter().chain(&two.solved) {
        *confinement.entry(solved.confinement.clone()).or_insert(0) += 1;
    }
    let mut again = again.iter().zip(two.solved).peekable();
    let mut proven = Vec::new();
    for ((set, solved), gains) in sets.into_iter().zip(one.solved).zip(gains) {
        let second = again.next_if(|(s, _)| s.name == set.name).map(|(_, s)| s.answer);
        let said = solved.answer.verdict.as_ref();
        let advised = second.map(|answer| Advised {
            marks: mark_advice(&set.truth, said, answer.verdict.as_ref()),
            answer,
        });
        proven.push(ProvenSet {
            name: set.name,
            marks: mark(&set.truth, said)?,
            truth: set.truth,
            answer: solved.answer,
            gains,
            advised,
            seconds: solved.seconds,
        });
    }
    let proof = Proof {
        format: FORMAT.into(),
        order: trial.order.clone(),
        scores: scores(&proven),
        published: [one.published, two.published].concat(),
        commitments: [one.commitments, two.commitments],
        confinement,
        sets: proven,
    };
    // On one line: pretty-printed, the rows would take twice the bytes.
    write_atomic(&out.join(SUMMARY), format!("{}\n", proof.summary()).as_bytes())?;
    write_json(&out.join(PROOF), &proof)?;
    remove(&out.join("work"))?;
    Ok(proof)
}
