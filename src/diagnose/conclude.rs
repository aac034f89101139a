//! Turns findings into the diagnosis.

use super::battery::Battery;
use super::case::Case;
use super::checks::far_off::far_off;
use super::checks::rms;
use super::diagnosis::{
    After, DIAGNOSIS_FORMAT, Diagnosis, Finding, HeldOut, MapRow, Reference, Verdict, ViewLine,
};
use super::distance::laws;
use super::distance::reference;
use super::distance::referenced_view::{Scatter, referenced_views};
use super::engine::Diagnosed;
use super::finding::findings;
use super::finding::next_view;
use super::finding::outlook::outlook;
use super::finding::pixels::typical_sigma_mm;
use super::finding::scene::Scene;
use super::joint::anchor::{anchor, is_over_distance, let_distances_be, let_planes_be};
use super::missing::shapes::Step;
use super::search::outcome::Outcome;
use super::verdict::{
    extend, few_frames, frames_left_out, not_identifiable, shares, untested, verdict,
};
use super::views::between::between;
use super::views::field::Field;
use super::views::known::KnownTerms;
use super::views::thinned;
use crate::model::{Effect, Form, NoiseModel, Searched};
use crate::sensors::KINECT_BASELINE_M;
use crate::terms::{Statistic, Term};

impl Case<'_> {
    fn remarks(&mut self) -> Vec<String> {
        let mut remarks = self.recording.remarks.clone();
        if self.options.calibrated_here && self.model.sigma.form != Form::Paper {
            remarks.extend(self.model.fit.remarks.first().cloned());
        }
        remarks.append(&mut self.remarks);
        let camera = &self.sensor().camera;
        remarks.extend(thinned::remark(camera.width, camera.height));
        if self.baseline.is_none() && !self.survey.refits_sigma {
            remarks.extend(self.survey.noise_untested(&self.model.sigma));
        }
        if self.sensor().baseline_m.is_none() {
            remarks.push(format!(
                "the recording gives no baseline_m: {KINECT_BASELINE_M} m, a Kinect v1's, is assumed; all disparities scale with it"
            ));
        }
        remarks.extend(self.excluded.iter().map(ToString::to_string));
        remarks.extend(self.baseline.iter_mut().flat_map(|b| std::mem::take(&mut b.remarks)));
        remarks
    }

    /// Runs all layers and assembles the diagnosis.
    pub fn conclude(mut self) -> Diagnosed {
        let Battery { mean, scatter, mut found, refitted, better_form, ends, detectable_losses } =
            self.battery();
        let outcomes = [&mean.outcome, &scatter.outcome];
        let scenes = self.scenes();
        self.advise(&mut found, &scenes, outcomes, ends);
        let explained: f64 = found.iter().map(|f| f.share.max(0.0)).sum();
        let unchanged = found.is_empty() && refitted.is_none();
        if found.is_empty() {
            found.extend(far_off(&self.survey, typical_sigma_mm(&self.fields)));
        }
        let verdict = self.verdict(&found, outcomes);
        let cannot_tell = reference::cannot_tell(&self.fields, self.sensor().kind);
        found.extend(cannot_tell.iter().map(not_identifiable));
        shares(&mut found);
        self.progress.stage("scoring views kept aside, and what would have been seen");
        let (heldout, (map, mut detectable)) = rayon::join(
            || self.heldout(&mean.lines, &scatter),
            || (self.map(&scenes, outcomes), self.detectable(&scenes, outcomes)),
        );
        drop(scenes);
        detectable.extend(detectable_losses);
        let mut remarks = Vec::new();
        if verdict != Verdict::Mismatch {
            remarks.extend(self.few_are_left());
        }
        remarks.append(&mut self.remarks());
        remarks.extend(untested(outcomes, self.survey.block_tiles));
        remarks.extend(few_frames(&self.fields));
        remarks.extend(frames_left_out(&self.fields));
        remarks.extend(better_form);
        let told = found.iter().chain(&refitted);
        let mut extended = extend(self.model, told, self.sensor(), self.survey.reach.disparity);
        self.anchor(&mut extended);
        if self.baseline.is_none() {
            self.sample(&mut extended);
        }
        let views = self.view_lines(&mean.terms, heldout.as_ref());
        let taken_out = self.taken_out();
        let recording = self.recording.root.display().to_string();
        let reference = match self.baseline {
            Some(_) => Reference::SimulatedRecording,
            None => Reference::Model,
        };
        let (after, mut done) = if unchanged {
            // The model is the extended one and has been tested.
            (After { verdict, remaining: Vec::new() }, self)
        } else {
            self.after(&extended, explained)
        };
        done.fields.iter_mut().for_each(|f| f.first.clear());
        let diagnosis = Diagnosis {
            format: DIAGNOSIS_FORMAT,
            recording,
            reference,
            verdict,
            findings: found,
            map,
            heldout,
            after,
            detectable,
            cannot_tell,
            views,
            remarks,
        };
        Diagnosed {
            diagnosis,
            fields: done.fields,
            excluded: done.excluded,
            against: done.baseline.map_or_else(Vec::new, |b| b.fields),
            model: extended,
            taken_out,
            bias_px: mean.px,
        }
    }

    /// Verdict. A match becomes inconclusive where more views were left out than used: the views used do not
    /// represent the recording.
    fn verdict(&self, found: &[Finding], outcomes: [&Outcome; 2]) -> Verdict {
        match verdict(found, outcomes) {
            Verdict::Match if self.few_are_left().is_some() => Verdict::Inconclusive,
            verdict => verdict,
        }
    }

    fn few_are_left(&self) -> Option<String> {
        let (left_out, kept) = (self.excluded.len(), self.fields.len());
        (left_out > kept).then(|| {
            format!(
                "{left_out} of {} views were left out: the others do not stand for the recording",
                left_out + kept
            )
        })
    }

    /// Suggests views that would settle names in doubt, where depth is measured: not beyond these `ends`, and
    /// not where a dropout over distance or tilt, found or known, removes it.
    fn advise(
        &self,
        found: &mut [Finding],
        scenes: &[Scene<'_>; 2],
        outcomes: [&Outcome; 2],
        ends: Vec<Step>,
    ) {
        let of_finding = |f: &Finding| Step::of(f.effect?, |name| f.value(name));
        let found_lost = found.iter().filter_map(of_finding);
        let lost: Vec<Step> = found_lost.chain(Step::known(&self.known)).chain(ends).collect();
        let (sigma, camera, rays) = (&self.model.sigma, &self.sensor().camera, &self.bench.rays);
        for (scene, outcome) in scenes.iter().zip(outcomes) {
            if let Some(outlook) = outlook(scene, sigma, camera, rays, &lost) {
                next_view::advise(found, scene, outcome, &outlook, self.options.seed);
            }
        }
    }

    /// Makes the biases learnt here leave distances as the references have them, or as they were.
    fn anchor(&self, extended: &mut NoiseModel) {
        let camera = &self.sensor().camera;
        let known = KnownTerms::of(extended, camera);
        let added = &mut extended.effects[self.model.effects.len()..];
        self.let_distances_be(added);
        if self.baseline.is_some() {
            return let_planes_be(added, camera);
        }
        let bias = added.iter().flat_map(|e| &e.shape).filter(|t| t.is_correctable());
        let bias: Vec<Term> = bias.cloned().collect();
        let checked = referenced_views(&self.fields, &self.survey, &bias, &known);
        if checked.len() >= laws::MIN_VIEWS {
            anchor(added, &checked, &Scatter::of(&checked).variances, camera);
        } else {
            let_planes_be(added, camera);
        }
    }

    /// Makes curves over the distance move these views the least.
    pub(in crate::diagnose) fn let_distances_be(&self, added: &mut [Effect]) {
        if added.iter().flat_map(|e| &e.shape).any(is_over_distance) {
            let_distances_be(added, &self.survey.coarse_mean_data());
        }
    }

    /// Records what the terms `extended` learnt here rest on: their scatter from view to view, and how many
    /// views and references were used.
    fn sample(&self, extended: &mut NoiseModel) {
        let added = &mut extended.effects[self.model.effects.len()..];
        for statistic in [Statistic::Bias, Statistic::Variance] {
            let concerned = |e: &&mut Effect| e.shape.iter().all(|t| t.statistic == statistic);
            let mut mine: Vec<&mut Effect> = added.iter_mut().filter(concerned).collect();
            let terms: Vec<Term> = mine.iter().flat_map(|e| e.shape.iter().cloned()).collect();
            if terms.is_empty() {
                continue;
            }
            let views = match statistic {
                Statistic::Bias => self.survey.coarse_mean_data(),
                _ => self.survey.variance_data(),
            };
            let mut shares = between(&views, &terms).into_iter();
            for effect in &mut mine {
                effect.between_views = shares.by_ref().take(effect.shape.len()).collect();
            }
        }
        let references = reference::references(&self.fields);
        let before = self.model.fit.searched.unwrap_or_default();
        extended.fit.searched = Some(Searched {
            views: before.views.max(self.fields.len()),
            references: before.references.max(references),
        });
    }

    fn map(&self, scenes: &[Scene<'_>; 2], outcomes: [&Outcome; 2]) -> Vec<MapRow> {
        let level = self.options.level;
        let layers = scenes.iter().zip(outcomes);
        layers.flat_map(|(scene, outcome)| findings::map(scene, outcome, level)).collect()
    }

    /// Summary lines of the views.
    fn view_lines(&self, bias: &[Term], heldout: Option<&HeldOut>) -> Vec<ViewLine> {
        let before = rms::rms_by_view(&self.survey, &self.as_stored());
        let after = rms::rms_by_view(&self.survey, bias);
        let line = |(n, f): (usize, &Field)| ViewLine {
            name: f.name.clone(),
            z_m: f.plane.depth(0.0, 0.0),
            theta_rad: f.plane.theta(),
            azimuth_rad: f.plane.azimuth(),
            frames: f.frames.len(),
            pixels: f.pixels.len(),
            bowl_px_before: before[n],
            bowl_px_after: after[n],
            held_out: heldout.is_some_and(|h| h.views.contains(&f.name)),
        };
        self.fields.iter().enumerate().map(line).collect()
    }
}
