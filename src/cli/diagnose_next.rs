//! Next steps after a diagnosis: commands to copy, for the terminal and the page.

use std::ffi::OsString;
use std::path::Path;

use kinoise::diagnose::{Diagnosis, Finding, Reference, Status, Verdict};
use kinoise::effects::Active;
use kinoise::model;
use kinoise::report::{Step, called};

use super::common::model_again;
use super::console::{beside, shell};

/// A diagnosis, with what its commands need.
pub struct After<'a> {
    pub diagnosis: &'a Diagnosis,
    pub recording: &'a Path,
    /// Folder of the results.
    pub folder: &'a Path,
    /// Input options of the recording.
    pub input: &'a [OsString],
}

impl After<'_> {
    /// Next steps, in order.
    pub fn steps(&self) -> Vec<Step> {
        let model = ["-m".into(), self.folder.join("model.json").into()];
        let recording = || OsString::from(self.recording);
        let to = |what| OsString::from(beside(self.folder, what));
        let mut steps = Vec::new();
        let mut step = |why: &str, words: &[OsString], input: &[OsString]| {
            let command = format!("kinoise {}", shell(&[words, input].concat()));
            steps.push(Step { why: why.into(), command });
        };
        let has = |status| self.diagnosis.findings.iter().any(|f| f.status == status);
        let calibrate = ["calibrate".into(), recording(), "-o".into(), to("calibrated")];
        let contradicted = self.diagnosis.findings.iter().any(|f| f.contradicted.is_some());
        if contradicted {
            let why = "The model has what the recording does not show; fit one without it: ";
            step(why, &calibrate, self.input);
        }
        if self.corrects() {
            let why = "Take the errors out of the depth: ";
            let [m, file] = model.clone();
            let words = ["correct".into(), recording(), "-o".into(), to("corrected"), m, file];
            step(why, &words, self.input);
        }
        let why = match self.diagnosis.reference {
            Reference::SimulatedRecording => "Simulate the same views with what was found: ",
            Reference::Model => "Simulate the same views with the extended model: ",
        };
        let twin = ["simulate".into(), to("twin"), "--like".into(), recording()];
        step(why, &[&twin[..], &model].concat(), self.input);
        if has(Status::Recalibrate) && !contradicted {
            step("The parameters of the noise are off; fit them again: ", &calibrate, self.input);
        }
        if self.diagnosis.verdict != Verdict::Inconclusive && !contradicted {
            let map = ["map".into(), "SEQUENCE".into(), "-o".into(), to("map")];
            step("Map a sequence of this sensor with it: ", &[&map[..], &model].concat(), &[]);
        }
        steps
    }

    /// Whether there is a bias to correct that held-out views do not contradict, or one that their score does not
    /// hold: a law of the distance, or steps of columns.
    fn corrects(&self) -> bool {
        let biased = |f: &Finding| f.terms.iter().any(|t| t.is_correctable());
        let gains = self.diagnosis.heldout.as_ref().is_none_or(|h| h.bias_is_clear);
        let findings = &self.diagnosis.findings;
        let unscored = |f: &Finding| f.status == Status::Named && f.is_corrected() && !biased(f);
        gains && findings.iter().any(biased) || findings.iter().any(unscored)
    }

    /// Commands that simulate each finding with `--effect`, starting from the model that was `given`, whose effects
    /// are `known`; and why the other findings have none.
    pub fn reproductions(&self, given: Option<&Path>, known: &[model::Effect]) -> Vec<String> {
        let mut commands = Vec::new();
        let mut others = Vec::new();
        for finding in &self.diagnosis.findings {
            // The simulator takes an effect from one place.
            let fresh = |e: &Active| known.iter().all(|k| k.id != e.effect.card().id);
            let effect = finding.as_effect().filter(|e| !e.is_identity() && fresh(e));
            let Some(effect) = effect else {
                others.extend((!finding.minor).then_some(finding));
                continue;
            };
            let to = beside(self.folder, effect.effect.card().id);
            let like = ["simulate".into(), to.into(), "--like".into(), self.recording.into()];
            let effect = ["--effect".into(), effect.argument().into()];
            let words = [&like[..], &model_again(given), &effect, self.input].concat();
            commands.push(format!("  kinoise {}", shell(&words)));
        }
        let the = if commands.len() == 1 { "the" } else { "each" };
        let heading = (!commands.is_empty()).then(|| format!("to simulate {the} finding:"));
        heading.into_iter().chain(commands).chain(self.without_formula(&others)).collect()
    }

    /// Sentence on the findings without an `--effect`.
    fn without_formula(&self, findings: &[&Finding]) -> Option<String> {
        let seen = |f: &&&Finding| f.status != Status::NotIdentifiable && f.contradicted.is_none();
        let names = |shaped: bool| {
            let alike = findings.iter().filter(seen).filter(|f| f.terms.is_empty() != shaped);
            alike.map(|f| called(f)).collect::<Vec<_>>().join(", ")
        };
        let model = self.folder.join("model.json");
        let brought = format!("measured, and simulated with -m {}", shell(&[model.into()]));
        let parts = [
            (names(true), &*brought),
            (names(false), "which the model has, or of a strength that is not known"),
        ];
        let parts = parts.iter().filter(|(names, _)| !names.is_empty());
        let parts: Vec<String> = parts.map(|(names, what)| format!("{names} ({what})")).collect();
        (!parts.is_empty()).then(|| format!("  no --effect stands for {}", parts.join(" and ")))
    }
}
