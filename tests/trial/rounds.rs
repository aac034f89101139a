//! One round over sets: make them, commit to them, diagnose them and publish the verdicts. A trial has two
//! rounds. Finished work is kept under `work/`, so that an interrupted trial can resume.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use kinoise::error::Result;
use kinoise::io::sha256_hex;
use kinoise::{Error, NoiseModel};
use rayon::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::commitment::{
    Commitments, Committed, VerdictHash, Verdicts, hash_folder, hash_json, read_json, write_json,
};
use crate::gain::{Gains, examine};
use crate::judge::{advised_view, endpoints_in_words};
use crate::plan::{Planned, conceal, learn};
use crate::raytraced::question::{ConcealedSet, Pose, Truth, World};
use crate::solver::{Solved, solve};
use crate::trial::Trial;

/// Current step, number done, total.
pub type Progress<'a> = &'a (dyn Fn(&'static str, usize, usize) + Sync);

/// A set that is ready, with its truth.
pub struct Taken {
    pub name: String,
    pub truth: Truth,
    pub sealed: Box<dyn ConcealedSet>,
    /// In the second round: the view that was advised and the one that was taken.
    pub view: Option<[Pose; 2]>,
}

/// Suffixes of the files and folders of the two rounds.
pub const ROUNDS: [&str; 2] = ["", "-advised"];
/// Maximum number of sets in the second round, in the order of the trial.
const MAX_ADVISED: usize = 40;
/// The baselines learn from one set in this many, chosen by the set's seed: they take longer than
/// everything else.
const BASELINES_IN: u64 = 3;

/// Makes the planned sets; `data` is the folder of the real recordings.
pub fn take(
    planned: &[Planned],
    data: Option<&Path>,
    progress: Progress<'_>,
) -> Result<Vec<Taken>> {
    let known = learn(planned, data)?;
    each(planned, ("making sets", progress), |planned| {
        let sealed = conceal(&planned.asked, &known)?;
        Ok(Taken { name: planned.name.clone(), truth: sealed.truth(), sealed, view: None })
    })
}

/// The sets whose verdicts advise a view, with that view added. Real recordings are skipped: their sessions
/// ended long ago.
pub fn take_advised<'a>(
    sets: &[Taken],
    verdicts: impl Iterator<Item = Option<&'a serde_json::Value>>,
    progress: Progress<'_>,
) -> Result<Vec<Taken>> {
    let simulated = sets.iter().zip(verdicts).filter(|(s, _)| s.truth.asked.world != World::Real);
    let asked: Vec<(&Taken, Pose)> =
        simulated.filter_map(|(set, v)| Some((set, advised_view(v?)?))).take(MAX_ADVISED).collect();
    each(&asked, ("taking advised views", progress), |(set, advised)| {
        let taken = set.sealed.with_view(advised)?;
        let (pose, sealed) = taken.ok_or_else(|| Error::Argument {
            what: format!("set {}: its world takes no view more", set.name),
            remedy: "report this as a fault",
        })?;
        let (name, truth) = (set.name.clone(), set.truth.clone());
        Ok(Taken { name, truth, sealed, view: Some([*advised, pose]) })
    })
}

impl Taken {
    /// Clears `scratch` and writes the set into `scratch/set`; returns what may be published of it.
    pub fn make(&self, scratch: &Path) -> Result<Committed> {
        remove(scratch)?;
        let set = scratch.join("set");
        make_folder(&set)?;
        self.sealed.write(&set)?;
        let (name, truth_sha256) = (self.name.clone(), hash_json(&self.truth));
        Ok(Committed { name, data_sha256: hash_folder(&set)?, truth_sha256, view: self.view })
    }

    /// Gain of `model` on the set's exam views; `None` where it has none. The set must lie in `scratch/set`.
    pub fn gains(&self, scratch: &Path, model: &NoiseModel) -> Result<Option<Gains>> {
        let views = self.sealed.exam();
        if views.is_empty() {
            return Ok(None);
        }
        let baselines = self.truth.asked.seed.is_multiple_of(BASELINES_IN);
        examine(&views, &scratch.join("set"), model, baselines).map(Some)
    }
}

/// One round over sets: commits, diagnoses and publishes.
#[derive(Clone, Copy)]
pub struct Round<'a> {
    pub trial: &'a Trial,
    pub binary_sha256: &'a str,
    /// Index into [`ROUNDS`].
    pub index: usize,
    pub progress: Progress<'a>,
}

/// Outcome of a round, and the hashes of the two files that it published.
pub struct Done {
    pub commitments: Commitments,
    pub solved: Vec<Solved>,
    pub published: [String; 2],
}

