//! From findings to the diagnosis.

use super::case::{Case, Mean, Scatter};
use super::detectable::detectable;
use super::diagnosis::{DIAGNOSIS_FORMAT, Diagnosis, Finding, Reference, Status, Verdict};
use super::engine::Diagnosed;
use super::findings;
use super::heldout;
use super::pixels::typical_sigma_mm;
use super::reference;
use super::steps::steps;
use super::verdict::{
    after, echoes, extend, fold_into_sigma, merge, not_identifiable, shares, symptoms, view_lines,
};
use crate::effects::KINECT_BASELINE_M;
use crate::model::Form;
use crate::terms::{Axis, Statistic};

impl Case<'_> {
    fn remarks(&mut self) -> Vec<String> {
        let mut remarks = self.recording.remarks.clone();
        if self.options.calibrated_here && self.model.sigma.form != Form::Paper {
            remarks.extend(self.model.fit.remarks.first().cloned());
        }
        remarks.append(&mut self.copies);
        if self.sensor().baseline_m.is_none() {
            remarks.push(format!(
                "the recording gives no baseline_m: {KINECT_BASELINE_M} m, a Kinect v1's, is assumed; all disparities scale with it"
            ));
        }
        remarks.extend(self.excluded.iter().map(ToString::to_string));
        remarks.extend(self.baseline.iter_mut().flat_map(|b| std::mem::take(&mut b.remarks)));
        remarks
    }

    pub fn conclude(mut self, mean: Mean, scatter: &Scatter) -> Diagnosed {
        let camera = &self.recording.sensor.camera;
        let scenes = self.scenes();
        let outcomes = [&mean.outcome, &scatter.outcome];
        let sigma_mm = typical_sigma_mm(&self.fields);
        let steps = steps(
            &scatter.lattice,
            &self.known,
            &self.fields,
            self.recording,
            sigma_mm,
            &self.survey.second(),
        );
        let mut curves = self.curves(&scenes, outcomes);
        let refitted = self.take_refit(&mut curves, &scatter.outcome);
        curves.retain(|f| self.is_news(f, &steps, scatter));
        if self.baseline.is_none() {
            fold_into_sigma(&mut curves);
        }
        let better = self.tell_form(&mut curves, refitted.is_some());
        let mut found: Vec<Finding> = self.ranges.clone().into_iter().chain(curves).collect();
        found.extend(self.texture(&mean, scatter, steps));
        drop(scenes);
        let (lost, more_detectable) = self.lost();
        let scenes = self.scenes();
        found.extend(lost);
        found.extend(self.laws(&mean.terms));
        let mismatch = found.iter().any(|f| f.status != Status::NotIdentifiable);
        let cannot_tell = reference::cannot_tell(&self.fields);
        found.extend(cannot_tell.iter().map(not_identifiable));
        let columns_told = found.iter().any(|f| f.axis == Axis::Column && !f.terms.is_empty());
        found.retain(|f| {
            let lines =
                f.axis == Axis::Column && f.statistic == Statistic::Bias && f.terms.is_empty();
            !(lines && columns_told)
        });
        if self.baseline.is_some() {
            symptoms(&mut found);
        }
        echoes(&mut found);
        merge(&mut found);
        shares(&mut found);
        let heldout = heldout::score(
            &self.survey,
            self.model,
            camera,
            self.fields[0].scale_px_m,
            self.options,
        );
        let level = self.options.level;
        let map =
            scenes.iter().zip(outcomes).flat_map(|(s, o)| findings::map(s, o, level)).collect();
        let mut detectable = detectable(&self.survey, &mean.outcome, &scatter.outcome, camera);
        detectable.extend(more_detectable);
        drop(scenes);
        let mut remarks = self.remarks();
        remarks.extend(better);
        let known = found.iter().chain(&refitted);
        let extended = extend(self.model, known, self.sensor(), self.survey.reach.disparity);
        let diagnosis = Diagnosis {
            format: DIAGNOSIS_FORMAT,
            recording: self.recording.root.display().to_string(),
            reference: if self.baseline.is_some() {
                Reference::SimulatedRecording
            } else {
                Reference::Model
            },
            verdict: if mismatch { Verdict::Mismatch } else { Verdict::Match },
            left_out: heldout::left_out(&self.survey, &mean.outcome, &mean.terms),
            after: after(&mean.outcome, &scatter.outcome),
            views: view_lines(&self.fields, &self.survey, &mean.terms, heldout.as_ref()),
            findings: found,
            map,
            heldout,
            detectable,
            cannot_tell,
            remarks,
        };
        Diagnosed {
            diagnosis,
            model: extended,
            fields: self.fields,
            bias: mean.terms,
            bias_px: mean.px,
            excluded: self.excluded,
            against: self.baseline.map_or_else(Vec::new, |b| b.fields),
        }
    }
}
