//! Runs all layers and collects their findings.

use serde_json::{Map, Value};

use super::case::{Case, MeanResult};
use super::checks::overstated::SHARE;
use super::checks::textures::replicated;
use super::diagnosis::{Detectable, Finding, Status};
use super::distance::reference::{self, can_happen};
use super::echoes::{echoes, fold_into_sigma, forget_noise_of_frames};
use super::edges::mixing::mixing;
use super::finding::findings;
use super::finding::form::better_form;
use super::finding::naming::{doubt_beside_the_unexplained, doubt_where_halves_disagree, finish};
use super::finding::other_findings;
use super::finding::pixels::{typical_sigma_mm, typical_sigma_px};
use super::finding::scene::Scene;
use super::missing::shapes::Step;
use super::missing::{self, DropoutOutcome, missing};
use super::noise::in_time::pattern_px2;
use super::noise::scatter::ScatterResult;
use super::noise::texture_finding::TextureFinding;
use super::options::{Ablation, EACH_LEVEL};
use super::search::bias;
use super::search::few_views::few_views;
use super::search::layer_null::Group;
use super::search::outcome::Outcome;
use super::search::variance;
use super::steps::{COARSE_SIGMAS, own_step, own_step_note, steps};
use super::verdict::{forget_impossible, merge, symptoms};
use super::views::field::Field;
use crate::terms::{Axis, Statistic, corner_radius};

/// Error in the size of the noise, as a share, that its correlation can cause with few frames.
const LEVEL_BESIDE_TEXTURE: f64 = 0.05;

/// Results of one run of all layers.
pub struct Battery {
    pub mean: MeanResult,
    pub scatter: ScatterResult,
    /// Largest first; their shares are nats.
    pub found: Vec<Finding>,
    /// The refit of a sigma that was calibrated on these very views.
    pub refitted: Option<Finding>,
    /// Text on the form that sigma would follow better.
    pub better_form: Option<String>,
    /// Hard ends of the range.
    pub ends: Vec<Step>,
    /// Smallest losses that would have been seen.
    pub detectable_losses: Vec<Detectable>,
}

/// Reports learnt lines by their profile only.
fn tell_lines_once(found: &mut Vec<Finding>) {
    let learnt = |f: &&Finding| f.statistic == Statistic::Bias && !f.terms.is_empty();
    let learnt: Vec<Axis> = found.iter().filter(learnt).map(|f| f.axis).collect();
    found.retain(|f| !(are_lines(f) && f.terms.is_empty() && learnt.contains(&f.axis)));
}

/// Whether it is a nameless mean error of columns or rows.
fn are_lines(f: &Finding) -> bool {
    let of_lines = matches!(f.axis, Axis::Column | Axis::Row);
    f.effect.is_none() && f.statistic == Statistic::Bias && of_lines
}

