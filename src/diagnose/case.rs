//! A diagnosis in progress: the views as read, and the search of their mean.

use std::sync::{Arc, OnceLock};

use super::against::Baseline;
use super::diagnosis::Finding;
use super::finding::pixels::{mean_of, pixel_terms, subtract_terms, terms_of};
use super::missing::DropoutOutcome;
use super::noise::lines::LearntLines;
use super::noise::still::{KeptPattern, beside_bias, still};
use super::options::{Ablation, DiagnoseOptions, measure_options};
use super::search::outcome::Outcome;
use super::search::rules::LATER_LEVEL;
use super::steps::lattice::Step;
use super::steps::measure_steps;
use super::views::column_steps::column_steps;
use super::views::field::Field;
use super::views::known::KnownTerms;
use super::views::layers::Survey;
use super::views::learnt::{Learnt, learnt_from};
use super::views::reading::LoadedViews;
use crate::Progress;
use crate::effects::Active;
use crate::error::Result;
use crate::measure::Workbench;
use crate::model::NoiseModel;
use crate::terms::{Basis, Statistic, Term};
use crate::view::{Excluded, Recording, Sensor};

/// A diagnosis in progress.
pub struct Case<'a> {
    pub recording: &'a Recording,
    pub model: &'a NoiseModel,
    pub options: &'a DiagnoseOptions,
    pub progress: Progress<'a>,
    pub bench: Workbench<'a>,
    pub known: KnownTerms,
    pub fields: Vec<Field>,
    pub survey: Survey,
    pub baseline: Option<Baseline>,
    /// Share of a fixed pattern that remains after the means are subtracted.
    pub kept: KeptPattern,
    /// Step of the stored words.
    pub lattice: Option<Step>,
    /// Losses. The second run reuses those of the first, whose sigma tells how hard an end of the range is.
    pub losses: OnceLock<DropoutOutcome>,
    pub excluded: Vec<Excluded>,
    /// Remarks on the views.
    pub remarks: Vec<String>,
    /// Finding made while reading: the raw values are ranges.
    pub ranges: Option<Finding>,
    /// Finding made in single images; the steps were subtracted while reading.
    pub column_steps: Option<Finding>,
    /// Whether the model includes what a first run found.
    pub extended: bool,
}

/// Results on the mean of the residuals.
pub struct MeanResult {
    pub outcome: Outcome,
    pub terms: Vec<Term>,
    /// Profiles of single columns and rows, which the search does not see.
    pub lines: Vec<LearntLines>,
    /// The terms and the lines at every pixel, px.
    pub px: Vec<Vec<f32>>,
}

impl<'a> Case<'a> {
    pub fn open(
        recording: &'a Recording,
        simulated: Option<&Recording>,
        model: &'a NoiseModel,
        options: &'a DiagnoseOptions,
        progress: Progress<'a>,
    ) -> Result<Self> {
        Active::check_model(&model.effects)?;
        progress.stage("measuring the views");
        let sensor = &recording.sensor;
        if simulated.is_none() {
            model.refuse_other_size(sensor)?;
        }
        let bench = Workbench::new(sensor, measure_options(options));
        let LoadedViews { mut fields, mut excluded, ranges, bench, known, copies } =
            LoadedViews::of(recording, bench, model, progress)?;
        let mut baseline = None;
        if let Some(simulated) = simulated {
            let (measured, without_partner) =
                Baseline::of(simulated, sensor, &mut fields, model, options, progress)?;
            measured.references(&mut fields);
            excluded.extend(without_partner);
            baseline = Some(measured);
        }
        let steps = |f: &Field| f.column_steps.is_some();
        let in_both = baseline.as_ref().is_some_and(|b| b.fields.iter().any(steps));
        let column_steps = column_steps(&fields, &known).filter(|_| !in_both);
        progress.stage("comparing with the model");
        let lattice = measure_steps(&mut fields, recording, &bench.rays);
        let kept = KeptPattern::of(&fields);
        let [bias, variance] = known.light_terms();
        // Beside a simulation both recordings keep the same sigma, so that only their difference counts.
        if baseline.is_none() && !(bias.is_empty() && variance.is_empty()) {
            let light = Survey::of(&fields, &bench, lattice).light;
            subtract_terms(&mut fields, [&bias, &variance], light, &bench);
        }
        let learnt = (learnt_from(model, &known, options, simulated.is_some()), &known);
        let survey =
            survey((&fields, &kept, lattice), &bench, baseline.as_ref(), options, learnt, model);
        Ok(Case {
            recording,
            model,
            options,
            progress,
            bench,
            known,
            fields,
            survey,
            baseline,
            kept,
            lattice,
            losses: OnceLock::new(),
            excluded,
            remarks: copies,
            ranges,
            column_steps,
            extended: false,
        })
    }

