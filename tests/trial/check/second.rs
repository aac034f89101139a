//! Whether the second round holds, by the same means as the first.

use std::path::Path;

use super::{CheckOptions, Checked, FEWEST, scratch};
use crate::advice::{
    ADVICE_FILE, ADVISED_DIAGNOSES, ADVISED_VERDICTS_FILE, Advice, SecondRound, asked_for,
};
use crate::judge::{advice_scores, mark_advice};
use crate::plan::plan;
use crate::proof::{PROOF_FILE, Proof, ProvenSet, Verdicts};
use crate::rite::second::with_view;
use crate::seal::Taken;
use crate::solve::{make, verdict_hash};
use crate::verdict::reduced;
use crate::workers::{Progress, each};
use kinoise::error::{Error, Result};
use kinoise::io::sha256_hex;

impl Checked {
    pub(super) fn second(
        &mut self,
        folder: &Path,
        proof: &Proof,
        options: &CheckOptions,
        progress: Progress<'_>,
    ) -> Result<()> {
        let Some(second) = &proof.second else {
            self.fault(!folder.join(ADVICE_FILE).exists(), || {
                format!("{ADVICE_FILE} is here, and {PROOF_FILE} tells of no second round")
            });
            self.remarks.push("this trial took no advised views".into());
            return Ok(());
        };
        let sets = self.chosen(proof, second);
        self.second_files(folder, proof, second);
        self.second_verdicts(folder, second);
        self.second_judgement(&sets, second);
        self.views_again(proof, second, options, progress)
    }

    /// The first verdicts ask for these views and no others; their sets, in order.
    fn chosen<'a>(&mut self, proof: &'a Proof, second: &SecondRound) -> Vec<&'a ProvenSet> {
        let said = proof.sets.iter().map(|s| (s.truth.asked.world, s.verdict.as_ref()));
        let asked = asked_for(said);
        let sets: Vec<&ProvenSet> = asked.iter().map(|a| &proof.sets[a.0]).collect();
        let told = second.advice.sets.iter().map(|s| (&s.name, s.advised));
        let same = told.eq(sets.iter().zip(&asked).map(|(s, a)| (&s.name, a.1)));
        self.fault(same, || "other views were taken than the verdicts ask for".into());
        let names = second.sets.iter().map(|s| &s.name);
        self.fault(names.eq(second.advice.sets.iter().map(|s| &s.name)), || {
            "the second round tells of other sets than were taken for it".into()
        });
        self.checked.push(format!("{} advised views against the verdicts", sets.len()));
        sets
    }

    fn second_files(&mut self, folder: &Path, proof: &Proof, second: &SecondRound) {
        self.fault(second.advice.verdicts_sha256 == proof.verdicts_sha256, || {
            "the advised views come from other verdicts".into()
        });
        if let Some((advice, hash)) = self.published::<Advice>(folder, ADVICE_FILE) {
            self.fault(hash == second.advice_sha256 && advice == second.advice, || {
                format!("{ADVICE_FILE} is not what {PROOF_FILE} holds")
            });
        }
        let Some((verdicts, hash)) = self.published::<Verdicts>(folder, ADVISED_VERDICTS_FILE)
        else {
            return;
        };
        let of = (hash, &verdicts.seal_sha256)
            == (second.verdicts_sha256.clone(), &second.advice_sha256);
        self.fault(of, || {
            format!(
                "{ADVISED_VERDICTS_FILE} is not what {PROOF_FILE} says, or answers another seal"
            )
        });
        let lines = verdicts.verdicts.iter();
        let written = lines.map(|l| (&l.name, &l.verdict_sha256, &l.diagnosis_sha256, &l.failure));
        let told = second.sets.iter();
        let told = told.map(|s| (&s.name, &s.verdict_sha256, &s.diagnosis_sha256, &s.failure));
        self.fault(written.eq(told), || {
            format!("{ADVISED_VERDICTS_FILE} has other verdicts than {PROOF_FILE}")
        });
    }

    fn second_verdicts(&mut self, folder: &Path, second: &SecondRound) {
        for set in &second.sets {
            let hash = set.verdict.as_ref().map(verdict_hash);
            self.fault(hash == set.verdict_sha256, || {
                format!(
                    "set {}: its second verdict is not the one whose hash was written",
                    set.name
                )
            });
            let path = folder.join(ADVISED_DIAGNOSES).join(format!("{}.json", set.name));
            let Ok(bytes) = std::fs::read(&path) else { continue };
            let verdict = serde_json::from_slice(&bytes).ok().map(|d| reduced(&d));
            let same = set.diagnosis_sha256.as_deref() == Some(&sha256_hex(&bytes))
                && verdict.as_ref().map(verdict_hash) == set.verdict_sha256;
            self.fault(same || set.failure.is_some(), || {
                format!("set {}: {} is not the second verdict", set.name, path.display())
            });
        }
        self.checked.push(format!("{} second verdicts against their hashes", second.sets.len()));
    }

    fn second_judgement(&mut self, sets: &[&ProvenSet], second: &SecondRound) {
        for (set, again) in sets.iter().zip(&second.sets) {
            let marks = mark_advice(&set.truth, set.verdict.as_ref(), again.verdict.as_ref());
            self.fault(marks == again.marks, || {
                format!("set {}: the judge gives its second verdict other marks", set.name)
            });
        }
        let worlds = sets.iter().map(|s| s.truth.asked.world);
        let judged: Vec<_> = worlds.zip(second.sets.iter().map(|s| &s.marks)).collect();
        self.fault(advice_scores(&judged) == second.scores, || {
            "the scores of the second round are not those of its marks".into()
        });
    }

    /// Some of the views taken again give the same bytes.
    fn views_again(
        &mut self,
        proof: &Proof,
        second: &SecondRound,
        options: &CheckOptions,
        progress: Progress<'_>,
    ) -> Result<()> {
        let planned = plan(proof.order.sets, proof.order.seed, proof.order.real);
        let some = if options.all { second.advice.sets.len() } else { FEWEST };
        let scratch = scratch();
        let sets: Vec<_> = second.advice.sets.iter().take(some).collect();
        let data = options.data.as_deref();
        let again = each(&sets, options.workers, ("taking views again", progress), |set| {
            let Some(planned) = planned.iter().find(|p| p.name == set.name) else {
                return Ok(false);
            };
            let (taken, sealed) = with_view(&Taken::of(planned, data)?, &set.advised)?;
            let folder = scratch.join(&set.name);
            let hash = make(sealed.as_ref(), &folder)?;
            std::fs::remove_dir_all(&folder).map_err(|e| Error::write(&folder, e))?;
            Ok(hash == set.data_sha256 && taken == set.taken)
        });
        let _ = std::fs::remove_dir_all(&scratch);
        for (set, same) in sets.iter().zip(again?) {
            self.fault(same, || {
                format!("set {}: its advised view, taken again, is another", set.name)
            });
        }
        self.checked.push(format!("{} advised views taken again, their data", sets.len()));
        Ok(())
    }
}
