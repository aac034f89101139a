//! The diagnosis from end to end: locate, name, model, show.

use serde_json::Map;

use super::ablation::Ablation;
use super::against::Baseline;
use super::diagnosis::{
    DIAGNOSIS_FORMAT, Detectable, Diagnosis, Finding, Reference, Status, Verdict,
};
use super::field::Field;
use super::findings::{self, Scene};
use super::form::better_form;
use super::heldout;
use super::known::KnownTerms;
use super::lattice::Quantisation;
use super::layers::Survey;
use super::lines::lines;
use super::missing::missing;
use super::next_view;
use super::noise::{Hanging, hanging, tails};
use super::pixels::{
    common, fixed_px2, measure_tails, pixel_terms, terms_of, typical_sigma_mm, typical_sigma_px,
};
use super::reading::{Taken, refuse_other_size};
use super::reference;
use super::rim;
use super::search::Outcome;
use super::steps::{Steps, is_raw, lattice, steps};
use super::structure::structures;
use super::verdict::{
    MIN_SIZE, after, echoes, extend, fold_into_sigma, merge, not_identifiable, shares, symptoms,
    view_lines,
};
use crate::Progress;
use crate::effects::KINECT_BASELINE_M;
use crate::error::Result;
use crate::measure::{MeasureOptions, Workbench};
use crate::model::{Form, NoiseModel};
use crate::rng::Seed;
use crate::terms::{Axis, Basis, PixelContext, Statistic, Term, corner_radius};
use crate::view::{Excluded, Recording, Sensor};

/// Settings of a diagnosis.
#[derive(Debug, Clone, Copy)]
pub struct DiagnoseOptions {
    pub seed: Seed,
    /// Chance that a clean recording is said to have anything wrong.
    pub level: f64,
    /// The model was calibrated on this very recording, causes and all: sigma is refitted beside
    /// whatever is found, and that is no finding.
    pub calibrated_here: bool,
    /// Nothing, but in tests of what each part is for.
    pub ablation: Ablation,
}

impl Default for DiagnoseOptions {
    fn default() -> Self {
        DiagnoseOptions {
            seed: Seed(1),
            level: 0.03,
            calibrated_here: false,
            ablation: Ablation::None,
        }
    }
}

/// A finished diagnosis.
pub struct Diagnosed {
    pub diagnosis: Diagnosis,
    /// The model with what was found.
    pub model: NoiseModel,
    pub fields: Vec<Field>,
    /// Terms of the bias that were found, for pictures.
    pub bias: Vec<Term>,
    /// The same at every pixel of every field, px; empty when there are none.
    pub bias_px: Vec<Vec<f32>>,
    pub excluded: Vec<Excluded>,
    /// The simulated views, where there are any, in the same order.
    pub against: Vec<Field>,
}

impl Diagnosed {
    /// Mean residual of every pixel of a view, beyond the simulated one's where there is one, px.
    pub fn recorded(&self, view: usize) -> Vec<f32> {
        let mean = &self.fields[view].mean;
        let Some(twin) = self.against.get(view) else { return mean.clone() };
        let theirs = twin.image(&twin.mean);
        let at = |i: u32| theirs.get(i as usize).copied().unwrap_or(f32::NAN);
        self.fields[view].pixels.iter().zip(mean).map(|(&i, m)| m - at(i)).collect()
    }
}

/// How noise hangs together changes what a few frames show of its size by so much.
const LEVEL_BESIDE_TEXTURE: f64 = 0.05;

/// Fewest views that anything is said about.
pub const FEWEST_VIEWS: usize = 3;

/// Find out what `model` leaves out of `recording`.
///
/// # Errors
/// When fewer than three views can be used.
pub fn diagnose(
    recording: &Recording,
    model: &NoiseModel,
    options: &DiagnoseOptions,
    progress: Progress<'_>,
) -> Result<Diagnosed> {
    run(recording, None, model, options, progress)
}

