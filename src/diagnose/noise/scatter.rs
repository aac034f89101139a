//! Scatter about the mean: structure, size and tails of the noise.

use super::lines::LearntLines;
use super::skewness::skewness;
use super::still::beside_bias;
use super::structure::Structure;
use super::structures::{shared, structures};
use super::tails::{Confusers, tails};
use super::texture_finding::TextureFinding;
use super::{ROW_NOISE, further_textures, still_errors, texture_findings, window};
use crate::diagnose::against::noise::{NAMED_LEVEL, NoiseParts};
use crate::diagnose::case::{Case, MeanResult};
use crate::diagnose::finding::pixels::{
    Whitener, common, fixed_px2, measure_tails, pixel_terms, terms_of,
};
use crate::diagnose::options::EACH_LEVEL;
use crate::diagnose::search::outcome::Outcome;
use crate::diagnose::steps::{Steps, forget_windows};
use crate::diagnose::views::known::ray_share;
use crate::terms::{Axis, Basis, PixelContext, Statistic, Term};

/// Results on the scatter about the mean.
pub struct ScatterResult {
    /// Statistics of each view.
    pub structure: Vec<Structure>,
    pub textures: Vec<TextureFinding>,
    pub tails: Option<TextureFinding>,
    /// Search of the variance.
    pub outcome: Outcome,
}

/// Axes along which lines have constant errors.
fn axes_of_lines(textures: &[TextureFinding]) -> Vec<Axis> {
    textures.iter().filter(|t| t.are_still_lines()).map(|t| t.axis).collect()
}

