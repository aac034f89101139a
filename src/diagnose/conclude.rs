//! From findings to the diagnosis.

use super::battery::Battery;
use super::case::Case;
use super::detectable::detectable;
use super::diagnosis::{DIAGNOSIS_FORMAT, Diagnosis, Reference};
use super::engine::Diagnosed;
use super::findings;
use super::heldout;
use super::reference;
use super::verdict::{extend, not_identifiable, shares, untested, verdict, view_lines};
use crate::effects::KINECT_BASELINE_M;
use crate::model::Form;

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

    pub fn conclude(mut self, battery: Battery) -> Diagnosed {
        let camera = &self.recording.sensor.camera;
        let Battery { mean, scatter, mut found, refitted, better_form, detectable: losses } =
            battery;
        let explained: f64 = found.iter().map(|f| f.share.max(0.0)).sum();
        let outcomes = [&mean.outcome, &scatter.outcome];
        let verdict = verdict(&found, outcomes);
        let cannot_tell = reference::cannot_tell(&self.fields);
        found.extend(cannot_tell.iter().map(not_identifiable));
        shares(&mut found);
        let heldout = heldout::score(
            &self.survey,
            self.model,
            camera,
            self.fields[0].scale_px_m,
            self.options,
        );
        let level = self.options.level;
        let scenes = self.scenes();
        let map =
            scenes.iter().zip(outcomes).flat_map(|(s, o)| findings::map(s, o, level)).collect();
        drop(scenes);
        let mut detectable =
            detectable(&self.survey, &mean.outcome, &scatter.outcome, camera, self.options);
        detectable.extend(losses);
        let mut remarks = self.remarks();
        remarks.extend(untested(outcomes));
        remarks.extend(better_form);
        let known = found.iter().chain(&refitted);
        let extended = extend(self.model, known, self.sensor(), self.survey.reach.disparity);
        let views = view_lines(&self.fields, &self.survey, &mean.terms, heldout.as_ref());
        let left_out = heldout::left_out(&self.survey, &mean.outcome, &mean.terms);
        let recording = self.recording.root.display().to_string();
        let reference = match self.baseline {
            Some(_) => Reference::SimulatedRecording,
            None => Reference::Model,
        };
        let excluded = std::mem::take(&mut self.excluded);
        let again = self.after(&extended, &mean, explained);
        let diagnosis = Diagnosis {
            format: DIAGNOSIS_FORMAT,
            recording,
            reference,
            verdict,
            findings: found,
            map,
            heldout,
            left_out,
            after: again.after,
            detectable,
            cannot_tell,
            views,
            remarks,
        };
        Diagnosed {
            diagnosis,
            model: extended,
            fields: again.fields,
            bias: mean.terms,
            bias_px: mean.px,
            excluded,
            against: again.against,
        }
    }
}
