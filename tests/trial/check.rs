//! Whether a proof holds: everything that can be computed again is, and compared.

mod second;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use rand::seq::SliceRandom;

use super::judge::{Judged, mark, scores};
use super::plan::{Planned, plan};
use super::proof::{
    DIAGNOSES, PROOF_FILE, Proof, ProvenSet, SEAL_FILE, VERDICTS_FILE, Verdicts, read_json,
};
use super::seal::{Seal, Taken, commitment, judge_hash, seed_hash};
use super::solve::{make, verdict_hash};
use super::verdict::reduced;
use super::workers::{Progress, each};
use crate::raytraced::question::World;
use kinoise::error::{Error, Result};
use kinoise::io::sha256_hex;
use kinoise::rng::Seed;

/// How thoroughly.
pub struct CheckOptions {
    /// Real recordings, for the sets made of them.
    pub data: Option<PathBuf>,
    /// Make every set again, not a sample.
    pub all: bool,
    pub workers: usize,
    /// The program, to tell whether it is the one that was sealed.
    pub program: PathBuf,
}

/// What was compared, and what differs.
#[derive(Debug, Clone, Default, serde::Serialize)]
pub struct Checked {
    /// In words.
    pub checked: Vec<String>,
    /// Empty where the proof holds.
    pub faults: Vec<String>,
    /// Neither.
    pub remarks: Vec<String>,
}

/// Check the proof in a folder.
///
/// # Errors
/// When there is none, or it cannot be read. What does not hold is no error but a fault.
pub fn check(folder: &Path, options: &CheckOptions, progress: Progress<'_>) -> Result<Checked> {
    let proof = Proof::read(folder)?;
    let mut checked = Checked::default();
    checked.seals(&proof);
    checked.order(&proof);
    checked.files(folder, &proof);
    checked.verdicts(folder, &proof);
    checked.judgement(&proof);
    checked.program(&proof, &options.program)?;
    checked.sets(&proof, options, progress)?;
    checked.second(folder, &proof, options, progress)?;
    Ok(checked)
}

/// A folder that no other check, in this process or another, works in.
fn scratch() -> PathBuf {
    static CHECKS: AtomicUsize = AtomicUsize::new(0);
    let (process, check) = (std::process::id(), CHECKS.fetch_add(1, Ordering::Relaxed));
    std::env::temp_dir().join(format!("kinoise-check-{process}-{check}"))
}

/// At least so many sets are made again.
const FEWEST: usize = 3;
/// Or one in so many.
const ONE_IN: usize = 20;

impl Checked {
    fn fault(&mut self, holds: bool, what: impl FnOnce() -> String) {
        if !holds {
            self.faults.push(what());
        }
    }

    /// Salt and truth of every set give the commitment that was published.
    fn seals(&mut self, proof: &Proof) {
        for (i, set) in proof.sets.iter().enumerate() {
            let sealed = proof.seal.sets.get(i);
            self.fault(sealed.is_some_and(|s| s.name == set.name), || {
                format!("set {}: the seal has another set in its place", set.name)
            });
            let same = sealed.is_some_and(|s| s.commitment == commitment(&set.salt, &set.truth));
            self.fault(same, || {
                format!("set {}: salt and truth are not those that were sealed", set.name)
            });
        }
        let n = (proof.sets.len(), proof.seal.sets.len());
        self.fault(n.0 == n.1, || format!("{} sets were sealed and {} are told", n.1, n.0));
        self.checked.push(format!("{} truths against their seals", n.0));
    }

    /// Seed and number of sets give these questions, names and salts.
    fn order(&mut self, proof: &Proof) {
        let order = &proof.order;
        self.fault(seed_hash(order.seed) == proof.seal.seed_sha256, || {
            "the seed is not the one that was sealed".into()
        });
        let planned = plan(order.sets, order.seed, order.real);
        self.fault(planned.len() == proof.sets.len(), || {
            format!("{} sets were ordered and {} are told", planned.len(), proof.sets.len())
        });
        for (set, planned) in proof.sets.iter().zip(planned) {
            let Planned { name, salt, asked } = planned;
            self.fault((&set.name, &set.salt) == (&name, &salt), || {
                format!("set {}: name or salt do not come from the seed", set.name)
            });
            self.fault(set.truth.asked == asked, || {
                format!("set {}: the seed asks another question", set.name)
            });
        }
        self.checked.push("the questions against the plan of the seed".into());
    }

    /// The files that were published before are what the proof says.
    fn files(&mut self, folder: &Path, proof: &Proof) {
        if let Some((seal, hash)) = self.published::<Seal>(folder, SEAL_FILE) {
            self.fault(hash == proof.seal_sha256 && seal == proof.seal, || {
                format!("{SEAL_FILE} is not what {PROOF_FILE} holds")
            });
        }
        if let Some((verdicts, hash)) = self.published::<Verdicts>(folder, VERDICTS_FILE) {
            self.fault(hash == proof.verdicts_sha256, || {
                format!("{VERDICTS_FILE} has another hash than {PROOF_FILE} says")
            });
            self.fault(verdicts.seal_sha256 == proof.seal_sha256, || {
                format!("{VERDICTS_FILE} answers another seal")
            });
            let mut same = verdicts.verdicts.len() == proof.sets.len();
            for (line, set) in verdicts.verdicts.iter().zip(&proof.sets) {
                same &= line.name == set.name && line.failure == set.failure;
                let hashes = line.verdict_sha256 == set.verdict_sha256
                    && line.diagnosis_sha256 == set.diagnosis_sha256;
                self.fault(hashes, || {
                    format!("set {}: {VERDICTS_FILE} has another verdict", set.name)
                });
            }
            self.fault(same, || format!("{VERDICTS_FILE} is of other sets"));
        }
    }

