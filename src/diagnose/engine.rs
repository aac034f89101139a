//! The diagnosis from end to end: locate, name, model, show.

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use serde_json::Map;

use super::against::Baseline;
use super::diagnosis::{
    After, CannotTell, DIAGNOSIS_FORMAT, Diagnosis, Finding, Reference, Remaining, Size, Status,
    Verdict, ViewLine,
};
use super::field::Field;
use super::findings::{self, Scene};
use super::heldout;
use super::known::Known;
use super::lattice::{Lattice, Words};
use super::layers::{BIAS_PRIOR, Survey};
use super::missing::missing;
use super::next_view;
use super::noise::{Hanging, hanging, tails};
use super::parameters::estimate;
use super::reference;
use super::rim;
use super::search::Outcome;
use super::smooth::{SMOOTH_PX, high_pass};
use super::structure::{Structure, moving, structures, tail};
use super::tiles::Places;
use crate::effects;
use crate::effects::KINECT_BASELINE_M;
use crate::error::{Error, Result};
use crate::frame::DepthCode;
use crate::measure::{MeasureOptions, Workbench};
use crate::model::{Effect, NoiseModel, UNEXPLAINED};
use crate::rng::Seed;
use crate::terms::{Axis, Basis, Place, Statistic, Term, corner_radius};
use crate::view::{Excluded, Recording};

/// Settings of a diagnosis.
#[derive(Debug, Clone, Copy)]
pub struct DiagnoseOptions {
    pub seed: Seed,
    /// Chance that a clean recording is said to have anything wrong.
    pub level: f64,
}

