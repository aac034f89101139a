//! The trial from the first seal to the proof.

pub(super) mod second;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::advice::ADVISED_DIAGNOSES;
use super::examine::{Examination, Examine};
use super::judge::{Judged, mark, scores};
use super::plan::plan;
use super::proof::{
    DIAGNOSES, Ordered, PROOF_FILE, PROOF_FORMAT, Proof, ProvenSet, SEAL_FILE, VERDICTS_FILE,
    VERDICTS_FORMAT, VerdictLine, Verdicts, read_json, write_json,
};
use super::seal::{Seal, SealedSet, Taken};
use super::solve::{Solved, Solver, make};
use super::workers::{Progress, each};
use crate::raytraced::question::Sealed;
use kinoise::error::{Error, Result};
use kinoise::io::OutputDir;
use kinoise::model::{NoiseModel, Provenance};

/// What is wanted.
pub struct Trial {
    pub output: PathBuf,
    pub sets: usize,
    pub seed: u64,
    /// Real recordings.
    pub data: Option<PathBuf>,
    /// Keep the sets and all that the solver wrote, in `kept/`.
    pub keep: bool,
    /// Sets at a time; the result does not depend on it.
    pub workers: usize,
    /// The program that diagnoses.
    pub program: PathBuf,
    /// Of one diagnosis.
    pub limit: Duration,
    /// Weighs what was learnt, once the seals are open.
    pub examine: Option<Examine>,
}

/// The seed of every diagnosis.
const SOLVER_SEED: u64 = 1;

/// Hold the trial, or go on with one that was interrupted.
///
/// # Errors
/// When the folder holds another trial, a world cannot make its set, a set made again is not the one
/// that was sealed, or the disk refuses.
pub fn prove(trial: &Trial, progress: Progress<'_>) -> Result<Proof> {
    let out = OutputDir::create(&trial.output)?;
    if out.path().join(PROOF_FILE).exists() {
        return Err(refused(out.path(), "a finished trial is here"));
    }
    let rite = Rite { trial, root: out.path(), progress };
    for folder in ["seals", "verdicts", "models", "gains", "advised", "scratch"] {
        make_folder(&rite.work(folder))?;
    }
    make_folder(&rite.root.join(DIAGNOSES))?;
    make_folder(&rite.root.join(ADVISED_DIAGNOSES))?;
    let sets = rite.take()?;
    let (seal, seal_sha256) = rite.seal(&sets)?;
    let solved = rite.solve(&sets, &seal)?;
    let verdicts_sha256 = rite.close(&seal_sha256, &solved)?;
    let second = rite.second(&sets, &solved, &verdicts_sha256)?;
    let proven = rite.open(&sets, solved, &seal)?;
    let judged: Vec<Judged<'_>> = proven.iter().map(|(set, _)| set.judged()).collect();
    let mut confinement = BTreeMap::new();
    for (_, how) in &proven {
        *confinement.entry(how.clone()).or_insert(0) += 1;
    }
    let proof = Proof {
        format: PROOF_FORMAT.into(),
        provenance: Provenance::now(Some(trial.seed)),
        order: Ordered { sets: trial.sets, seed: trial.seed, real: trial.data.is_some() },
        scores: scores(&judged),
        seal_sha256,
        verdicts_sha256,
        seal,
        confinement,
        sets: proven.into_iter().map(|(set, _)| set).collect(),
        second: Some(second),
    };
    write_json(&rite.root.join(PROOF_FILE), &proof)?;
    remove(&rite.root.join("work"))?;
    Ok(proof)
}

struct Rite<'a> {
    trial: &'a Trial,
    root: &'a Path,
    progress: Progress<'a>,
}