/// Find out what a simulation leaves out: `simulated` is its recording of the same views, `model`
/// the sigma to weigh by.
///
/// # Errors
/// When another sensor was simulated, or fewer than three views have a partner.
pub fn diagnose_against(
    recording: &Recording,
    simulated: &Recording,
    model: &NoiseModel,
    options: &DiagnoseOptions,
    progress: Progress<'_>,
) -> Result<Diagnosed> {
    run(recording, Some(simulated), model, options, progress)
}

pub(super) fn measure_options(options: &DiagnoseOptions) -> MeasureOptions {
    MeasureOptions { seed: options.seed, ..MeasureOptions::default() }
}

/// A diagnosis under way.
struct Case<'a> {
    recording: &'a Recording,
    model: &'a NoiseModel,
    options: &'a DiagnoseOptions,
    bench: Workbench<'a>,
    known: KnownTerms,
    fields: Vec<Field>,
    survey: Survey,
    baseline: Option<Baseline>,
    excluded: Vec<Excluded>,
    /// What was odd about the views, in words.
    copies: Vec<String>,
    /// Found while reading: the words are ranges.
    ranges: Option<Finding>,
}

/// What the residuals' mean shows.
struct Mean {
    outcome: Outcome,
    terms: Vec<Term>,
    /// The terms at every pixel, px.
    px: Vec<Vec<f32>>,
}

/// What scatters about it.
struct Scatter {
    lattice: Quantisation,
    hangs: Vec<Hanging>,
    tails: Option<Hanging>,
    /// Of the variance.
    outcome: Outcome,
}

fn run(
    recording: &Recording,
    simulated: Option<&Recording>,
    model: &NoiseModel,
    options: &DiagnoseOptions,
    progress: Progress<'_>,
) -> Result<Diagnosed> {
    let mut case = Case::open(recording, simulated, model, options, progress)?;
    let mean = case.mean();
    let scatter = case.scatter(&mean);
    Ok(case.conclude(mean, &scatter))
}

impl<'a> Case<'a> {
    fn open(
        recording: &'a Recording,
        simulated: Option<&Recording>,
        model: &'a NoiseModel,
        options: &'a DiagnoseOptions,
        progress: Progress<'_>,
    ) -> Result<Self> {
        let sensor = &recording.sensor;
        if simulated.is_none() {
            refuse_other_size(model, sensor)?;
        }
        let bench = Workbench::new(sensor, measure_options(options));
        let known = KnownTerms::of(model, &sensor.camera);
        let Taken { mut fields, excluded, ranges, copies } =
            Taken::of(recording, &bench, model, &known, progress)?;
        let baseline = simulated
            .map(|s| Baseline::of(s, sensor, &mut fields, model, options, progress))
            .transpose()?;
        let mut survey = Survey::of(&fields, &sensor.camera, &bench.rays);
        survey.ablate(options.ablation, &fields);
        survey.refits_sigma = options.calibrated_here && simulated.is_none();
        if simulated.is_none() && !options.calibrated_here && model.fit.views > 0 {
            let views = Some(model.fit.views as f64);
            let learnt = known.bias_is_learnt().then_some(views).flatten();
            survey.learnt_from = [learnt, views];
            survey.forgive_bias(&known);
        }
        survey.fixed_px2 = fixed_px2(&structures(&fields, &sensor.camera, &[]));
        if let Some(baseline) = &baseline {
            baseline.references(&mut fields);
            baseline.means(&mut survey);
        }
        Ok(Case {
            recording,
            model,
            options,
            bench,
            known,
            fields,
            survey,
            baseline,
            excluded,
            copies,
            ranges,
        })
    }

