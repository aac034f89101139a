//! Whether a finished trial holds: hashes, questions, marks and scores from `proof.json` alone, the
//! published files against it, and a sample of the sets made again.

use std::path::{Path, PathBuf};

use kinoise::error::Result;
use kinoise::io::sha256_hex;
use kinoise::{Error, Seed};
use rand::seq::SliceRandom;
use serde::Serialize;

use crate::commitment::{Commitments, Verdicts, hash_json, hash_seed, read_json};
use crate::judge::{mark, mark_advice, scores};
use crate::plan::plan;
use crate::proof::{Advised, Proof};
use crate::raytraced::question::World;
use crate::rounds::{Progress, ROUNDS, Taken, each, make, remove, take_advised};
use crate::solver::without_curves;

pub struct CheckOptions {
    /// Real recordings; without them their sets are not made again.
    pub data: Option<PathBuf>,
    /// Make every set again.
    pub all: bool,
    /// The program that checks.
    pub program: PathBuf,
}

/// What was checked, and what does not hold.
#[derive(Debug, Default, Serialize)]
pub struct Checked {
    pub faults: Vec<String>,
    pub checked: Vec<String>,
    pub remarks: Vec<String>,
}

/// Sets that are made again at least, and one in so many.
const MIN_SAMPLE: usize = 3;
const SAMPLE_IN: usize = 20;

/// Check the trial in `folder`.
pub fn check(folder: &Path, options: &CheckOptions, progress: Progress<'_>) -> Result<Checked> {
    let (proof, _) = Proof::read(folder)?;
    let mut checked = Checked::default();
    checked.questions(&proof);
    checked.published(folder, &proof)?;
    checked.diagnoses(folder, &proof);
    checked.judgement(&proof);
    checked.sets(&proof, options, progress)?;
    let program = &options.program;
    let bytes = std::fs::read(program).map_err(|e| Error::read(program, e))?;
    if sha256_hex(&bytes) != proof.commitments[0].binary_sha256 {
        checked.remarks.push("this program is another build than the one that was used".into());
    }
    Ok(checked)
}

impl Checked {
    fn fault(&mut self, holds: bool, what: impl FnOnce() -> String) {
        if !holds {
            self.faults.push(what());
        }
    }

    /// The seed gives these questions, and the truths are those that were committed to.
    fn questions(&mut self, proof: &Proof) {
        let (order, [first, _]) = (&proof.order, &proof.commitments);
        self.fault(hash_seed(order.seed) == first.seed_sha256, || {
            "the seed is not the one that was committed to".into()
        });
        let planned = plan(order.sets, order.seed, order.real);
        let n = [planned.len(), proof.sets.len(), first.sets.len()];
        self.fault(n[0] == n[1] && n[1] == n[2], || {
            format!("{} sets were ordered, {} committed to, {} told", n[0], n[2], n[1])
        });
        for ((set, planned), committed) in proof.sets.iter().zip(planned).zip(&first.sets) {
            let same = set.name == planned.name && set.truth.asked == planned.asked;
            self.fault(same, || format!("set {}: the seed asks another question", set.name));
            let bound =
                committed.name == set.name && committed.truth_sha256 == hash_json(&set.truth);
            self.fault(bound, || format!("set {}: the truth is not the committed one", set.name));
        }
        self.checked.push(format!("{} questions and truths against seed and hashes", n[1]));
    }

    /// The files that were published are what the proof says, each bound to the one before.
    fn published(&mut self, folder: &Path, proof: &Proof) -> Result<()> {
        let mut before: Option<String> = None;
        for (round, suffix) in ROUNDS.iter().enumerate() {
            let told: Vec<(String, Option<String>)> = match round {
                0 => proof
                    .sets
                    .iter()
                    .map(|s| (s.name.clone(), s.diagnosis_sha256.clone()))
                    .collect(),
                _ => {
                    let again = |s: &crate::proof::ProvenSet| {
                        Some((s.name.clone(), s.advised.as_ref()?.diagnosis_sha256.clone()))
                    };
                    proof.sets.iter().filter_map(again).collect()
                }
            };
            let name = format!("commitments{suffix}.json");
            let (file, hash): (Commitments, String) = read_json(&folder.join(&name))?;
            let same = hash == proof.published[2 * round] && file == proof.commitments[round];
            self.fault(same, || format!("{name} is not what proof.json holds"));
            self.fault(file.after == before, || format!("{name} does not answer what was before"));
            let name = format!("verdicts{suffix}.json");
            let (file, verdicts_hash): (Verdicts, String) = read_json(&folder.join(&name))?;
            self.fault(verdicts_hash == proof.published[2 * round + 1], || {
                format!("{name} has another hash than proof.json says")
            });
            self.fault(file.commitments_sha256 == hash, || {
                format!("{name} answers other commitments")
            });
            let lines: Vec<_> =
                file.verdicts.into_iter().map(|v| (v.name, v.diagnosis_sha256)).collect();
            self.fault(lines == told, || format!("{name} has other verdicts than proof.json"));
            before = Some(verdicts_hash);
        }
        self.checked
            .push("four published files, each against the one before and proof.json".into());
        Ok(())
    }