impl Case<'_> {
    pub fn scatter(&mut self, mean: &mut MeanResult) -> ScatterResult {
        self.at("searching the noise", "testing the noise again");
        let camera = &self.recording.sensor.camera;
        let mut structure = structures(&self.fields, &mean.px, &self.kept);
        let lattice = self.lattice;
        let own = Steps::of(lattice, &structure, &self.fields, self.recording);
        forget_windows(&mut structure, &self.fields, lattice, self.recording);
        let theirs = self.baseline.as_ref().map(|b| b.steps);
        let extra = |p: &PixelContext| (own.at(p) - theirs.map_or(0.0, |s| s.at(p))).max(0.0);
        let each = self.level(EACH_LEVEL);
        let mut textures = self.textures(&mut structure, each);
        self.learn_lines(mean, &textures);
        self.weigh_rows(mean, &structure, &textures);
        self.survey.compare_frames(&self.fields, common(&structure, &textures, &self.known));
        let compared =
            self.baseline.as_mut().is_some_and(|baseline| baseline.variances(&mut self.survey));
        let range_share = self.known.ray_share() + ray_share(&mean.terms);
        // A range in place of a depth makes a disparity, and its noise, smaller.
        let stretch = |p: &PixelContext| {
            let ray = 1.0 / (1.0 + p.x * p.x + p.y * p.y).sqrt();
            (1.0 + range_share.clamp(0.0, 1.0) * (ray - 1.0)).powi(2)
        };
        self.survey.roughen(&self.fields, &mean.px, extra, stretch);
        if let Some(baseline) = self.baseline.as_ref().filter(|_| compared) {
            baseline.inflate_log_variances(&mut self.survey);
        }
        if self.baseline.is_some() && !compared {
            self.survey.forget_noise_beyond(&self.model.sigma);
        }
        let level = self.search_level(Self::VARIANCE_LEVEL);
        let sigma = &self.model.sigma;
        if self.survey.learnt_from[1].is_some() {
            self.survey.absorb_model_variance_error(&self.known, sigma);
        }
        let outcome = self.survey.search_variance(sigma, camera, level, self.options.seed);
        let terms = terms_of(&outcome, Statistic::Variance);
        let sigma = Some(sigma).filter(|_| self.baseline.is_none());
        let whitener = Whitener { sigma, terms: &terms, survey: &self.survey, bench: &self.bench };
        measure_tails(&mut structure, &self.fields, &mean.px, &whitener);
        let alike = self.baseline.as_ref().is_some_and(|b| b.tails_alike(&structure));
        let holds = |t: &Term| self.holds_tails(t);
        // The light of single pixels is hardly known better than to an octave.
        let by_light = |t: &Term| t.basis.axis() == Axis::Intensity;
        let uneven = outcome.chosen.iter().any(|c| c.candidate.family.is_none())
            || terms.iter().chain(&self.known.variance).any(by_light)
            || self.survey.refits_sigma && !terms.iter().all(holds)
            || self.known.has_uneven_noise()
            || !self.known.variance.iter().all(holds);
        let stepped = self.lattice.is_some();
        let confusers = Confusers { uneven, simulated: self.baseline.is_some(), stepped };
        let tails = tails(&structure, &self.known, each, confusers)
            .filter(|t| !alike && self.stands(t.p, each));
        // Far errors on one side alone cause tails and skewness; skewed noise has an excess fourth moment.
        let far = tails.as_ref().is_some_and(TextureFinding::are_far_errors);
        let may_be = self.baseline.is_none() && !far;
        let skewed = may_be.then(|| skewness(&structure, each)).flatten();
        let skewed = skewed.filter(|t| self.stands(t.p, each));
        let tails = tails.filter(|t| skewed.is_none() || !t.are_weak_tails());
        textures.extend(skewed);
        ScatterResult { structure, textures, tails, outcome }
    }

    /// Adds what looks like constant lines to the terms of the mean, which are `px` by view and pixel.
    pub fn with_lines(&self, terms: &[Term], px: Vec<Vec<f32>>) -> Vec<Vec<f32>> {
        let each = self.level(EACH_LEVEL);
        let mut still = still_errors(&shared(&self.fields, &px, &self.kept), &self.known, each);
        still.retain(|t| self.stands(t.p, each));
        let axes = axes_of_lines(&still);
        if axes.is_empty() { px } else { self.beside_lines(terms, &px, &axes).1 }
    }

    /// Adds constant lines to the mean: without them the noise has its own size and tails.
    fn learn_lines(&mut self, mean: &mut MeanResult, textures: &[TextureFinding]) {
        let axes = axes_of_lines(textures);
        if axes.is_empty() || self.baseline.is_some() {
            return;
        }
        self.take_out_lines(mean, &axes);
        // Whole lines had passed for correlated noise: without them the views weigh more.
        if self.survey.reweigh(&self.fields, &mean.px) {
            *mean = self.mean();
            self.take_out_lines(mean, &axes);
        }
    }

    /// Lowers the weights of the views where row noise was found or is known: rows say less of the mean and
    /// of the size of the noise than their pixels do.
    fn weigh_rows(
        &mut self,
        mean: &mut MeanResult,
        structure: &[Structure],
        textures: &[TextureFinding],
    ) {
        let found = textures.iter().any(|t| t.families.contains(&ROW_NOISE));
        if !(found || self.known.has(ROW_NOISE)) {
            return;
        }
        for (s, view) in structure.iter().zip(&mut self.survey.views) {
            let [of_mean, of_log_variance] = s.excess_of_rows(&view.correlation);
            view.row_inflation = of_mean;
            view.row_correlation = s.row_correlation();
            view.log_variance_inflation *= of_log_variance;
        }
        let lines: Vec<Axis> = mean.lines.iter().map(|l| l.axis).collect();
        *mean = self.mean();
        if !lines.is_empty() {
            self.take_out_lines(mean, &lines);
        }
    }

    fn take_out_lines(&self, mean: &mut MeanResult, axes: &[Axis]) {
        (mean.lines, mean.px) = self.beside_lines(&mean.terms, &mean.px, axes);
    }

    /// Lines along these axes beside terms of the mean, which are `px` by view and pixel, and the sum of both.
    fn beside_lines(
        &self,
        terms: &[Term],
        px: &[Vec<f32>],
        axes: &[Axis],
    ) -> (Vec<LearntLines>, Vec<Vec<f32>>) {
        let views = beside_bias(&self.fields, px);
        let lines: Vec<LearntLines> =
            axes.iter().filter_map(|axis| LearntLines::of(&views, *axis)).collect();
        let all: Vec<Term> =
            terms.iter().chain(lines.iter().map(|l| &l.profile)).cloned().collect();
        let px = pixel_terms(&self.fields, &all, self.survey.light, &self.bench);
        (lines, px)
    }

    /// Structure of the noise; against a simulation, what exceeds the simulation's.
    fn textures(&mut self, structure: &mut [Structure], each: f64) -> Vec<TextureFinding> {
        let (mut of_parts, mut shrunk) = (Vec::new(), false);
        if let Some(baseline) = &mut self.baseline {
            let more = baseline.too_much(structure, each);
            baseline.remarks.extend(more);
            let found = self.extended.then(|| self.known.clone());
            let parts = NoiseParts::of(structure, &baseline.structure, each);
            shrunk = parts.as_ref().is_some_and(NoiseParts::shrink_alike);
            of_parts = baseline.noise_findings(parts.as_ref(), structure, &self.fields, each);
            baseline.compare(structure, self.lattice, &mut self.known);
            if let Some(found) = found {
                // The extended model already has it, by name or in the size of the noise.
                let held = |h: &TextureFinding| {
                    let nameless = h.families.is_empty() && !found.variance.is_empty();
                    nameless || h.families.iter().any(|id| found.has(id))
                };
                of_parts.retain(|h| !held(h));
                self.known.overrule(&found);
            }
        }
        let mut textures = texture_findings(structure, &self.known, each);
        let further = self
            .baseline
            .is_none()
            .then(|| further_textures(structure, &self.known, each, &textures));
        textures.retain(|h| self.stands(h.p, each));
        // These are tested against the other views and frames, not against a model.
        textures.extend(further.into_iter().flatten());
        if shrunk && !textures.iter().any(|h| h.families.contains(&"spatial-correlation")) {
            textures.extend(window(structure, &self.known, NAMED_LEVEL));
        }
        textures.extend(of_parts);
        textures
    }

    /// Variance inflation of each view's mean by a pattern that all views share.
    pub fn excess_of_pattern(&self, structure: &[Structure]) -> Vec<f64> {
        let (px2, n) = (fixed_px2(structure), structure.len() as f64);
        let views = structure.iter().zip(&self.survey.views).zip(&self.fields);
        views
            .map(|((s, v), f)| s.excess_of_pattern(px2, f.frames.len() as f64, n, &v.correlation))
            .collect()
    }

    /// Whether tails can be measured against this term. A refit that makes sigma much smaller somewhere rests
    /// on noise lost in quantisation, or on a cause taken for noise: against it everything has tails.
    fn holds_tails(&self, term: &Term) -> bool {
        const MUCH: f64 = -1.4;
        let mut places = self.survey.views.iter().flat_map(|v| v.places.iter());
        !matches!(term.basis, Basis::Table { .. }) || places.all(|place| term.value(place) > MUCH)
    }
}