    fn sensor(&self) -> &'a Sensor {
        &self.recording.sensor
    }

    /// One error rate for everything: this share of it to the mean, a quarter to the variance, the
    /// rest to all others.
    const MEAN_LEVEL: f64 = 0.4;
    const VARIANCE_LEVEL: f64 = 0.25;
    const EACH_LEVEL: f64 = 0.03;
    const LAWS_LEVEL: f64 = 0.1;

    fn level(&self, share: f64) -> f64 {
        share * self.options.level
    }

    fn mean(&mut self) -> Mean {
        let first = self.search_mean();
        // What is steep in a bias was taken for noise that hangs together: views count for more
        // once it is known.
        let weighed = self.baseline.is_none()
            && self.options.ablation == Ablation::None
            && self.survey.reweigh(&self.fields, &first.px);
        if weighed { self.search_mean() } else { first }
    }

    fn search_mean(&self) -> Mean {
        let level = self.level(Self::MEAN_LEVEL);
        let outcome = self.survey.search_bias(&self.sensor().camera, level, self.options.seed);
        let terms = terms_of(&outcome, Statistic::Bias);
        let px = pixel_terms(&self.fields, &terms, &self.survey, &self.bench);
        Mean { outcome, terms, px }
    }

    fn scatter(&mut self, mean: &Mean) -> Scatter {
        let camera = &self.recording.sensor.camera;
        let mut structure = structures(&self.fields, camera, &mean.px);
        let lattice = lattice(&self.fields, self.recording);
        let own = Steps::of(&lattice, &structure, &self.fields, self.recording);
        let theirs = self.baseline.as_ref().map(|b| b.steps);
        let extra = |p: &PixelContext| (own.at(p) - theirs.map_or(0.0, |s| s.at(p))).max(0.0);
        let each = self.level(Self::EACH_LEVEL);
        if let Some(baseline) = &mut self.baseline {
            let more = baseline.too_much(&structure, each);
            baseline.remarks.extend(more);
            baseline.compare(&mut structure, &lattice, &mut self.known);
        }
        let hangs = hanging(&structure, &self.known, each);
        self.survey.compare_frames(&self.fields, common(&structure, &hangs, &self.known));
        let compared =
            self.baseline.as_mut().is_some_and(|baseline| baseline.variances(&mut self.survey));
        let range_share = self.range_share(&mean.terms);
        // A range in place of a depth makes a disparity, and its noise, smaller.
        let stretch = |p: &PixelContext| {
            let ray = 1.0 / (1.0 + p.x * p.x + p.y * p.y).sqrt();
            (1.0 + range_share.clamp(0.0, 1.0) * (ray - 1.0)).powi(2)
        };
        self.survey.roughen(&self.fields, &mean.px, extra, stretch);
        if let Some(baseline) = self.baseline.as_ref().filter(|_| compared) {
            baseline.doubt(&mut self.survey);
        }
        let level = self.level(Self::VARIANCE_LEVEL);
        let sigma = &self.model.sigma;
        if self.survey.learnt_from[1].is_some() {
            self.survey.forgive_variance(&self.known, sigma);
        }
        let outcome = self.survey.search_variance(sigma, camera, level, self.options.seed);
        let terms = terms_of(&outcome, Statistic::Variance);
        measure_tails(&mut structure, &self.fields, &mean.px, &terms, &self.survey, &self.bench);
        let alike = self.baseline.as_ref().is_some_and(|b| b.tails_alike(&structure));
        let holds = |t: &Term| self.holds_tails(t);
        let uneven = outcome.chosen.iter().any(|c| c.candidate.family.is_none())
            || self.survey.refits_sigma && !terms.iter().all(holds)
            || self.known.has_uneven_noise()
            || !self.known.variance.iter().all(holds);
        let tails = tails(&structure, &self.known, each, uneven).filter(|_| !alike);
        Scatter { lattice, hangs, tails, outcome }
    }

    /// A refit that makes sigma much smaller somewhere rests on noise that steps have swallowed, or
    /// on a cause that was taken for noise: against it everything has tails.
    fn holds_tails(&self, term: &Term) -> bool {
        const MUCH: f64 = -1.4;
        let mut row = Vec::new();
        let mut tiles = self.survey.views.iter().flat_map(|v| &v.tiles);
        !matches!(term.basis, Basis::Recalibrate { .. })
            || tiles.all(|t| term.value(&t.place, &mut row) > MUCH)
    }

    fn range_share(&self, terms: &[Term]) -> f64 {
        self.known
            .bias
            .iter()
            .chain(terms)
            .chain(self.ranges.iter().flat_map(|f| &f.terms))
            .filter(|t| t.basis == Basis::RangeNotDepth)
            .map(|t| t.coefficients[0])
            .sum()
    }

    fn scenes(&self) -> [Scene<'_>; 2] {
        let scale_px_m = self.fields[0].scale_px_m;
        let corner = corner_radius(&self.sensor().camera);
        [
            Scene::bias(&self.survey, scale_px_m, corner),
            Scene::variance(&self.survey, scale_px_m, corner),
        ]
    }

    /// Curves of the mean and of the variance, named or not, with the advised view.
    fn curves(&self, scenes: &[Scene<'_>; 2], outcomes: [&Outcome; 2]) -> Vec<Finding> {
        let mut found: Vec<Finding> = scenes
            .iter()
            .zip(outcomes)
            .flat_map(|(scene, outcome)| findings::findings(scene, outcome))
            .collect();
        let camera = &self.sensor().camera;
        for (scene, outcome) in scenes.iter().zip(outcomes) {
            let sigma = &self.model.sigma;
            if let Some(outlook) = next_view::outlook(scene, sigma, camera, &self.bench.rays) {
                next_view::advise(&mut found, scene, outcome, &outlook);
            }
        }
        found
    }

    /// Steps shift the mean within a step, and gross errors add to the variance: neither is news.
    fn is_news(&self, f: &Finding, steps: &[Finding], scatter: &Scatter) -> bool {
        let scale_px_m = self.fields[0].scale_px_m;
        let depth_px = |step: f64| step * scale_px_m / self.survey.reach.z[0].powi(2);
        let coarsest = scatter
            .lattice
            .disparity_step_px
            .unwrap_or(0.0)
            .max(scatter.lattice.depth_step_m.map_or(0.0, depth_px));
        let stepped = (!steps.is_empty() || self.baseline.is_some())
            && f.effect.is_none()
            && f.statistic == Statistic::Bias
            && matches!(f.axis, Axis::Z | Axis::DisparityPhase | Axis::Radius | Axis::Pixel)
            && !is_raw(self.recording)
            && f.size.sigma * typical_sigma_px(&self.fields) < 0.3 * coarsest;
        let textured = scatter.tails.is_some()
            || (!scatter.hangs.is_empty() && f.size.sigma < LEVEL_BESIDE_TEXTURE);
        let tailed = textured && f.status == Status::Recalibrate;
        !stepped && !tailed && f.size.sigma > self.options.ablation.min_size(MIN_SIZE)
    }

    /// What neither a mean nor a variance shows: how the noise hangs together, tails, steps.
    fn texture(&self, mean: &Mean, scatter: &Scatter, steps: Vec<Finding>) -> Vec<Finding> {
        let sigma_mm = typical_sigma_mm(&self.fields);
        let mixing = rim::mixing(&self.fields, self.level(Self::EACH_LEVEL))
            .filter(|_| !self.known.has("edge-mixing"));
        let hangs = scatter.hangs.iter().cloned().chain(scatter.tails.clone()).chain(mixing);
        let mut found: Vec<Finding> =
            hangs.map(|h| findings::hanging(h, sigma_mm)).chain(steps).collect();
        // Lines that stand still have no name, but they can be learnt.
        let stands = |f: &&mut Finding| {
            f.effect.is_none() && f.statistic == Statistic::Bias && f.axis == Axis::Column
        };
        if self.baseline.is_none() {
            for f in found.iter_mut().filter(stands) {
                let lines = lines(&self.fields, &mean.px);
                f.terms = lines.terms;
                f.covariance.variances = lines.variances;
            }
        }
        found
    }

    /// The refit of a sigma that was calibrated here is no finding; the extended model has it, for all
    /// else was fitted beside it.
    fn take_refit(&self, curves: &mut Vec<Finding>) -> Option<Finding> {
        if !self.survey.refits_sigma {
            return None;
        }
        let at = curves.iter().position(|f| f.status == Status::Recalibrate)?;
        Some(curves.remove(at))
    }

    /// Where sigma's own form is off, the form that would do better: beside the finding, and as a
    /// remark.
    fn tell_form(&self, curves: &mut [Finding], refitted: bool) -> Option<String> {
        let told = curves.iter_mut().find(|f| f.status == Status::Recalibrate);
        if self.baseline.is_some() || told.is_none() && !refitted {
            return None;
        }
        let better = better_form(&self.survey, &self.model.sigma, self.fields[0].scale_px_m)?;
        if let Some(finding) = told {
            finding.physics += &format!(" The noise follows better: {better}.");
        }
        Some(format!("sigma over depth and tilt follows better: {better}"))
    }

    fn lost(&mut self) -> (Vec<Finding>, Vec<Detectable>) {
        let camera = &self.sensor().camera;
        let lost = missing(&self.fields, &self.survey, camera, &self.bench.rays, self.options.seed);
        self.copies.extend(lost.notes);
        let known = |id| self.known.has(id);
        let baseline = self.baseline.as_ref();
        let found = lost
            .findings
            .into_iter()
            .filter(|m| !m.family.is_some_and(known))
            .filter(|m| baseline.is_none_or(|b| !b.loses_alike(m, &self.survey)))
            .map(findings::missing)
            .collect();
        let least = |&(effect, name, least): &(&'static str, &str, f64)| {
            let mut minimum = Map::new();
            minimum.insert(name.into(), serde_json::json!(least));
            Detectable { effect, minimum }
        };
        (found, lost.detectable.iter().map(least).collect())
    }

    /// Laws of the distance, by reference distances.
    fn laws(&self, bias: &[Term]) -> Vec<Finding> {
        // Only what is nothing on the optical axis by its physics tells how far the plane bent there.
        let is_anchored = |t: &Term| matches!(t.basis, Basis::RangeNotDepth | Basis::Lens { .. });
        let anchored: Vec<Term> = bias.iter().filter(|t| is_anchored(t)).cloned().collect();
        let excess =
            self.survey.learnt_from[0].map_or(1.0, |views| 1.0 + self.fields.len() as f64 / views);
        let found = |terms: &[Term]| {
            let levels = heldout::levels(&self.survey, terms);
            let laws = reference::laws(&self.fields, &levels);
            let level = self.level(Self::LAWS_LEVEL);
            reference::findings(&laws, &self.known, excess, level, self.options.seed)
        };
        // A bowl, too, moves the plane on the axis, by what nobody can tell from a law of the
        // distance: a law must hold with and without it, be it new or the model's.
        let back = |t: &Term| Term {
            coefficients: t.coefficients.iter().map(|c| -c).collect(),
            ..t.clone()
        };
        let model: Vec<Term> =
            self.known.bias.iter().filter(|t| !is_anchored(t)).map(back).collect();
        let mut laws = found(&anchored);
        for others in [bias.to_vec(), [anchored, model].concat()] {
            let with = found(&others);
            laws.retain(|l| with.iter().any(|w| w.effect == l.effect));
        }
        laws
    }

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

    fn conclude(mut self, mean: Mean, scatter: &Scatter) -> Diagnosed {
        let camera = &self.recording.sensor.camera;
        let scenes = self.scenes();
        let outcomes = [&mean.outcome, &scatter.outcome];
        let sigma_mm = typical_sigma_mm(&self.fields);
        let steps = steps(&scatter.lattice, &self.known, &self.fields, self.recording, sigma_mm);
        let mut curves = self.curves(&scenes, outcomes);
        let refitted = self.take_refit(&mut curves);
        curves.retain(|f| self.is_news(f, &steps, scatter));
        if self.baseline.is_none() {
            fold_into_sigma(&mut curves);
        }
        // Nats, as long as they are not shares.
        let clear = scatter.outcome.noise.threshold(self.options.level);
        let clearly = refitted.as_ref().is_some_and(|f| f.share > clear);
        let better = self.tell_form(&mut curves, clearly);
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
        let mut detectable =
            super::detectable::detectable(&self.survey, &mean.outcome, &scatter.outcome, camera);
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
