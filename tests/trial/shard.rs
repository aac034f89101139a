//! A trial in parts, each on its own machine: a shard makes, commits to, diagnoses and examines every n-th
//! set of the plan. The merge puts the shards' files where an interrupted trial would have left them and
//! resumes from there: the second round, which depends on all verdicts of the first, and the judge run
//! there. So a merged trial equals the single one byte for byte, except for the seconds.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use kinoise::Error;
use kinoise::error::Result;
use serde::{Deserialize, Serialize};

use crate::commitment::{Commitments, Verdicts, hash_file, read_json, write_json};
use crate::plan::{Planned, plan};
use crate::proof::{Order, PROOF};
use crate::rounds::{Progress, Round, refused, take};
use crate::trial::Trial;

/// Written last: an interrupted shard has none.
const SHARD: &str = "shard.json";
const FORMAT: &str = "kinoise-shard/1";
/// Folders of a shard that an interrupted trial would have too.
const FOLDERS: [&str; 6] =
    ["work/commitments", "work/verdicts", "work/models", "work/gains", "diagnoses", "kept"];

/// Part `index` of `of`, counted from one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shard {
    pub index: usize,
    pub of: usize,
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let numbers = text.split_once('/').map(|(i, n)| (i.parse().ok(), n.parse().ok()));
        match numbers {
            Some((Some(index), Some(of))) if (1..=of).contains(&index) => Ok(Shard { index, of }),
            _ => Err("give I/N, the part I of N: 1/8 to 8/8".into()),
        }
    }
}

impl Shard {
    /// Every n-th set of the plan, so that all shards have about the same mixture.
    fn part(self, planned: Vec<Planned>) -> Vec<Planned> {
        planned.into_iter().skip(self.index - 1).step_by(self.of).collect()
    }
}

/// Description of a finished shard.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Finished {
    format: String,
    shard: Shard,
    /// Order of the whole trial.
    order: Order,
    binary_sha256: String,
    limit_s: u64,
    /// SHA-256 of `commitments.json` and `verdicts.json`.
    published: [String; 2],
}

/// Runs one part of the trial, or resumes one that was interrupted.
pub fn hold_shard(trial: &Trial, shard: Shard, progress: Progress<'_>) -> Result<()> {
    let planned = shard.part(plan(&trial.order));
    if planned.is_empty() {
        return Err(Error::Argument {
            what: format!(
                "shard {} of {}: the trial has {} sets only",
                shard.index, shard.of, trial.order.sets
            ),
            remedy: "give as many shards as there are sets, or fewer",
        });
    }
    let out = &trial.output;
    std::fs::create_dir_all(out).map_err(|e| Error::write(out, e))?;
    for (file, what) in [(SHARD, "a finished shard is here"), (PROOF, "a finished trial is here")] {
        if out.join(file).exists() {
            return Err(refused(out, what));
        }
    }
    let binary_sha256 = hash_file(&trial.program)?;
    let sets = take(&planned, trial.data.as_deref(), progress)?;
    let round = Round { trial, binary_sha256: &binary_sha256, index: 0, progress };
    let done = round.run(&sets, None)?;
    round.examine_all(&sets, &done.commitments)?;
    let finished = Finished {
        format: FORMAT.into(),
        shard,
        order: trial.order.clone(),
        limit_s: trial.limit.as_secs(),
        published: done.published,
        binary_sha256,
    };
    write_json(&out.join(SHARD), &finished)?;
    Ok(())
}

fn fault(path: &Path, what: impl Into<String>, remedy: &'static str) -> Error {
    Error::recording(path, what, remedy)
}

/// Merges the shards in these folders into `output`, ready for the trial to resume. Returns the order and
/// the limit of one diagnosis, s.
///
/// # Errors
/// When a shard is missing, given twice, unfinished, changed since, or of another trial or build.
pub fn gather(folders: &[PathBuf], program: &Path, output: &Path) -> Result<(Order, u64)> {
    let mut shards: BTreeMap<usize, (&PathBuf, Finished)> = BTreeMap::new();
    for folder in folders {
        let finished = read(folder)?;
        if let Some((_, first)) = shards.values().next() {
            same_trial(folder, &finished, first)?;
        }
        let index = finished.shard.index;
        if let Some((twin, _)) = shards.insert(index, (folder, finished)) {
            return Err(fault(
                folder,
                format!("shard {index} is here, and also in {}", twin.display()),
                "give each shard once",
            ));
        }
    }
    let Some((folder, first)) = shards.values().next() else {
        return Err(Error::Argument {
            what: "no shard was given".into(),
            remedy: "give the folders of all shards: --merge DIR1 DIR2 ...",
        });
    };
    let missing: Vec<String> = (1..=first.shard.of)
        .filter(|i| !shards.contains_key(i))
        .map(|i| format!("{i}/{}", first.shard.of))
        .collect();
    if !missing.is_empty() {
        return Err(Error::Argument {
            what: format!("shards are missing: {}", missing.join(", ")),
            remedy: "hold them with --shard, and give the folders of all",
        });
    }
    if hash_file(program)? != first.binary_sha256 {
        return Err(fault(
            folder,
            "it was held by another build than this",
            "merge with the build that held the shards",
        ));
    }
    std::fs::create_dir_all(output).map_err(|e| Error::write(output, e))?;
    if output.join(PROOF).exists() {
        return Err(refused(output, "a finished trial is here"));
    }
    for (folder, finished) in shards.values() {
        check(folder, finished)?;
    }
    for (folder, _) in shards.values() {
        for name in FOLDERS {
            copy(&folder.join(name), &output.join(name))?;
        }
    }
    Ok((first.order.clone(), first.limit_s))
}

