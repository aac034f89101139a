//! One pass over sets: they are made, committed to, diagnosed, and the verdicts published. The trial
//! is two of these; whatever is finished is kept under `work/`, so that an interrupted trial goes on
//! where it was.

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

/// What happens, how many are done, how many there are.
pub type Progress<'a> = &'a (dyn Fn(&'static str, usize, usize) + Sync);

/// A set that is ready, with its answer.
pub struct Taken {
    pub name: String,
    pub truth: Truth,
    pub sealed: Box<dyn ConcealedSet>,
    /// In the second round: the view that was advised and the one that could be taken.
    pub view: Option<[Pose; 2]>,
}

/// The two rounds: files and folders of the second have this in their names.
pub const ROUNDS: [&str; 2] = ["", "-advised"];
/// Sets of a second round at most, in the order of the trial.
const MAX_ADVISED: usize = 40;
/// The baselines learn from one set in so many, by the set's seed: they take longer than all else.
const BASELINES_IN: u64 = 3;

/// The sets of these questions, made anew; `data` is the folder of the real recordings.
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

/// The sets whose verdicts advise a view, with that view; a session that a real sensor has long
/// ended takes none.
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
    /// Write the set's folder into `scratch/set`, and only it; what anybody may know of it.
    pub fn make(&self, scratch: &Path) -> Result<Committed> {
        remove(scratch)?;
        let set = scratch.join("set");
        make_folder(&set)?;
        self.sealed.write(&set)?;
        let (name, truth_sha256) = (self.name.clone(), hash_json(&self.truth));
        Ok(Committed { name, data_sha256: hash_folder(&set)?, truth_sha256, view: self.view })
    }

    /// What `model` gains on views nobody has seen, where the set has any; the set lies in
    /// `scratch/set`.
    pub fn gains(&self, scratch: &Path, model: &NoiseModel) -> Result<Option<Gains>> {
        let views = self.sealed.exam();
        if views.is_empty() {
            return Ok(None);
        }
        let baselines = self.truth.asked.seed.is_multiple_of(BASELINES_IN);
        examine(&views, &scratch.join("set"), model, baselines).map(Some)
    }
}

/// One pass over sets: committed to, diagnosed, published.
#[derive(Clone, Copy)]
pub struct Round<'a> {
    pub trial: &'a Trial,
    pub binary_sha256: &'a str,
    /// In [`ROUNDS`].
    pub index: usize,
    pub progress: Progress<'a>,
}

/// What a round leaves, and the hashes of the two files that it published.
pub struct Done {
    pub commitments: Commitments,
    pub solved: Vec<Solved>,
    pub published: [String; 2],
}

impl Round<'_> {
    fn named(&self, stem: &str) -> PathBuf {
        self.trial.output.join(format!("{stem}{}", ROUNDS[self.index]))
    }

    /// A set's file in a folder that is there from now on.
    fn file(&self, folder: &str, name: &str) -> Result<PathBuf> {
        let folder = self.named(folder);
        make_folder(&folder)?;
        Ok(folder.join(format!("{name}.json")))
    }

    /// What is known of a set from before an interruption, else the outcome of `work`, kept.
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

    /// Nothing of an interrupted process, which may still write, is in the way.
    fn scratch(&self, name: &str) -> PathBuf {
        self.trial.output.join("work/scratch").join(std::process::id().to_string()).join(name)
    }

    pub fn run(&self, sets: &[Taken], after: Option<&str>) -> Result<Done> {
        let committed = each(sets, ("hashing sets", self.progress), |set| {
            // By its truth: another trial's set of this name is no help.
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

    /// What each model that was found gains on views nobody has seen.
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

    /// Where the set is that was committed to, and no other.
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

/// `work` on every item on all threads, in order of the items. Nothing new is begun after a failure.
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
    // One at a time for each thread: sets differ much in size.
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