/// Curves of the mean and of the variance, named or not.
fn curves(scenes: &[Scene<'_>; 2], outcomes: [&Outcome; 2]) -> Vec<Finding> {
    let layers = scenes.iter().zip(outcomes);
    layers.flat_map(|(scene, outcome)| findings::findings(scene, outcome)).collect()
}

/// Finest of the three wave periods searched for pixel-locking, px; the staircase of a coarser step contains
/// such waves.
const LOCKING_WAVE_PX: f64 = 0.33;

impl Case<'_> {
    pub fn scenes(&self) -> [Scene<'_>; 2] {
        let (survey, scale_px_m) = (&self.survey, self.fields[0].scale_px_m);
        let corner_px = corner_radius(&self.sensor().camera);
        let of = |statistic, data| Scene { statistic, survey, data, scale_px_m, corner_px };
        [
            of(Statistic::Bias, survey.coarse_mean_data()),
            of(Statistic::Variance, survey.variance_data()),
        ]
    }

    /// Runs all layers, one after the other.
    pub fn battery(&mut self) -> Battery {
        let mut mean = self.mean();
        let scatter = self.scatter(&mut mean);
        self.at("naming, and searching the lost pixels", "naming what is left");
        let second = self.survey.second();
        let lattice = self.lattice;
        let steps = steps(lattice, &self.known, &self.fields, self.recording, &second);
        let own_step = own_step(lattice, self.recording, self.fields[0].scale_px_m);
        self.remarks.extend(own_step.map(own_step_note));
        let stepped = lattice.is_some();
        let outcomes = [&mean.outcome, &scatter.outcome];
        let scenes = self.scenes();
        let ((lost, of_few_views), (mut curves, textures)) = rayon::join(
            || (self.lost(), self.few_views(&scenes, outcomes, &scatter, stepped)),
            || (curves(&scenes, outcomes), self.texture(&mean, &scatter, steps)),
        );
        let ranges = self.ranges.clone().map(|f| findings::placed(f, &scenes[0]));
        drop(scenes);
        let refitted = self.take_refit(&mut curves);
        curves.retain(|f| self.is_news(f, &scatter));
        // Laws are fitted with the bias terms that are reported.
        let mut bias = mean.terms.clone();
        curves.retain(|f| {
            let of_mean = f.statistic == Statistic::Bias;
            let share = if of_mean { Self::MEAN_LEVEL } else { Self::VARIANCE_LEVEL };
            let told = self.halves_allow(f, share);
            bias.retain(|t| told || !f.terms.contains(t));
            told
        });
        if self.baseline.is_none() {
            forget_noise_of_frames(&mut curves, &textures, &self.fields);
            fold_into_sigma(&mut curves);
        }
        // Shares are still in nats.
        let clear = scatter.outcome.noise.threshold(Group::Other, self.options.level);
        let clearly = refitted.as_ref().is_some_and(|f| f.share > clear);
        let better_form = self.tell_form(&mut curves, clearly);
        let read = ranges.into_iter().chain(self.column_steps.clone());
        let mut found: Vec<Finding> = read.chain(curves).collect();
        let of_size = |f: &Finding| f.statistic == Statistic::Variance;
        let told = self.baseline.is_some() && found.iter().any(of_size);
        // Between two recordings, what the search of the size reports is not reported again for its parts.
        found.extend(textures.into_iter().filter(|f| !(told && of_size(f) && f.effect.is_none())));
        let DropoutOutcome { findings, detectable: mut detectable_losses, ends, notes } = lost;
        self.remarks.extend(notes);
        detectable_losses.retain(|d| can_happen(d.effect, self.sensor().kind));
        found.extend(findings);
        let laws = self.laws(&bias, reference::bent_m(&found)).into_iter();
        found.extend(laws.filter(|f| self.halves_allow(f, Self::LAWS_LEVEL)));
        forget_impossible(&mut found, self.sensor().kind);
        found.extend(of_few_views);
        tell_lines_once(&mut found);
        if let Some(baseline) = &self.baseline {
            symptoms(&mut found, baseline.has_a_window);
        }
        echoes(&mut found);
        merge(&mut found);
        doubt_beside_the_unexplained(&mut found);
        doubt_where_halves_disagree(&mut found);
        found.iter_mut().for_each(finish);
        Battery { mean, scatter, found, refitted, better_form, ends, detectable_losses }
    }

    /// The simulated views, one for each of these.
    fn twins(&self) -> Option<&[Field]> {
        self.baseline.as_ref().map(|b| &b.fields[..])
    }

    /// Whether a finding is more than a consequence of steps, which shift the mean within a step, or of gross
    /// errors, which add to the variance.
    fn is_news(&self, f: &Finding, scatter: &ScatterResult) -> bool {
        let (px_m, near) = (self.fields[0].scale_px_m, self.survey.reach.z[0]);
        let coarsest = self.lattice.map_or(0.0, |step| step.px(px_m, near));
        let sigma_px = typical_sigma_px(&self.fields);
        // A fine step acts like noise and shifts the mean by less than a four-hundredth.
        let of_steps = matches!(f.statistic, Statistic::Bias | Statistic::Variance)
            && coarsest > COARSE_SIGMAS * sigma_px;
        // Steps of depth have no period in the disparity, but a few of them look periodic.
        let aliases = self.lattice.is_some_and(|s| s.is_of_depth || s.size > LOCKING_WAVE_PX);
        let aliased = aliases && f.axis == Axis::DisparityPhase;
        let stepped = of_steps
            && (f.effect.is_none() || aliased)
            && matches!(f.axis, Axis::Z | Axis::DisparityPhase | Axis::Radius | Axis::Pixel)
            && own_step(self.lattice, self.recording, px_m).is_none()
            && f.size.sigma * sigma_px < 0.3 * coarsest;
        let of_all =
            |t: &TextureFinding| t.of_some.is_none() && t.statistic != Statistic::Distribution;
        let textures = scatter.textures.iter().any(of_all) || scatter.tails.is_some();
        let textured = scatter.tails.as_ref().is_some_and(TextureFinding::are_far_errors)
            || (textures && f.size.sigma < LEVEL_BESIDE_TEXTURE);
        let tailed = textured && f.status == Status::Recalibrate;
        !stepped && !tailed
    }

    /// Whether the measured values are clearly more than twice the model's.
    fn is_more(&self, families: &[&'static str], parameters: &Map<String, Value>) -> bool {
        let more = |id: &&str| {
            parameters.iter().all(|(name, measured)| {
                let of = |what: &str| measured.get(what).and_then(Value::as_f64).unwrap_or(0.0);
                let had = self.known.parameter(id, name).unwrap_or(0.0);
                SHARE * (of("value") - 2.0 * of("std_error")) > had
            })
        };
        families.iter().all(|id| !self.known.has(id) || more(id))
    }

    /// Findings that neither a mean nor a variance shows: correlation of the noise, tails, steps.
    fn texture(
        &self,
        mean: &MeanResult,
        scatter: &ScatterResult,
        steps: Vec<Finding>,
    ) -> Vec<Finding> {
        let sigma_mm = typical_sigma_mm(&self.fields);
        let level = self.level(EACH_LEVEL);
        let mixing = mixing(&self.fields, self.twins(), level)
            .filter(|m| self.is_more(&m.families, &m.parameters) && self.stands(m.p, level));
        let textures = scatter.textures.iter().cloned().chain(scatter.tails.clone()).chain(mixing);
        let second = self.survey.second();
        let told = |h: TextureFinding| {
            let (views, fields) = (&scatter.structure, &self.fields);
            let replicated = replicated(&h, views, fields, &second, &self.known);
            other_findings::texture(h, sigma_mm, replicated)
        };
        let textures = textures.map(told).chain(self.overstated(scatter));
        let mut found: Vec<Finding> = textures.chain(steps).collect();
        // Fixed lines have no name, but they are learnt.
        let pattern_px2 = pattern_px2(&scatter.structure, &scatter.textures, &self.known);
        for f in found.iter_mut().filter(|f| are_lines(f)) {
            let axis = f.axis;
            let lines = mean.lines.iter().filter(|l| l.axis == axis);
            lines.for_each(|l| l.tell(f, pattern_px2));
        }
        found
    }

    /// Effects that only a few views have. Not searched between two recordings: two runs of a light
    /// simulation differ view by view for no identifiable reason.
    fn few_views(
        &self,
        [mean, scatter]: &[Scene<'_>; 2],
        outcomes: [&Outcome; 2],
        measured: &ScatterResult,
        stepped: bool,
    ) -> Vec<Finding> {
        if self.baseline.is_some() || self.options.ablation != Ablation::None {
            return Vec::new();
        }
        let (survey, camera, seed) = (&self.survey, &self.sensor().camera, self.options.seed);
        let level = self.level(EACH_LEVEL);
        let bounds = survey.bounds(camera);
        let bias = || {
            let candidates = bias::candidates(&bounds);
            let rules = survey.bias_rules(camera, level);
            let excess = self.excess_of_pattern(&measured.structure);
            few_views(mean, &survey.mean_data(), &candidates, outcomes[0], &rules, &excess, seed)
        };
        let variance = || {
            let candidates = variance::candidates(&bounds, &self.model.sigma);
            let rules = survey.variance_rules(level);
            few_views(scatter, &scatter.data, &candidates, outcomes[1], &rules, &[], seed)
        };
        // Where the words step, the mean of every view steps too, at places of its own.
        let bias = (!stepped).then(bias).flatten();
        // So does its noise, from view to view, about a sigma learnt from other views.
        let taught = survey.learnt_from[1].is_some();
        let variance = (!(stepped && taught)).then(variance).flatten();
        bias.into_iter().chain(variance).collect()
    }

    /// Takes out the refit of a sigma that was calibrated here. It is no finding, but the extended model has
    /// it because all else was fitted with it.
    fn take_refit(&self, curves: &mut Vec<Finding>) -> Option<Finding> {
        if !self.survey.refits_sigma {
            return None;
        }
        let at = curves.iter().position(|f| f.status == Status::Recalibrate)?;
        Some(curves.remove(at))
    }

    /// Tells which form would fit better where sigma's own does not: in the finding, and as a remark.
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

    /// Losses that neither the model nor the simulation has.
    fn lost(&self) -> DropoutOutcome {
        let seen_by = (&self.sensor().camera, &self.bench.rays);
        let twins = self.baseline.as_ref().map(|b| (&b.fields[..], &b.survey));
        let seed = self.options.seed;
        let search = || missing(&self.fields, twins, &self.survey, seen_by, seed);
        let mut lost = self.losses.get_or_init(search).clone();
        let alike = self.baseline.as_ref().is_some_and(|b| b.loses_alike(&self.survey));
        lost.findings.retain(|m| {
            // Losses beside the target are not in any tile.
            let on_target = m.effect != Some("occlusion-shadow");
            m.effect.is_none_or(|id| !self.known.has(id))
                && m.p_adjusted.is_some_and(|p| self.stands(p, missing::LEVEL))
                && !(alike && on_target)
        });
        lost
    }
}