fn read(folder: &Path) -> Result<Finished> {
    let path = folder.join(SHARD);
    if !path.exists() {
        return Err(fault(
            folder,
            "no finished shard is here",
            "hold it, or go on with it, by ./run prove --shard I/N with the same -o, --sets and --seed",
        ));
    }
    let (finished, _): (Finished, _) = read_json(&path)?;
    let Shard { index, of } = finished.shard;
    if finished.format != FORMAT || !(1..=of).contains(&index) {
        return Err(fault(&path, "this is no shard of this version", "hold the shard again"));
    }
    finished.order.check()?;
    Ok(finished)
}

fn same_trial(folder: &Path, shard: &Finished, first: &Finished) -> Result<()> {
    let differs = if shard.order != first.order {
        "it is of another trial: sets, seed or real recordings differ"
    } else if shard.shard.of != first.shard.of {
        "it is of another number of shards"
    } else if shard.limit_s != first.limit_s {
        "its diagnoses had another limit of time"
    } else if shard.binary_sha256 != first.binary_sha256 {
        "it was held by another build"
    } else {
        return Ok(());
    };
    Err(fault(folder, differs, "give the shards of one trial, all held alike"))
}

/// Checks that the published files are those that the shard wrote, and that what is to be merged matches
/// them: every set of its part, each with the verdict that was hashed.
fn check(folder: &Path, finished: &Finished) -> Result<()> {
    const REMEDY: &str = "hold this shard again, in a new folder";
    let (commitments, c): (Commitments, _) = read_json(&folder.join("commitments.json"))?;
    let (verdicts, v): (Verdicts, _) = read_json(&folder.join("verdicts.json"))?;
    if [c, v] != finished.published {
        return Err(fault(folder, "a file was changed after it was published", REMEDY));
    }
    let part = finished.shard.part(plan(&finished.order));
    let names = |set: &Planned| set.name.clone();
    let whole = part.iter().map(names).eq(commitments.sets.iter().map(|s| s.name.clone()))
        && part.iter().map(names).eq(verdicts.verdicts.iter().map(|s| s.name.clone()));
    if !whole {
        return Err(fault(folder, "it holds other sets than the plan gives it", REMEDY));
    }
    for (committed, verdict) in commitments.sets.iter().zip(&verdicts.verdicts) {
        let name = &committed.name;
        let kept = folder.join("work/commitments").join(format!("{}.json", committed.truth_sha256));
        let (kept, _): (crate::commitment::Committed, _) = read_json(&kept)?;
        let solved = folder.join("work/verdicts").join(format!("{name}.json"));
        let (solved, _): (crate::solver::Solved, _) = read_json(&solved)?;
        let same = kept == *committed && solved.answer.diagnosis_sha256 == verdict.diagnosis_sha256;
        let diagnosis = folder.join("diagnoses").join(format!("{name}.json"));
        let hashed = match &verdict.diagnosis_sha256 {
            Some(hash) => hash_file(&diagnosis)? == *hash,
            None => true,
        };
        if !same || !hashed {
            return Err(fault(
                folder,
                format!("set {name} was changed after it was published"),
                REMEDY,
            ));
        }
    }
    Ok(())
}

fn copy(from: &Path, to: &Path) -> Result<()> {
    if !from.is_dir() {
        return Ok(());
    }
    fs::create_dir_all(to).map_err(|e| Error::write(to, e))?;
    for entry in fs::read_dir(from).map_err(|e| Error::read(from, e))? {
        let entry = entry.map_err(|e| Error::read(from, e))?;
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &target)?;
        } else {
            fs::copy(entry.path(), &target).map_err(|e| Error::write(&target, e))?;
        }
    }
    Ok(())
}