impl Default for DiagnoseOptions {
    fn default() -> Self {
        DiagnoseOptions { seed: Seed(1), level: 0.03 }
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

/// Steps done, steps in all.
pub type Progress<'a> = &'a (dyn Fn(usize, usize) + Sync);

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

fn run(
    recording: &Recording,
    simulated: Option<&Recording>,
    model: &NoiseModel,
    options: &DiagnoseOptions,
    progress: Progress<'_>,
) -> Result<Diagnosed> {
    let sensor = &recording.sensor;
    let camera = &sensor.camera;
    if simulated.is_none() {
        refuse_other_size(model, sensor)?;
    }
    let bench = Workbench::new(sensor, measure_options(options));
    let mut known = Known::of(model, camera);
    let (mut fields, mut excluded) = read(recording, &bench, model, &known, progress);
    let mut found = Vec::new();
    if let Some(flat) = as_ranges(recording, &bench, model, &known, fields.len()) {
        (fields, excluded) = flat;
        found.push(ranges());
    }
    let copies = without_copies(&mut fields);
    if fields.len() < FEWEST_VIEWS {
        let first = excluded
            .first()
            .map_or_else(String::new, |e| format!("; view {}: {}", e.view, e.reason));
        return Err(Error::recording(
            &recording.root,
            format!("{} of {} views can be used{first}", fields.len(), recording.views.len()),
            "a diagnosis needs at least three views of a plane",
        ));
    }
    let mut baseline = simulated
        .map(|s| Baseline::of(s, sensor, &mut fields, model, options, progress))
        .transpose()?;
    let mut survey = Survey::of(&fields, camera, &bench.rays);
    survey.fixed_px2 = fixed_px2(&structures(&fields, camera, &[]));
    if let Some(baseline) = &baseline {
        baseline.references(&mut fields);
        baseline.means(&mut survey);
    }
    let scale_px_m = fields[0].scale_px_m;
    let corner = corner_radius(camera);
    // One error rate for everything: half to the mean, a quarter to the variance, the rest shared.
    let level = options.level;
    let bias = survey.search_bias(camera, 0.4 * level, options.seed);
    let bias_terms = terms_of(&bias, Statistic::Bias);
    let bias_px = pixel_terms(&fields, &bias_terms, &survey, &bench);
    let mut structure = structures(&fields, camera, &bias_px);
    let lattice = lattice(&fields, recording);
    let own = Steps::of(&lattice, &structure, &fields, recording);
    let theirs = baseline.as_ref().map(|b| b.steps);
    let extra = |p: &Place| (own.at(p) - theirs.map_or(0.0, |s| s.at(p))).max(0.0);
    let mut compared = false;
    if let Some(baseline) = &mut baseline {
        let more = baseline.too_much(&structure, 0.03 * level);
        baseline.remarks.extend(more);
        baseline.compare(&mut structure, &lattice, &mut known);
        compared = baseline.variances(&mut survey);
    }
    let range_share: f64 = known
        .bias
        .iter()
        .chain(&bias_terms)
        .chain(found.iter().flat_map(|f: &Finding| &f.terms))
        .filter(|t| t.basis == Basis::RangeNotDepth)
        .map(|t| t.coefficients[0])
        .sum();
    // A range in place of a depth makes a disparity, and its noise, smaller.
    let stretch = |p: &Place| {
        let ray = 1.0 / (1.0 + p.x * p.x + p.y * p.y).sqrt();
        (1.0 + range_share.clamp(0.0, 1.0) * (ray - 1.0)).powi(2)
    };
    survey.roughen(&fields, &bias_px, extra, stretch);
    let hangs = hanging(&structure, &known, 0.03 * level);
    survey.compare_frames(&fields, common(&structure, &hangs, &known));
    if let Some(baseline) = baseline.as_ref().filter(|_| compared) {
        baseline.doubt(&mut survey);
    }
    let variance = survey.search_variance(&model.sigma, camera, 0.25 * level, options.seed);
    let variance_terms = terms_of(&variance, Statistic::Variance);
    let bias_scene = Scene::bias(&survey, scale_px_m, corner);
    let variance_scene = Scene::variance(&survey, scale_px_m, corner);
    let sigma_mm = typical_sigma_mm(&fields);
    measure_tails(&mut structure, &fields, &bias_px, &variance_terms, &survey, &bench);
    let tails = tails(&structure, &known);
    let mut terms = findings::findings(&bias_scene, &bias);
    terms.extend(findings::findings(&variance_scene, &variance));
    for (scene, outcome) in [(&bias_scene, &bias), (&variance_scene, &variance)] {
        if let Some(outlook) = next_view::outlook(scene, &model.sigma, camera, &bench.rays) {
            next_view::advise(&mut terms, scene, outcome, &outlook);
        }
    }
    let steps = steps(&lattice, &known, &fields, recording, sigma_mm);
    // Steps shift the mean within a step, and gross errors add to the variance: neither is news.
    let coarsest = lattice
        .disparity_step_px
        .unwrap_or(0.0)
        .max(lattice.depth_step_m.map_or(0.0, |s| s * scale_px_m / survey.reach.z[0].powi(2)));
    terms.retain(|f| {
        let stepped = (!steps.is_empty() || baseline.is_some())
            && f.effect.is_none()
            && f.statistic == Statistic::Bias
            && matches!(f.axis, Axis::Z | Axis::DisparityPhase | Axis::Radius | Axis::Pixel)
            && !is_raw(recording)
            && f.size.sigma * typical_sigma_px(&fields) < 0.3 * coarsest;
        let tailed = tails.is_some() && f.status == Status::Recalibrate;
        !stepped && !tailed && f.size.sigma > least_size(f.statistic)
    });
    found.extend(terms);
    found.extend(
        hangs
            .into_iter()
            .chain(tails)
            .chain(rim::mixing(&fields, 0.03 * level).filter(|_| !known.has("edge-mixing")))
            .map(|h| findings::hanging(h, sigma_mm)),
    );
    found.extend(steps);
    let lost = missing(&fields, &survey, camera, &bench.rays, options.seed);
    found.extend(
        lost.findings
            .into_iter()
            .filter(|m| m.family.is_none_or(|id| !known.has(id)))
            .filter(|m| baseline.as_ref().is_none_or(|b| !b.loses_alike(m, &survey)))
            .map(findings::missing),
    );
    // Only what is nothing on the optical axis by its physics tells how far the plane bent there.
    let anchored: Vec<Term> = bias_terms
        .iter()
        .filter(|t| matches!(t.basis, Basis::RangeNotDepth | Basis::Lens { .. }))
        .cloned()
        .collect();
    let levels = heldout::levels(&survey, &anchored);
    let references = reference::laws(&fields, &levels);
    let mut laws = reference::findings(&references, &known, 0.1 * level, options.seed);
    // A bowl, too, moves the plane on the axis, by what nobody can tell from a law of the distance:
    // a law must hold with and without it.
    let all = heldout::levels(&survey, &bias_terms);
    let with = reference::laws(&fields, &all);
    let with = reference::findings(&with, &known, 0.1 * level, options.seed);
    laws.retain(|l| with.iter().any(|w| w.effect == l.effect));
    found.extend(laws);
    let mismatch = found.iter().any(|f| f.status != Status::NotIdentifiable);
    let cannot_tell = reference::cannot_tell(&fields);
    found.extend(cannot_tell.iter().map(not_identifiable));
    let columns_told = found.iter().any(|f| f.axis == Axis::Column && !f.terms.is_empty());
    found.retain(|f| {
        let lines = f.axis == Axis::Column && f.statistic == Statistic::Bias && f.terms.is_empty();
        !(lines && columns_told)
    });
    merge(&mut found);
    shares(&mut found);
    let heldout = heldout::score(&survey, model, camera, scale_px_m, options);
    let left_out = heldout::left_out(&survey, &bias_terms, BIAS_PRIOR);
    let mut map = findings::map(&bias_scene, &bias, level);
    map.extend(findings::map(&variance_scene, &variance, level));
    let after = after(&bias, &variance);
    let verdict = if mismatch { Verdict::Mismatch } else { Verdict::Match };
    let extended = extend(model, &found, sensor);
    let views = view_lines(&fields, &survey, &bias_terms, heldout.as_ref());
    let mut detectable = super::detectable::detectable(&survey, &bias, &variance, camera);
    detectable.extend(lost.detectable.iter().map(|&(effect, name, least)| {
        let mut minimum = Map::new();
        minimum.insert(name.into(), serde_json::json!(least));
        super::diagnosis::Detectable { effect, minimum }
    }));
    let mut remarks = recording.remarks.clone();
    remarks.extend(copies);
    if sensor.baseline_m.is_none() {
        remarks.push(format!(
            "the recording gives no baseline_m: {KINECT_BASELINE_M} m, a Kinect v1's, is assumed; all disparities scale with it"
        ));
    }
    remarks.extend(excluded.iter().map(ToString::to_string));
    remarks.extend(baseline.iter_mut().flat_map(|b| std::mem::take(&mut b.remarks)));
    let diagnosis = Diagnosis {
        format: DIAGNOSIS_FORMAT,
        recording: recording.root.display().to_string(),
        reference: if simulated.is_some() {
            Reference::SimulatedRecording
        } else {
            Reference::Model
        },
        verdict,
        findings: found,
        map,
        heldout,
        left_out,
        after,
        detectable,
        cannot_tell,
        views,
        remarks,
    };
    let against = baseline.map_or_else(Vec::new, |b| b.fields);
    Ok(Diagnosed {
        diagnosis,
        model: extended,
        fields,
        bias: bias_terms,
        bias_px,
        excluded,
        against,
    })
}

fn refuse_other_size(model: &NoiseModel, sensor: &crate::view::Sensor) -> Result<()> {
    let Some(other) = &model.sensor else { return Ok(()) };
    let (theirs, ours) = (&other.camera, &sensor.camera);
    if (theirs.width, theirs.height) == (ours.width, ours.height) {
        return Ok(());
    }
    Err(Error::Argument {
        what: format!(
            "the model's sensor has {} x {} px, the recording's {} x {}: its errors lie elsewhere",
            theirs.width, theirs.height, ours.width, ours.height
        ),
        remedy: "give the model that was made of this very sensor",
    })
}

/// A view whose frames are another's, bit for bit, is no second witness.
fn without_copies(fields: &mut Vec<Field>) -> Vec<String> {
    let mut told = Vec::new();
    let mut kept: Vec<Field> = Vec::new();
    for field in fields.drain(..) {
        let same = |other: &&Field| {
            other.words.0 == field.words.0
                && other.frames.len() == field.frames.len()
                && other.pixels == field.pixels
                && other.first.first().map(|f| bits(f)) == field.first.first().map(|f| bits(f))
        };
        match kept.iter().find(same) {
            Some(other) => told.push(format!(
                "view {} has the same frames as view {}: it was left out",
                field.name, other.name
            )),
            None => kept.push(field),
        }
    }
    *fields = kept;
    told
}

fn bits(residuals: &[f32]) -> Vec<u32> {
    residuals.iter().map(|r| r.to_bits()).collect()
}

/// Do the views become flat once their words are taken for lengths of rays? Then with them.
fn as_ranges(
    recording: &Recording,
    bench: &Workbench<'_>,
    model: &NoiseModel,
    known: &Known,
    flat: usize,
) -> Option<(Vec<Field>, Vec<Excluded>)> {
    if 2 * flat >= recording.views.len() || known.has("range-not-depth") {
        return None;
    }
    let bench = Workbench { ranges: true, ..Workbench::new(bench.sensor, bench.options) };
    let mut told = known.clone();
    told.bias.push(range_term());
    let (fields, excluded) = read(recording, &bench, model, &told, &|_, _| ());
    (fields.len() >= FEWEST_VIEWS && fields.len() > 2 * flat).then_some((fields, excluded))
}

fn range_term() -> Term {
    Term { statistic: Statistic::Bias, basis: Basis::RangeNotDepth, coefficients: vec![1.0] }
}

/// The finding that goes with [`as_ranges`].
fn ranges() -> Finding {
    let effect = "range-not-depth";
    let (statistic, axis) = (Statistic::Bias, Axis::Radius);
    let mut parameters = Map::new();
    parameters.insert("share".into(), estimate(1.0, 0.01));
    Finding {
        status: Status::Named,
        effect: Some(effect),
        alternatives: vec![super::diagnosis::Alternative { effect, probability: 0.98 }],
        statistic,
        axis,
        interval: [0.0, 0.0],
        unit: axis.unit(),
        share: 1e6,
        parameters,
        size: Size::default(),
        p_adjusted: 1e-9,
        physics: findings::physics(Status::Named, Some(effect), statistic, axis, None),
        next_view: None,
        shape: None,
        curve: None,
        terms: vec![range_term()],
    }
}

/// Variance that comes by other names than sigma: of steps, rows, and pixels.
#[derive(Debug, Clone, Copy)]
pub struct Steps {
    depth_px_m2: f64,
    disparity_px: f64,
    noise_px2: f64,
}

impl Steps {
    pub fn of(
        lattice: &Lattice,
        structure: &[Structure],
        fields: &[Field],
        recording: &Recording,
    ) -> Self {
        let step_px = lattice.disparity_step_px.unwrap_or(0.0);
        // With frames to compare, what stands still is not in the variance.
        let single = fields.iter().all(|f| f.frames.len() < 2);
        let still = if single { fixed_px2(structure) } else { 0.0 };
        Steps {
            depth_px_m2: lattice.depth_step_m.unwrap_or(0.0) * fields[0].scale_px_m,
            // Words of a raw sensor are in the model's variance already.
            disparity_px: if is_raw(recording) { 0.0 } else { step_px },
            noise_px2: mean_of(structure.iter().filter_map(|s| s.row_px2)) + still,
        }
    }

    /// At a place, px^2.
    pub fn at(&self, p: &Place) -> f64 {
        let depth_px = self.depth_px_m2 / (p.z * p.z);
        (depth_px * depth_px + self.disparity_px.powi(2)) / 12.0 + self.noise_px2
    }
}

fn is_raw(recording: &Recording) -> bool {
    matches!(recording.sensor.code, DepthCode::Disparity { .. })
}

fn mean_of(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut n) = (0.0, 0.0);
    for v in values.filter(|v| v.is_finite()) {
        sum += v;
        n += 1.0;
    }
    f64::max(sum / f64::max(n, 1.0), 0.0)
}

/// How much frames of a view resemble one another, by lag, where that was found to be noise.
pub(super) fn common(structure: &[Structure], hangs: &[Hanging], known: &Known) -> [f64; 3] {
    let in_time = ["frozen-noise", "temporal-correlation"];
    let told = hangs.iter().flat_map(|h| &h.families).any(|f| in_time.contains(f))
        || in_time.iter().any(|id| known.has(id));
    if !told {
        return [0.0; 3];
    }
    let at = |lag: usize| mean_of(structure.iter().filter_map(|s| s.lagged[lag]));
    let near = at(0);
    [near, if structure.iter().any(|s| s.lagged[1].is_some()) { at(1) } else { near }, {
        if structure.iter().any(|s| s.lagged[2].is_some()) { at(2) } else { at(1) }
    }]
}

/// Variance of the pixels' constant errors, px^2.
pub(super) fn fixed_px2(structure: &[Structure]) -> f64 {
    mean_of(structure.iter().filter_map(|s| s.fixed_px2))
}

fn typical_sigma_px(fields: &[Field]) -> f64 {
    let mut all: Vec<f32> =
        fields.iter().filter_map(|f| f.sigma.get(f.sigma.len() / 2).copied()).collect();
    f64::from(crate::stats::median_in_place(&mut all))
}

pub(super) fn measure_tails(
    structure: &mut [Structure],
    fields: &[Field],
    bias: &[Vec<f32>],
    variance: &[Term],
    survey: &Survey,
    bench: &Workbench<'_>,
) {
    let factors = pixel_terms(fields, variance, survey, bench);
    let camera = &bench.sensor.camera;
    structure.par_iter_mut().zip(fields).enumerate().for_each(|(n, (s, field))| {
        let whitened = |frame: &Vec<f32>| -> Vec<f32> {
            let whitened: Vec<f32> = (0..frame.len())
                .map(|k| {
                    let factor = factors.get(n).map_or(1.0, |f| (0.5 * f[k]).exp());
                    (frame[k] - bias.get(n).map_or(0.0, |b| b[k])) / (field.sigma[k] * factor)
                })
                .collect();
            high_pass(&field.image(&whitened), field.width, field.height, SMOOTH_PX)
        };
        let frames: Vec<Vec<f32>> = field.first.iter().take(2).map(whitened).collect();
        if !frames.is_empty() {
            (s.tail, s.tail_pixels, s.tail_size) = tail(&moving(&frames, s), camera);
        }
    });
}

pub(super) fn read(
    recording: &Recording,
    bench: &Workbench<'_>,
    model: &NoiseModel,
    known: &Known,
    progress: Progress<'_>,
) -> (Vec<Field>, Vec<Excluded>) {
    let times = recording.views.iter().filter_map(|v| v.depth.first()).map(|f| f.timestamp);
    let start = times.fold(f64::INFINITY, f64::min);
    let done = AtomicUsize::new(0);
    let total = recording.views.len();
    let results: Vec<Result<Field>> = recording
        .views
        .par_iter()
        .map(|v| {
            let field = Field::read(v, bench, &model.sigma, known, start);
            progress(done.fetch_add(1, Ordering::Relaxed) + 1, total);
            field
        })
        .collect();
    let mut excluded = recording.excluded.clone();
    let mut fields = Vec::new();
    for (view, result) in recording.views.iter().zip(results) {
        match result {
            Ok(field) => fields.push(field),
            Err(e) => excluded.push(Excluded::of(&view.name, &e)),
        }
    }
    (fields, excluded)
}

/// The chosen terms with their common coefficients.
pub fn terms_of(outcome: &Outcome, statistic: Statistic) -> Vec<Term> {
    (0..outcome.chosen.len())
        .map(|k| Term {
            statistic,
            basis: outcome.chosen[k].candidate.basis.clone(),
            coefficients: outcome.coefficients(k),
        })
        .collect()
}

fn typical_sigma_mm(fields: &[Field]) -> f64 {
    let of = |f: &Field| {
        let z = f.plane.depth(0.0, 0.0);
        let px = f64::from(*f.sigma.get(f.sigma.len() / 2).unwrap_or(&0.0));
        1e3 * px * z * z / f.scale_px_m
    };
    let mut all: Vec<f32> = fields.iter().map(|f| of(f) as f32).collect();
    f64::from(crate::stats::median_in_place(&mut all))
}

/// The terms at every pixel; empty when there are none.
fn pixel_terms(
    fields: &[Field],
    terms: &[Term],
    survey: &Survey,
    bench: &Workbench<'_>,
) -> Vec<Vec<f32>> {
    if terms.is_empty() {
        return Vec::new();
    }
    let start = fields.iter().map(|f| f.time_s).fold(f64::INFINITY, f64::min);
    fields
        .par_iter()
        .map(|f| {
            let places = Places::of(f, &bench.sensor.camera, &bench.rays, start);
            let mut row = Vec::new();
            (0..f.pixels.len())
                .map(|k| {
                    let mut place = places.pixel(k);
                    place.light = survey.light.of(f, k, &place);
                    terms.iter().map(|t| t.value(&place, &mut row)).sum::<f64>() as f32
                })
                .collect()
        })
        .collect()
}

pub(super) fn lattice(fields: &[Field], recording: &Recording) -> Lattice {
    let mut words = Words::none();
    fields.iter().for_each(|f| words.merge(&f.words));
    words.lattice(&recording.sensor, fields[0].scale_px_m)
}

/// What is smaller than this, in sigmas, is told of by nobody: models are not better than that.
fn least_size(statistic: Statistic) -> f64 {
    if statistic == Statistic::Bias { 0.01 } else { 0.035 }
}

/// A step is worth telling when the error it makes is this share of the noise.
const STEP_SHARE: f64 = 0.1;

fn steps(
    lattice: &Lattice,
    known: &Known,
    fields: &[Field],
    recording: &Recording,
    sigma_mm: f64,
) -> Vec<Finding> {
    let mut found = Vec::new();
    let mut add = |effect, axis, unit, interval, name: &str, step: f64, error, size: Size| {
        let mut parameters = Map::new();
        parameters.insert(name.into(), estimate(step, error));
        found.push(Finding {
            status: Status::Named,
            effect: Some(effect),
            alternatives: vec![super::diagnosis::Alternative { effect, probability: 0.98 }],
            statistic: Statistic::Distribution,
            axis,
            interval,
            unit,
            share: 10.0 + 100.0 * size.sigma * size.sigma,
            parameters,
            size,
            p_adjusted: 1e-6,
            physics: findings::physics(
                Status::Named,
                Some(effect),
                Statistic::Distribution,
                axis,
                None,
            ),
            next_view: None,
            shape: None,
            curve: None,
            terms: Vec::new(),
        });
    };
    let z = crate::stats::range(fields.iter().map(|f| f.plane.depth(0.0, 0.0)));
    let mut sigma_px: Vec<f32> = fields.iter().filter_map(|f| f.sigma.first().copied()).collect();
    let sigma_px = f64::from(crate::stats::median_in_place(&mut sigma_px));
    if let Some(step) = lattice.disparity_step_px
        && !known.has("disparity-quantisation")
    {
        let sigma = step / 12f64.sqrt() / sigma_px;
        if sigma > STEP_SHARE {
            let size = Size { mm: sigma * sigma_mm, sigma };
            let raw = matches!(recording.sensor.code, DepthCode::Disparity { .. });
            let error = if raw { 0.0 } else { 0.002 * step };
            let axis = Axis::DisparityPhase;
            add(
                "disparity-quantisation",
                axis,
                axis.unit(),
                [0.0, 1.0],
                "step_px",
                step,
                error,
                size,
            );
        }
    }
    if let Some(step) = lattice.depth_step_m
        && !known.has("depth-rounding")
    {
        let mm = 1e3 * step / 12f64.sqrt();
        let size = Size { mm, sigma: mm / sigma_mm };
        if size.sigma > STEP_SHARE {
            add("depth-rounding", Axis::Z, "m", z, "step_m", step, 0.0, size);
        }
    }
    found
}

fn not_identifiable(what: &CannotTell) -> Finding {
    let (statistic, axis) = (Statistic::Bias, Axis::Z);
    Finding {
        status: Status::NotIdentifiable,
        effect: Some(what.effect),
        alternatives: Vec::new(),
        statistic,
        axis,
        interval: [0.0, 0.0],
        unit: axis.unit(),
        share: 0.0,
        parameters: Map::new(),
        size: Size::default(),
        p_adjusted: 1.0,
        physics: what.why.clone(),
        next_view: None,
        shape: None,
        curve: None,
        terms: Vec::new(),
    }
}

/// A name is told once, by its strongest finding.
fn merge(found: &mut Vec<Finding>) {
    found.sort_by(|a, b| b.share.total_cmp(&a.share));
    let mut names: Vec<&'static str> = Vec::new();
    found.retain(|f| match f.effect {
        Some(id) if f.status != Status::NotIdentifiable => {
            let new = !names.contains(&id);
            if new {
                names.push(id);
            }
            new
        }
        _ => true,
    });
}

/// Nats become shares, and the largest comes first.
fn shares(found: &mut [Finding]) {
    let total: f64 = found.iter().map(|f| f.share.max(0.0)).sum();
    for f in found.iter_mut() {
        f.share = if total > 0.0 { f.share.max(0.0) / total } else { 0.0 };
    }
    found.sort_by(|a, b| {
        let told = |f: &Finding| f.status == Status::NotIdentifiable;
        told(a).cmp(&told(b)).then(b.share.total_cmp(&a.share))
    });
}

/// Does anything stand out once all terms are in?
fn after(bias: &Outcome, variance: &Outcome) -> After {
    let mut remaining = Vec::new();
    for (statistic, outcome) in [(Statistic::Bias, bias), (Statistic::Variance, variance)] {
        if let Some(left) = &outcome.remaining {
            let axis = left.candidate.basis.axis();
            let name = left.candidate.family.unwrap_or("a curve without a name");
            remaining.push(Remaining {
                statistic,
                axis,
                p_adjusted: left.p,
                words: format!("{name} would still bring {:.0} nats", left.gain),
            });
        }
    }
    let verdict = if remaining.is_empty() { Verdict::Match } else { Verdict::Mismatch };
    After { verdict, remaining }
}

/// The model with what was found.
fn extend(model: &NoiseModel, found: &[Finding], sensor: &crate::view::Sensor) -> NoiseModel {
    let mut extended = model.clone();
    if extended.sensor.is_none() {
        extended.sensor = Some(crate::view::RecordingFile::of(sensor));
    }
    for f in found {
        let keeps = matches!(f.status, Status::Named | Status::OneOf) || !f.terms.is_empty();
        if !keeps {
            continue;
        }
        let id = match (f.status, f.effect) {
            (Status::Recalibrate, _) | (_, None) => UNEXPLAINED,
            (_, Some(id)) => id,
        };
        let mut parameters = f.parameters.clone();
        if let Some(card) = effects::find(id).filter(|_| f.terms.is_empty()).map(|e| e.card()) {
            // The simulator takes the catalogue's parameters alone.
            parameters.retain(|name, _| card.parameters.iter().any(|p| p.name == name));
        }
        extended.effects.push(Effect { id: id.into(), parameters, shape: f.terms.clone() });
    }
    extended
}

fn view_lines(
    fields: &[Field],
    survey: &Survey,
    bias: &[Term],
    heldout: Option<&super::diagnosis::HeldOut>,
) -> Vec<ViewLine> {
    let before = heldout::rms_by_view(survey, &[]);
    let after = heldout::rms_by_view(survey, bias);
    fields
        .iter()
        .enumerate()
        .map(|(n, f)| ViewLine {
            name: f.name.clone(),
            z_m: f.plane.depth(0.0, 0.0),
            theta_rad: f.plane.theta(),
            azimuth_rad: f.plane.azimuth(),
            frames: f.frames.len(),
            pixels: f.pixels.len(),
            bowl_px_before: before[n],
            bowl_px_after: after[n],
            held_out: heldout.is_some_and(|h| h.views.contains(&f.name)),
        })
        .collect()
}