impl Rite<'_> {
    fn work(&self, name: &str) -> PathBuf {
        self.root.join("work").join(name)
    }

    fn state(&self, kind: &str, name: &str) -> PathBuf {
        self.work(kind).join(format!("{name}.json"))
    }

    /// Nothing of an interrupted process, which may still write, is in the way.
    fn scratch(&self, name: &str) -> PathBuf {
        self.work("scratch").join(std::process::id().to_string()).join(name)
    }

    /// All sets with their answers, which stay in memory until all is said.
    fn take(&self) -> Result<Vec<Taken>> {
        let data = self.trial.data.as_deref();
        let planned = plan(self.trial.sets, self.trial.seed, data.is_some());
        each(&planned, self.trial.workers, ("making sets", self.progress), |p| Taken::of(p, data))
    }

    /// `seal.json`: as it is, or written now.
    fn seal(&self, sets: &[Taken]) -> Result<(Seal, String)> {
        let path = self.root.join(SEAL_FILE);
        if path.exists() {
            let (seal, hash): (Seal, String) = read_json(&path)?;
            let again = self.new_seal(seal.sets.clone())?;
            let same = sets.len() == seal.sets.len()
                && sets.iter().zip(&seal.sets).all(|(taken, sealed)| {
                    (&taken.name, &taken.commitment) == (&sealed.name, &sealed.commitment)
                });
            if !same || again != seal {
                return Err(refused(
                    &path,
                    "another trial, or one by another build, was sealed here",
                ));
            }
            return Ok((seal, hash));
        }
        let sealed = each(sets, self.trial.workers, ("sealing", self.progress), |t| self.hash(t))?;
        let seal = self.new_seal(sealed)?;
        let hash = write_json(&path, &seal)?;
        Ok((seal, hash))
    }

    fn new_seal(&self, sets: Vec<SealedSet>) -> Result<Seal> {
        let terms = (SOLVER_SEED, self.trial.limit.as_secs());
        Seal::new(self.trial.seed, &self.trial.program, terms, sets)
    }

    fn hash(&self, taken: &Taken) -> Result<SealedSet> {
        let state = self.state("seals", &taken.name);
        if let Ok((sealed, _)) = read_json::<SealedSet>(&state)
            && sealed.commitment == taken.commitment
        {
            return Ok(sealed);
        }
        let scratch = self.scratch(&taken.name);
        let data_sha256 = make(taken.sealed.as_ref(), &scratch)?;
        remove(&scratch)?;
        let commitment = taken.commitment.clone();
        let sealed = SealedSet { name: taken.name.clone(), data_sha256, commitment };
        write_json(&state, &sealed)?;
        Ok(sealed)
    }

    fn solve(&self, sets: &[Taken], seal: &Seal) -> Result<Vec<Solved>> {
        let solver = self.solver(seal.solver_seed);
        let pairs: Vec<(&Taken, &SealedSet)> = sets.iter().zip(&seal.sets).collect();
        each(&pairs, self.trial.workers, ("diagnosing", self.progress), |(taken, sealed)| {
            let state = self.state("verdicts", &taken.name);
            if let Ok((solved, _)) = read_json::<Solved>(&state) {
                return Ok(solved);
            }
            let scratch = self.scratch(&taken.name);
            remake(taken, sealed, &scratch)?;
            let solved = solver.solve(&taken.name, &scratch)?;
            self.keep(&taken.name, &scratch)?;
            write_json(&state, &solved)?;
            Ok(solved)
        })
    }

    fn solver(&self, seed: u64) -> Solver<'_> {
        Solver { program: &self.trial.program, seed, limit: self.trial.limit }
    }

    /// What outlives the scratch folder.
    fn keep(&self, name: &str, scratch: &Path) -> Result<()> {
        self.keep_file("model.json", &self.state("models", name), scratch)?;
        self.keep_rest(name, [DIAGNOSES, "kept"], scratch)
    }

    fn keep_file(&self, file: &str, to: &Path, scratch: &Path) -> Result<()> {
        let from = scratch.join("out").join(file);
        if from.exists() {
            fs::copy(&from, to).map_err(|e| Error::write(to, e))?;
        }
        Ok(())
    }

    fn keep_rest(&self, name: &str, [diagnoses, kept]: [&str; 2], scratch: &Path) -> Result<()> {
        let diagnosis = self.root.join(diagnoses).join(format!("{name}.json"));
        self.keep_file("diagnosis.json", &diagnosis, scratch)?;
        if !self.trial.keep {
            return remove(scratch);
        }
        let folder = self.root.join(kept);
        let kept = folder.join(name);
        remove(&kept)?;
        make_folder(&folder)?;
        fs::rename(scratch, &kept).map_err(|e| Error::write(&kept, e))
    }

    /// `verdicts.json`: all is said.
    fn close(&self, seal_sha256: &str, solved: &[Solved]) -> Result<String> {
        self.publish(VERDICTS_FILE, seal_sha256, solved)
    }

    fn publish(&self, file: &str, seal_sha256: &str, solved: &[Solved]) -> Result<String> {
        let line = |s: &Solved| VerdictLine {
            name: s.name.clone(),
            diagnosis_sha256: s.diagnosis_sha256.clone(),
            verdict_sha256: s.verdict_sha256.clone(),
            failure: s.failure.clone(),
        };
        let verdicts = Verdicts {
            format: VERDICTS_FORMAT.into(),
            seal_sha256: seal_sha256.into(),
            verdicts: solved.iter().map(line).collect(),
        };
        write_json(&self.root.join(file), &verdicts)
    }

    /// The seals are opened: judge, and examine what was learnt. With each set what confined it.
    fn open(
        &self,
        sets: &[Taken],
        solved: Vec<Solved>,
        seal: &Seal,
    ) -> Result<Vec<(ProvenSet, String)>> {
        let all: Vec<_> = sets.iter().zip(&seal.sets).zip(solved).collect();
        each(&all, self.trial.workers, ("opening", self.progress), |((taken, sealed), solved)| {
            let Examination { gains, names } = self.examine(taken, sealed)?;
            let set = ProvenSet {
                name: taken.name.clone(),
                salt: taken.salt.clone(),
                marks: mark(&taken.truth, solved.verdict.as_ref())?,
                truth: taken.truth.clone(),
                verdict: solved.verdict.clone(),
                failure: solved.failure.clone(),
                diagnosis_sha256: solved.diagnosis_sha256.clone(),
                verdict_sha256: solved.verdict_sha256.clone(),
                gains,
                named_by_others: names,
                seconds: solved.seconds,
            };
            Ok((set, solved.confinement.clone()))
        })
    }

    fn examine(&self, taken: &Taken, sealed: &SealedSet) -> Result<Examination> {
        let (Some(examine), Ok(model)) =
            (self.trial.examine, NoiseModel::read(&self.state("models", &taken.name)))
        else {
            return Ok(Examination::default());
        };
        let state = self.state("gains", &taken.name);
        if let Ok((known, _)) = read_json(&state) {
            return Ok(known);
        }
        let scratch = self.scratch(&taken.name);
        remake(taken, sealed, &scratch)?;
        let found = examine(taken.sealed.as_ref(), &scratch.join("set"), &model)?;
        write_json(&state, &found)?;
        remove(&scratch)?;
        Ok(found)
    }
}

/// The set that was sealed, or none.
fn remake(taken: &Taken, sealed: &SealedSet, scratch: &Path) -> Result<()> {
    same(taken.sealed.as_ref(), (&taken.name, &sealed.data_sha256), scratch)
}

/// Make a set whose hash is known.
fn same(sealed: &dyn Sealed, (name, sha256): (&str, &str), scratch: &Path) -> Result<()> {
    if make(sealed, scratch)? == *sha256 {
        return Ok(());
    }
    Err(Error::Argument {
        what: format!("set {name} made again is not the one that was sealed"),
        remedy: "its maker must give the same bytes every time: report this as a fault",
    })
}

fn refused(path: &Path, what: &str) -> Error {
    Error::recording(
        path,
        what,
        "choose a new folder, or --check this one; to go on, give the same arguments and build",
    )
}

fn make_folder(path: &Path) -> Result<()> {
    fs::create_dir_all(path).map_err(|e| Error::write(path, e))
}

fn remove(path: &Path) -> Result<()> {
    if path.exists() { fs::remove_dir_all(path).map_err(|e| Error::write(path, e)) } else { Ok(()) }
}
