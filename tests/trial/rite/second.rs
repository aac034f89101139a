//! The second round, between the verdicts and the opening: advised views are taken.

use super::{Rite, SOLVER_SEED, refused, remove, same};
use crate::advice::{
    ADVICE_FILE, ADVICE_FORMAT, ADVISED_DIAGNOSES, ADVISED_VERDICTS_FILE, Advice, AdvisedSet,
    Rediagnosed, SecondRound, asked_for,
};
use crate::judge::{advice_scores, mark_advice};
use crate::proof::{read_json, write_json};
use crate::raytraced::question::{Pose, Sealed};
use crate::seal::Taken;
use crate::solve::{Solved, make};
use crate::workers::each;
use kinoise::error::{Error, Result};

impl Rite<'_> {
    /// From the advice to the second verdicts, and only then to their marks.
    pub(super) fn second(
        &self,
        sets: &[Taken],
        first: &[Solved],
        verdicts_sha256: &str,
    ) -> Result<SecondRound> {
        let said = sets.iter().zip(first);
        let asked = asked_for(said.map(|(t, s)| (t.truth.asked.world, s.verdict.as_ref())));
        let (advice, advice_sha256) = self.take_views(sets, &asked, verdicts_sha256)?;
        let again: Vec<(usize, &AdvisedSet)> =
            asked.iter().map(|a| a.0).zip(&advice.sets).collect();
        let solved =
            each(&again, self.trial.workers, ("diagnosing again", self.progress), |(i, set)| {
                self.solve_again(&sets[*i], set)
            })?;
        let verdicts_sha256 = self.publish(ADVISED_VERDICTS_FILE, &advice_sha256, &solved)?;
        let mut told = Vec::new();
        for ((i, _), solved) in again.iter().zip(solved) {
            let before = first[*i].verdict.as_ref();
            let marks = mark_advice(&sets[*i].truth, before, solved.verdict.as_ref());
            told.push(Rediagnosed {
                name: solved.name,
                verdict: solved.verdict,
                failure: solved.failure,
                diagnosis_sha256: solved.diagnosis_sha256,
                verdict_sha256: solved.verdict_sha256,
                marks,
                seconds: solved.seconds,
            });
        }
        let worlds = again.iter().map(|(i, _)| sets[*i].truth.asked.world);
        let judged: Vec<_> = worlds.zip(told.iter().map(|t| &t.marks)).collect();
        let scores = advice_scores(&judged);
        Ok(SecondRound { advice_sha256, verdicts_sha256, advice, sets: told, scores })
    }

    /// `advice.json`: as it is, or written now.
    fn take_views(
        &self,
        sets: &[Taken],
        asked: &[(usize, Pose)],
        verdicts_sha256: &str,
    ) -> Result<(Advice, String)> {
        let how = ("taking advised views", self.progress);
        let taken = each(asked, self.trial.workers, how, |(i, advised)| {
            let (set, name) = (&sets[*i], &sets[*i].name);
            let (taken, sealed) = with_view(set, advised)?;
            let scratch = self.scratch(name);
            let data_sha256 = make(sealed.as_ref(), &scratch)?;
            remove(&scratch)?;
            Ok(AdvisedSet { name: name.clone(), advised: *advised, taken, data_sha256 })
        })?;
        let format = ADVICE_FORMAT.into();
        let advice = Advice { format, verdicts_sha256: verdicts_sha256.into(), sets: taken };
        let path = self.root.join(ADVICE_FILE);
        if path.exists() {
            let (written, hash): (Advice, String) = read_json(&path)?;
            if written != advice {
                return Err(refused(&path, "the second round of another trial was sealed here"));
            }
            return Ok((advice, hash));
        }
        let hash = write_json(&path, &advice)?;
        Ok((advice, hash))
    }

    fn solve_again(&self, set: &Taken, advised: &AdvisedSet) -> Result<Solved> {
        let state = self.state("advised", &set.name);
        if let Ok((solved, _)) = read_json::<Solved>(&state) {
            return Ok(solved);
        }
        let scratch = self.scratch(&set.name);
        let (_, sealed) = with_view(set, &advised.advised)?;
        same(sealed.as_ref(), (&set.name, &advised.data_sha256), &scratch)?;
        let solved = self.solver(SOLVER_SEED).solve(&set.name, &scratch)?;
        self.keep_rest(&set.name, [ADVISED_DIAGNOSES, "kept-advised"], &scratch)?;
        write_json(&state, &solved)?;
        Ok(solved)
    }
}

/// The set with the view that was advised, as it could be taken.
pub fn with_view(set: &Taken, advised: &Pose) -> Result<(Pose, Box<dyn Sealed>)> {
    set.sealed.with_view(advised)?.ok_or_else(|| Error::Argument {
        what: format!("set {}: its world takes no view more", set.name),
        remedy: "report this as a fault: nobody should have asked for one",
    })
}
