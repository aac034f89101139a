//! Checks a finished trial: hashes, questions, marks and scores from `proof.json` alone, the published files
//! against it, and a sample of the sets made again.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use kinoise::NoiseModel;
use kinoise::error::Result;
use kinoise::io::sha256_hex;
use rand::seq::SliceRandom;
use serde::Serialize;

use crate::commitment::{Commitments, Verdicts, hash_file, hash_json, read_json};
use crate::judge::{mark, mark_advice, scores};
use crate::plan::{Planned, plan};
use crate::proof::{Proof, ProvenSet};
use crate::raytraced::kernels::seed_of;
use crate::raytraced::question::World;
use crate::rounds::{Progress, ROUNDS, Taken, each, remove, take, take_advised};
use crate::solver::{Answer, solve};

pub struct CheckOptions {
    /// Folder of real recordings; without it their sets are not made again.
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

/// Size of the sample of sets made again: at least this many, and one in [`SAMPLE_IN`].
const MIN_SAMPLE: usize = 3;
const SAMPLE_IN: usize = 20;

/// Checks the trial in `folder`.
pub fn check(folder: &Path, options: &CheckOptions, progress: Progress<'_>) -> Result<Checked> {
    let proof = Proof::read(folder)?;
    let planned = plan(&proof.order);
    let mut checked = Checked::default();
    checked.questions(&proof, &planned);
    checked.published(folder, &proof)?;
    checked.judgement(&proof);
    checked.sets(&proof, planned, options, progress)?;
    if hash_file(&options.program)? != proof.commitments[0].binary_sha256 {
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

    /// Checks that the seed gives these questions and that the truths are those that were committed to.
    fn questions(&mut self, proof: &Proof, planned: &[Planned]) {
        let first = &proof.commitments[0];
        self.fault(sha256_hex(&proof.order.seed.to_le_bytes()) == first.seed_sha256, || {
            "the seed is not the one that was committed to".into()
        });
        let n = [planned.len(), first.sets.len(), proof.sets.len()];
        self.fault(n[0] == n[1] && n[1] == n[2], || {
            format!("{} sets were ordered, {} committed to, {} told", n[0], n[1], n[2])
        });
        for ((set, planned), committed) in proof.sets.iter().zip(planned).zip(&first.sets) {
            let same = set.name == planned.name && set.truth.asked == planned.asked;
            self.fault(same, || format!("set {}: the seed asks another question", set.name));
            let bound =
                committed.name == set.name && committed.truth_sha256 == hash_json(&set.truth);
            self.fault(bound, || format!("set {}: the truth is not the committed one", set.name));
        }
        self.checked.push(format!("{} questions and truths against seed and hashes", n[2]));
    }

    /// Checks that the published files match the proof, that each is bound to the one before, and that every
    /// verdict is the diagnosis that was hashed.
    fn published(&mut self, folder: &Path, proof: &Proof) -> Result<()> {
        let mut before: Option<String> = None;
        let mut n = 0;
        let mut confinement = BTreeMap::new();
        for (round, suffix) in ROUNDS.iter().enumerate() {
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
            let told = proof.answers(round).map(|(set, a)| (&set.name, &a.diagnosis_sha256));
            let lines = file.verdicts.iter().map(|v| (&v.name, &v.diagnosis_sha256));
            self.fault(lines.eq(told), || format!("{name} has other verdicts than proof.json"));
            for line in &file.verdicts {
                *confinement.entry(line.confinement.clone()).or_insert(0) += 1;
            }
            before = Some(verdicts_hash);
            let diagnoses = folder.join(format!("diagnoses{suffix}"));
            for (set, answer) in proof.answers(round).filter(|(_, a)| a.diagnosis_sha256.is_some())
            {
                let bytes = std::fs::read(diagnoses.join(format!("{}.json", set.name)));
                let same = Answer::of(bytes.map_err(|e| e.to_string())) == *answer;
                self.fault(same, || {
                    format!("set {}: its verdict is not the diagnosis that was hashed", set.name)
                });
                n += 1;
            }
        }
        // Older trials do not record it per set.
        let sealed = !confinement.contains_key("");
        self.fault(!sealed || confinement == proof.confinement, || {
            "the solvers were confined in another way than proof.json says".into()
        });
        self.checked
            .push("four published files, each against the one before and proof.json".into());
        self.checked.push(format!("{n} diagnoses against their hashes and verdicts"));
        Ok(())
    }

    /// Checks that the judge gives the same marks and scores again.
    fn judgement(&mut self, proof: &Proof) {
        for set in &proof.sets {
            let said = set.answer.verdict.as_ref();
            let advice = set.advised.as_ref().is_none_or(|a| {
                mark_advice(&set.truth, said, a.answer.verdict.as_ref()) == a.marks
            });
            let same = advice && mark(&set.truth, said).is_ok_and(|m| m == set.marks);
            self.fault(same, || format!("set {}: the judge gives other marks", set.name));
        }
        self.fault(scores(&proof.sets) == proof.scores, || {
            "the scores are not those of the marks".into()
        });
        self.checked.push(format!("the marks of {} sets and all scores", proof.sets.len()));
    }

    /// Checks that sets and advised views made again give the same truth and the same bytes.
    fn sets(
        &mut self,
        proof: &Proof,
        mut planned: Vec<Planned>,
        options: &CheckOptions,
        progress: Progress<'_>,
    ) -> Result<()> {
        let data = options.data.as_deref();
        if proof.order.real && data.is_none() {
            self.remarks.push("sets of real recordings are made again with --data only".into());
            planned.retain(|p| p.asked.world != World::Real);
        }
        if !options.all {
            // Nobody can know the sample before the commitments are written.
            planned.shuffle(&mut seed_of(&proof.published[0]).stream("trial/check"));
            planned.truncate(MIN_SAMPLE.max(planned.len().div_ceil(SAMPLE_IN)));
        }
        let sets = take(&planned, data, progress)?;
        let scratch = std::env::temp_dir().join(format!("kinoise-check-{}", std::process::id()));
        let same_build = hash_file(&options.program)? == proof.commitments[0].binary_sha256;
        let again = each(&sets, ("making sets again", progress), |set| {
            let proven = proof.sets.iter().find(|s| s.name == set.name);
            let verdict = proven.filter(|s| s.advised.is_some()).map(|s| s.answer.verdict.as_ref());
            let views =
                take_advised(std::slice::from_ref(set), verdict.into_iter(), &|_, _, _| ())?;
            for (round, set) in [(0, set)].into_iter().chain(views.iter().map(|v| (1, v))) {
                let folder = scratch.join(&set.name);
                let made = set.make(&folder)?;
                if !proof.commitments[round].sets.contains(&made) {
                    remove(&folder)?;
                    return Ok(Some(format!("set {}: made again, it is another", set.name)));
                }
                if let (0, true, Some(proven)) = (round, same_build, proven) {
                    let limit = Duration::from_secs(proof.commitments[0].limit_s);
                    if let Some(fault) = derived(set, proven, options, limit, &folder)? {
                        remove(&folder)?;
                        return Ok(Some(format!("set {}: {fault}", set.name)));
                    }
                }
                remove(&folder)?;
            }
            Ok(None)
        });
        let _ = remove(&scratch);
        self.faults.extend(again?.into_iter().flatten());
        let n = sets.len();
        self.checked.push(format!("{n} sets made again, with their advised views"));
        if same_build {
            self.checked.push(format!("{n} sets diagnosed again, and what their models gain"));
        } else {
            let what = "verdicts and gains were not derived again: give the build that was used";
            self.remarks.push(what.into());
        }
        Ok(())
    }
}

/// Diagnoses the set in `scratch/set` again and examines its model; returns what differs from the proof, if
/// anything. A set without an answer is skipped: it may have timed out, and finish now.
fn derived(
    set: &Taken,
    proven: &ProvenSet,
    options: &CheckOptions,
    limit: Duration,
    scratch: &Path,
) -> Result<Option<String>> {
    if proven.answer.failure.is_some() {
        return Ok(None);
    }
    let solved = solve(&options.program, limit, scratch)?;
    if solved.answer.failure.is_none() && solved.answer != proven.answer {
        return Ok(Some("diagnosed again, it gets another answer".into()));
    }
    let gains = match NoiseModel::read(&scratch.join("out/model.json")) {
        Ok(model) => set.gains(scratch, &model)?,
        Err(_) => None,
    };
    Ok((gains != proven.gains).then(|| "weighed again, its model gains something else".into()))
}