    fn published<T: serde::de::DeserializeOwned>(
        &mut self,
        folder: &Path,
        name: &str,
    ) -> Option<(T, String)> {
        let path = folder.join(name);
        if !path.exists() {
            self.remarks.push(format!("{name} is not here: its hash was not compared"));
            return None;
        }
        self.checked.push(format!("{name} against {PROOF_FILE}"));
        read_json(&path).map_err(|e| self.faults.push(e.to_string())).ok()
    }

    /// Every verdict has its hash, and is the diagnosis that was kept.
    fn verdicts(&mut self, folder: &Path, proof: &Proof) {
        let mut kept = 0;
        for set in &proof.sets {
            let hash = set.verdict.as_ref().map(verdict_hash);
            self.fault(hash == set.verdict_sha256, || {
                format!("set {}: the verdict is not the one whose hash was written", set.name)
            });
            let path = folder.join(DIAGNOSES).join(format!("{}.json", set.name));
            let Ok(bytes) = std::fs::read(&path) else { continue };
            kept += 1;
            let verdict = serde_json::from_slice(&bytes).ok().map(|d| reduced(&d));
            let same = set.diagnosis_sha256.as_deref() == Some(&sha256_hex(&bytes))
                && verdict.as_ref().map(verdict_hash) == set.verdict_sha256;
            // A diagnosis may have been written by a process that failed afterwards.
            self.fault(same || set.failure.is_some(), || {
                format!("set {}: {} is not the verdict", set.name, path.display())
            });
        }
        self.checked.push(format!("{} verdicts against their hashes", proof.sets.len()));
        self.checked.push(format!("{kept} complete diagnoses against their verdicts"));
    }

    /// The judge says the same again.
    fn judgement(&mut self, proof: &Proof) {
        for set in &proof.sets {
            let again = mark(&set.truth, set.verdict.as_ref());
            self.fault(again.as_ref().is_ok_and(|m| *m == set.marks), || {
                format!("set {}: the judge gives other marks", set.name)
            });
        }
        let judged: Vec<Judged<'_>> = proof.sets.iter().map(ProvenSet::judged).collect();
        self.fault(scores(&judged) == proof.scores, || {
            "the scores are not those of the marks".into()
        });
        self.checked.push(format!("the marks of {} sets and all scores", proof.sets.len()));
    }

    fn program(&mut self, proof: &Proof, program: &Path) -> Result<()> {
        if judge_hash() != proof.seal.judge_sha256 {
            self.remarks.push("this program has another judge than the one that was sealed".into());
        }
        let bytes = std::fs::read(program).map_err(|e| Error::read(program, e))?;
        if sha256_hex(&bytes) != proof.seal.binary_sha256 {
            self.remarks.push("this program is another build than the one that was sealed".into());
        }
        Ok(())
    }

    /// Sets made again give the same truth and the same bytes.
    fn sets(
        &mut self,
        proof: &Proof,
        options: &CheckOptions,
        progress: Progress<'_>,
    ) -> Result<()> {
        let planned = plan(proof.order.sets, proof.order.seed, proof.order.real);
        let mut sample: Vec<usize> = (0..planned.len().min(proof.sets.len()))
            .filter(|i| options.data.is_some() || planned[*i].asked.world != World::Real)
            .collect();
        if !options.all {
            // Which, nobody can know before the seal is written.
            let seed = u64::from_str_radix(proof.seal_sha256.get(..16).unwrap_or("0"), 16);
            sample.shuffle(&mut Seed(seed.unwrap_or(0)).stream("prove/check"));
            sample.truncate(FEWEST.max(sample.len().div_ceil(ONE_IN)));
        }
        let scratch = scratch();
        let data = options.data.as_deref();
        let again = each(&sample, options.workers, ("making sets again", progress), |i| {
            let taken = Taken::of(&planned[*i], data)?;
            let folder = scratch.join(&taken.name);
            let hash = make(taken.sealed.as_ref(), &folder)?;
            std::fs::remove_dir_all(&folder).map_err(|e| Error::write(&folder, e))?;
            Ok((taken.commitment, hash))
        });
        let _ = std::fs::remove_dir_all(&scratch);
        for (i, (commitment, hash)) in sample.iter().zip(again?) {
            let (name, sealed) = (&proof.sets[*i].name, proof.seal.sets.get(*i));
            self.fault(sealed.is_some_and(|s| s.commitment == commitment), || {
                format!("set {name}: made again, it has another truth")
            });
            self.fault(sealed.is_some_and(|s| s.data_sha256 == hash), || {
                format!("set {name}: made again, it has other data")
            });
        }
        self.checked.push(format!("{} sets made again, their data and truths", sample.len()));
        Ok(())
    }
}