    /// Same views with new residuals and another model; their weights do not decrease.
    pub fn again<'b>(self, fields: Vec<Field>, model: &'b NoiseModel) -> Case<'b>
    where
        'a: 'b,
    {
        let known = KnownTerms::of(model, &self.sensor().camera);
        let learnt = (self.survey.learnt_from, &known);
        let weights = self.survey.weights();
        // Two surveys at once are a quarter of all memory.
        drop(self.survey);
        let (bench, baseline) = (&self.bench, self.baseline.as_ref());
        let views = (&fields[..], &self.kept, self.lattice);
        let mut survey = survey(views, bench, baseline, self.options, learnt, model);
        // What remains is weighted at least as much as what was explained.
        if baseline.is_none() {
            survey.weigh_more(weights);
        }
        Case {
            model,
            known,
            fields,
            survey,
            remarks: Vec::new(),
            ranges: None,
            column_steps: None,
            extended: true,
            ..self
        }
    }

    /// Reports the stage that begins: `first` in the first run of the battery, `again` in the one against the
    /// extended model.
    pub fn at(&self, first: &'static str, again: &'static str) {
        self.progress.stage(if self.extended { again } else { first });
    }

    pub fn sensor(&self) -> &'a Sensor {
        &self.recording.sensor
    }

    /// Shares of the nominal false-alarm rate: 0.4 for the mean, a quarter for the variance, a tenth for
    /// the laws, and `EACH_LEVEL` for each of some 20 others.
    pub const MEAN_LEVEL: f64 = 0.4;
    pub const VARIANCE_LEVEL: f64 = 0.25;
    pub const LAWS_LEVEL: f64 = 0.1;

    pub fn level(&self, share: f64) -> f64 {
        share * self.options.level
    }

    /// The same for a search: the second run's terms are beside what the first found.
    pub fn search_level(&self, share: f64) -> f64 {
        self.level(share) * if self.extended { LATER_LEVEL } else { 1.0 }
    }

    pub fn mean(&mut self) -> MeanResult {
        self.at("searching the mean error", "testing the mean again");
        let (camera, level) = (&self.sensor().camera, self.search_level(Self::MEAN_LEVEL));
        let seed = self.options.seed;
        // The second run starts with the weights of the first.
        let first = self.baseline.is_none() && !self.extended;
        if first && self.options.ablation == Ablation::None {
            // Steep parts of a bias and constant lines were taken for correlated noise: views weigh more
            // once both are known, for which large patches are enough.
            let coarse = self.survey.coarse_mean_data();
            let found = self.survey.search_bias(&coarse, camera, level, seed);
            drop(coarse);
            let (terms, px) = self.everywhere(&found);
            let px = self.with_lines(&terms, px);
            self.survey.reweigh(&self.fields, &px);
        }
        let fine = self.survey.mean_data();
        let found = self.survey.search_bias(&fine, camera, level, seed);
        let outcome = self.survey.refit_bias(&fine, camera, found);
        drop(fine);
        let (terms, px) = self.everywhere(&outcome);
        MeanResult { outcome, terms, lines: Vec::new(), px }
    }

    /// Terms of the mean, and their sum at every pixel, px.
    fn everywhere(&self, outcome: &Outcome) -> (Vec<Term>, Vec<Vec<f32>>) {
        let terms = terms_of(outcome, Statistic::Bias);
        let px = pixel_terms(&self.fields, &terms, self.survey.light, &self.bench);
        (terms, px)
    }

    /// Whether a p-value under noise alone is still below `level` once what the model's own views may have
    /// missed is allowed for.
    pub fn stands(&self, p: f64, level: f64) -> bool {
        let views = self.fields.len() as f64;
        self.survey.learnt_from[1].map_or(p, |model| model.p(p, views)) <= level
    }

    /// Whether a finding stands despite its halves. Where the halves of the views do not agree, a curve or a
    /// law must be significant at a tenth of its level, `share` of the whole. In 1167 sets of the development
    /// seeds 1127, 3521 and 3607, 26 findings had such halves, and 23 were as clear; of the three others one
    /// had no cause. The maps of the joint fit have another kind of p-value.
    pub fn halves_allow(&self, f: &Finding, share: f64) -> bool {
        const DISAGREEING: f64 = 0.1;
        let clear = |p: f64| p < DISAGREEING * self.level(share);
        let maps = f.terms.iter().any(|t| matches!(t.basis, Basis::Spline { .. }));
        maps || f.replicated != Some(false) || f.p_adjusted.is_none_or(clear)
    }

    /// Terms subtracted from the means by reading the raw values as ranges.
    pub fn taken_out(&self) -> Vec<Term> {
        self.ranges.iter().flat_map(|f| f.terms.clone()).collect()
    }

    /// Same with the opposite sign: subtracting these restores the means as stored.
    pub fn as_stored(&self) -> Vec<Term> {
        self.taken_out().iter().map(|t| t.times(-1.0)).collect()
    }
}

fn survey(
    (fields, kept, lattice): (&[Field], &KeptPattern, Option<Step>),
    bench: &Workbench<'_>,
    baseline: Option<&Baseline>,
    options: &DiagnoseOptions,
    (learnt_from, known): ([Option<Learnt>; 2], &KnownTerms),
    model: &NoiseModel,
) -> Survey {
    let mut survey = Survey::of(fields, bench, lattice);
    survey.ablate(options.ablation, fields);
    survey.refits_sigma = options.calibrated_here && baseline.is_none();
    let still = still(&beside_bias(fields, &[]), kept);
    survey.fixed_px2 = mean_of(still.into_iter().filter_map(|s| s.fixed_px2));
    if let Some(baseline) = baseline {
        survey.compared();
        baseline.means(&mut survey);
    } else {
        survey.forget_noise_beyond(&model.sigma);
    }
    survey.learnt_from = learnt_from;
    if learnt_from[1].is_some() {
        let of = |statistic| known.between_views(statistic);
        survey.between = Arc::new([of(Statistic::Bias), of(Statistic::Variance)]);
    }
    if learnt_from[0].is_some() {
        survey.absorb_model_bias_error(known);
    }
    survey
}
