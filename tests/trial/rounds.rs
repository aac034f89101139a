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

use crate::commitment::{
    Commitments, Committed, VerdictHash, Verdicts, hash_folder, hash_json, hash_seed, read_json,
    write_json,
};
use crate::gain::{Gains, examine};
use crate::judge::{advised_view, endpoints_in_words};
use crate::plan::{conceal, plan};
use crate::proof::Order;
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

/// All sets of an order, made anew.
pub fn take(order: &Order, data: Option<&Path>, progress: Progress<'_>) -> Result<Vec<Taken>> {
    let planned = plan(order.sets, order.seed, order.real);
    each(&planned, ("making sets", progress), |planned| {
        let sealed = conceal(&planned.asked, data)?;
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

/// Write a set's folder into `scratch/set`, and only it; the hash of it.
pub fn make(sealed: &dyn ConcealedSet, scratch: &Path) -> Result<String> {
    remove(scratch)?;
    let set = scratch.join("set");
    make_folder(&set)?;
    sealed.write(&set)?;
    hash_folder(&set)
}

/// One pass over sets: committed to, diagnosed, published.
#[derive(Clone, Copy)]
pub struct Round<'a> {
    pub trial: &'a Trial,
    pub root: &'a Path,
    /// In [`ROUNDS`].
    pub index: usize,
    pub progress: Progress<'a>,
}

/// What a round leaves.
pub struct Done {
    pub commitments: Commitments,
    pub commitments_sha256: String,
    pub solved: Vec<Solved>,
    pub verdicts_sha256: String,
}

impl Round<'_> {
    fn named(&self, stem: &str) -> PathBuf {
        self.root.join(format!("{stem}{}", ROUNDS[self.index]))
    }

    fn file(&self, stem: &str) -> PathBuf {
        self.root.join(format!("{stem}{}.json", ROUNDS[self.index]))
    }

    /// Where what is known of a set outlives an interruption.
    fn state(&self, kind: &str, name: &str) -> Result<PathBuf> {
        let folder = self.root.join("work").join(format!("{kind}{}", ROUNDS[self.index]));
        make_folder(&folder)?;
        Ok(folder.join(format!("{name}.json")))
    }

    /// Nothing of an interrupted process, which may still write, is in the way.
    fn scratch(&self, name: &str) -> PathBuf {
        self.root.join("work/scratch").join(std::process::id().to_string()).join(name)
    }

    pub fn run(&self, sets: &[Taken], after: Option<&str>) -> Result<Done> {
        let committed = each(sets, ("hashing sets", self.progress), |set| self.commit(set))?;
        let program = &self.trial.program;
        let binary = fs::read(program).map_err(|e| Error::read(program, e))?;
        let commitments = Commitments {
            version: env!("CARGO_PKG_VERSION").into(),
            seed_sha256: hash_seed(self.trial.order.seed),
            binary_sha256: sha256_hex(&binary),
            endpoints: endpoints_in_words(),
            limit_s: self.trial.limit.as_secs(),
            after: after.map(String::from),
            sets: committed,
        };
        let path = self.file("commitments");
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
            self.diagnose(set, committed)
        })?;
        let line = |s: &Solved| VerdictHash {
            name: s.name.clone(),
            diagnosis_sha256: s.diagnosis_sha256.clone(),
        };
        let verdicts = Verdicts {
            commitments_sha256: commitments_sha256.clone(),
            verdicts: solved.iter().map(line).collect(),
        };
        let verdicts_sha256 = write_json(&self.file("verdicts"), &verdicts)?;
        Ok(Done { commitments, commitments_sha256, solved, verdicts_sha256 })
    }

    fn commit(&self, set: &Taken) -> Result<Committed> {
        let state = self.state("commitments", &set.name)?;
        let truth_sha256 = hash_json(&set.truth);
        if let Ok((known, _)) = read_json::<Committed>(&state)
            && (&known.truth_sha256, known.view) == (&truth_sha256, set.view)
        {
            return Ok(known);
        }
        let scratch = self.scratch(&set.name);
        let data_sha256 = make(set.sealed.as_ref(), &scratch)?;
        remove(&scratch)?;
        let name = set.name.clone();
        let committed = Committed { name, data_sha256, truth_sha256, view: set.view };
        write_json(&state, &committed)?;
        Ok(committed)
    }

    fn diagnose(&self, set: &Taken, committed: &Committed) -> Result<Solved> {
        let state = self.state("verdicts", &set.name)?;
        if let Ok((solved, _)) = read_json::<Solved>(&state) {
            return Ok(solved);
        }
        let scratch = self.scratch(&set.name);
        remake(set, committed, &scratch)?;
        let solved = solve(&self.trial.program, self.trial.limit, &set.name, &scratch)?;
        let keep = |file: &str, to: &Path| {
            let from = scratch.join("out").join(file);
            if !from.exists() {
                return Ok(());
            }
            fs::copy(&from, to).map(|_| ()).map_err(|e| Error::write(to, e))
        };
        make_folder(&self.named("diagnoses"))?;
        keep("diagnosis.json", &self.named("diagnoses").join(format!("{}.json", set.name)))?;
        keep("model.json", &self.state("models", &set.name)?)?;
        if self.trial.keep {
            let kept = self.named("kept").join(&set.name);
            make_folder(&self.named("kept"))?;
            remove(&kept)?;
            fs::rename(&scratch, &kept).map_err(|e| Error::write(&kept, e))?;
        } else {
            remove(&scratch)?;
        }
        write_json(&state, &solved)?;
        Ok(solved)
    }

    /// What each model that was found gains on views nobody has seen.
    pub fn examine_all(&self, sets: &[Taken], known: &Commitments) -> Result<Vec<Option<Gains>>> {
        let pairs: Vec<(&Taken, &Committed)> = sets.iter().zip(&known.sets).collect();
        each(&pairs, ("examining", self.progress), |(set, committed)| {
            let Ok(model) = NoiseModel::read(&self.state("models", &set.name)?) else {
                return Ok(None);
            };
            let views = set.sealed.exam();
            let state = self.state("gains", &set.name)?;
            if let Ok((gains, _)) = read_json(&state) {
                return Ok(gains);
            }
            let scratch = self.scratch(&set.name);
            remake(set, committed, &scratch)?;
            let baselines = set.truth.asked.seed.is_multiple_of(BASELINES_IN);
            let gains = examine(&views, &scratch.join("set"), &model, baselines)?;
            write_json(&state, &gains)?;
            remove(&scratch)?;
            Ok(gains)
        })
    }
}

/// The set that was committed to, or none.
fn remake(set: &Taken, committed: &Committed, scratch: &Path) -> Result<()> {
    if make(set.sealed.as_ref(), scratch)? == committed.data_sha256 {
        return Ok(());
    }
    Err(Error::Argument {
        what: format!("set {} made again is not the one that was committed to", set.name),
        remedy: "its maker must give the same bytes every time: report this as a fault",
    })
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