    /// Every verdict is the diagnosis that was hashed.
    fn diagnoses(&mut self, folder: &Path, proof: &Proof) {
        let mut n = 0;
        let mut one = |round: usize, name: &str, hash: &Option<String>, verdict| {
            let Some(hash) = hash else { return true };
            let path =
                folder.join(format!("diagnoses{}", ROUNDS[round])).join(format!("{name}.json"));
            let Ok(bytes) = std::fs::read(&path) else { return false };
            n += 1;
            let kept = serde_json::from_slice(&bytes).ok().map(without_curves);
            sha256_hex(&bytes) == *hash && kept.as_ref() == verdict
        };
        for set in &proof.sets {
            let mut holds = one(0, &set.name, &set.diagnosis_sha256, set.verdict.as_ref());
            if let Some(Advised { verdict, diagnosis_sha256, .. }) = &set.advised {
                holds &= one(1, &set.name, diagnosis_sha256, verdict.as_ref());
            }
            self.fault(holds, || {
                format!("set {}: its verdict is not the diagnosis that was hashed", set.name)
            });
        }
        self.checked.push(format!("{n} diagnoses against their hashes and verdicts"));
    }

    /// The judge says the same again.
    fn judgement(&mut self, proof: &Proof) {
        for set in &proof.sets {
            let again = mark(&set.truth, set.verdict.as_ref());
            let mut same = again.as_ref().is_ok_and(|m| *m == set.marks);
            if let Some(a) = &set.advised {
                let marks = mark_advice(&set.truth, set.verdict.as_ref(), a.verdict.as_ref());
                same &= marks == a.marks;
            }
            self.fault(same, || format!("set {}: the judge gives other marks", set.name));
        }
        self.fault(scores(&proof.sets) == proof.scores, || {
            "the scores are not those of the marks".into()
        });
        self.checked.push(format!("the marks of {} sets and all scores", proof.sets.len()));
    }

    /// Sets made again give the same truth and the same bytes; so do advised views.
    fn sets(
        &mut self,
        proof: &Proof,
        options: &CheckOptions,
        progress: Progress<'_>,
    ) -> Result<()> {
        let data = options.data.as_deref();
        if proof.order.real && data.is_none() {
            self.remarks.push("sets of real recordings are made again with --data only".into());
        }
        let order = &proof.order;
        let planned = plan(order.sets, order.seed, order.real);
        let mut sample: Vec<usize> = (0..planned.len().min(proof.sets.len()))
            .filter(|i| data.is_some() || planned[*i].asked.world != World::Real)
            .collect();
        if !options.all {
            // Which, nobody can know before the commitments are written.
            let seed = u64::from_str_radix(proof.published[0].get(..16).unwrap_or("0"), 16);
            sample.shuffle(&mut Seed(seed.unwrap_or(0)).stream("trial/check"));
            sample.truncate(MIN_SAMPLE.max(sample.len().div_ceil(SAMPLE_IN)));
        }
        let scratch = std::env::temp_dir().join(format!("kinoise-check-{}", std::process::id()));
        let again = each(&sample, ("making sets again", progress), |&i| {
            let sealed = crate::plan::conceal(&planned[i].asked, data)?;
            let (name, truth) = (planned[i].name.clone(), sealed.truth());
            let set = Taken { name, truth, sealed, view: None };
            let verdict = std::iter::once(proof.sets[i].verdict.as_ref());
            let views = match proof.sets[i].advised {
                Some(_) => take_advised(std::slice::from_ref(&set), verdict, &|_, _, _| ())?,
                None => Vec::new(),
            };
            let all = [(0, &set)].into_iter().chain(views.iter().map(|v| (1, v)));
            let mut faults = Vec::new();
            for (round, set) in all {
                let folder = scratch.join(format!("{}{}", set.name, ROUNDS[round]));
                let hash = make(set.sealed.as_ref(), &folder)?;
                remove(&folder)?;
                let sets = &proof.commitments[round].sets;
                let same = sets.iter().find(|c| c.name == set.name).is_some_and(|c| {
                    c.data_sha256 == hash
                        && c.truth_sha256 == hash_json(&set.truth)
                        && c.view == set.view
                });
                if !same {
                    faults.push(format!("set {}: made again, it is another", set.name));
                }
            }
            Ok(faults)
        });
        let _ = remove(&scratch);
        self.faults.extend(again?.into_iter().flatten());
        self.checked.push(format!("{} sets made again, with their advised views", sample.len()));
        Ok(())
    }
}