impl Round<'_> {
    fn named(&self, stem: &str) -> PathBuf {
        self.trial.output.join(format!("{stem}{}", ROUNDS[self.index]))
    }

    /// Path of a set's file in `folder`, which is created if missing.
    fn file(&self, folder: &str, name: &str) -> Result<PathBuf> {
        let folder = self.named(folder);
        make_folder(&folder)?;
        Ok(folder.join(format!("{name}.json")))
    }

    /// Result of `work` for a set: read back if stored by an interrupted run, else computed and stored.
    fn once<T: Serialize + DeserializeOwned>(
        &self,
        kind: &str,
        name: &str,
        work: impl FnOnce() -> Result<T>,
    ) -> Result<T> {
        let path = self.file(&format!("work/{kind}"), name)?;
        if let Ok((known, _)) = read_json(&path) {
            return Ok(known);
        }
        let outcome = work()?;
        write_json(&path, &outcome)?;
        Ok(outcome)
    }

    /// Scratch folder of this process: an interrupted one may still write to its own.
    fn scratch(&self, name: &str) -> PathBuf {
        self.trial.output.join("work/scratch").join(std::process::id().to_string()).join(name)
    }

    pub fn run(&self, sets: &[Taken], after: Option<&str>) -> Result<Done> {
        let committed = each(sets, ("hashing sets", self.progress), |set| {
            // Keyed by the truth: another trial may have a set of the same name.
            self.once("commitments", &hash_json(&set.truth), || {
                let scratch = self.scratch(&set.name);
                let committed = set.make(&scratch)?;
                remove(&scratch)?;
                Ok(committed)
            })
        })?;
        let commitments = Commitments {
            version: env!("CARGO_PKG_VERSION").into(),
            seed_sha256: sha256_hex(&self.trial.order.seed.to_le_bytes()),
            binary_sha256: self.binary_sha256.into(),
            endpoints: endpoints_in_words(),
            limit_s: self.trial.limit.as_secs(),
            after: after.map(String::from),
            sets: committed,
        };
        let path = self.named("commitments").with_extension("json");
        let commitments_sha256 = if path.exists() {
            let (written, hash): (Commitments, String) = read_json(&path)?;
            if written != commitments {
                return Err(refused(&path, "another trial, or one by another build, is here"));
            }
            hash
        } else {
            write_json(&path, &commitments)?
        };
        let pairs: Vec<(&Taken, &Committed)> = sets.iter().zip(&commitments.sets).collect();
        let solved = each(&pairs, ("diagnosing", self.progress), |(set, committed)| {
            self.once("verdicts", &set.name, || self.diagnose(set, committed))
        })?;
        let line = |(set, s): (&Taken, &Solved)| VerdictHash {
            name: set.name.clone(),
            diagnosis_sha256: s.answer.diagnosis_sha256.clone(),
            model_sha256: s.model_sha256.clone(),
            confinement: s.confinement.clone(),
        };
        let verdicts = sets.iter().zip(&solved).map(line).collect();
        let verdicts = Verdicts { commitments_sha256: commitments_sha256.clone(), verdicts };
        let verdicts_sha256 =
            write_json(&self.named("verdicts").with_extension("json"), &verdicts)?;
        Ok(Done { commitments, solved, published: [commitments_sha256, verdicts_sha256] })
    }

    fn diagnose(&self, set: &Taken, committed: &Committed) -> Result<Solved> {
        let scratch = self.remade(set, committed)?;
        let solved = solve(&self.trial.program, self.trial.limit, &scratch)?;
        for (file, folder) in [("diagnosis", "diagnoses"), ("model", "work/models")] {
            let from = scratch.join("out").join(file).with_extension("json");
            let to = self.file(folder, &set.name)?;
            if from.exists() {
                fs::copy(&from, &to).map_err(|e| Error::write(&to, e))?;
            }
        }
        if self.trial.keep {
            let kept = self.named("kept").join(&set.name);
            make_folder(&self.named("kept"))?;
            remove(&kept)?;
            fs::rename(&scratch, &kept).map_err(|e| Error::write(&kept, e))?;
        }
        remove(&scratch)?;
        Ok(solved)
    }

    /// Gain of each extended model on the set's exam views.
    pub fn examine_all(&self, sets: &[Taken], known: &Commitments) -> Result<Vec<Option<Gains>>> {
        let pairs: Vec<(&Taken, &Committed)> = sets.iter().zip(&known.sets).collect();
        each(&pairs, ("examining", self.progress), |(set, committed)| {
            let Ok(model) = NoiseModel::read(&self.file("work/models", &set.name)?) else {
                return Ok(None);
            };
            self.once("gains", &set.name, || {
                let scratch = self.remade(set, committed)?;
                let gains = set.gains(&scratch, &model)?;
                remove(&scratch)?;
                Ok(gains)
            })
        })
    }

    /// Makes the set again, checks it against its commitment and returns its folder.
    fn remade(&self, set: &Taken, committed: &Committed) -> Result<PathBuf> {
        let scratch = self.scratch(&set.name);
        if set.make(&scratch)? == *committed {
            return Ok(scratch);
        }
        Err(Error::Argument {
            what: format!("set {} made again is not the one that was committed to", set.name),
            remedy: "its maker must give the same bytes every time: report this as a fault",
        })
    }
}

/// Runs `work` on all items in parallel; results keep the order of the items. No new item is started
/// after a failure.
pub fn each<T: Sync, R: Send>(
    items: &[T],
    (what, progress): (&'static str, Progress<'_>),
    work: impl Fn(&T) -> Result<R> + Sync,
) -> Result<Vec<R>> {
    let done = AtomicUsize::new(0);
    progress(what, 0, items.len());
    let one = |item: &T| {
        let result = work(item);
        progress(what, done.fetch_add(1, Ordering::Relaxed) + 1, items.len());
        result
    };
    // One item per task: sets differ much in size.
    items.par_iter().with_max_len(1).map(one).collect()
}

pub fn refused(path: &Path, what: &str) -> Error {
    Error::recording(
        path,
        what,
        "choose a new folder, or --check this one; to go on, give the same arguments and build",
    )
}

fn make_folder(path: &Path) -> Result<()> {
    fs::create_dir_all(path).map_err(|e| Error::write(path, e))
}

pub fn remove(path: &Path) -> Result<()> {
    if path.exists() { fs::remove_dir_all(path).map_err(|e| Error::write(path, e)) } else { Ok(()) }
}
