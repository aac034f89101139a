//! The diagnosis from end to end: locate, name, model, show.

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use serde_json::Map;

use super::diagnosis::{
    After, CannotTell, DIAGNOSIS_FORMAT, Diagnosis, Finding, Reference, Remaining, Size, Status,
    Verdict, ViewLine,
};
use super::field::Field;
use super::findings::{self, Scene};
use super::heldout;
use super::known::Known;
use super::lattice::{Lattice, Words};
use super::layers::Survey;
use super::noise::hanging;
use super::parameters::estimate;
use super::reference;
use super::search::Outcome;
use super::structure::structures;
use super::tiles::Places;
use crate::error::{Error, Result};
use crate::frame::DepthCode;
use crate::measure::{MeasureOptions, Workbench};
use crate::model::{Effect, NoiseModel, UNEXPLAINED};
use crate::rng::Seed;
use crate::terms::{Axis, Basis, Statistic, Term, corner_radius};
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
    pub excluded: Vec<Excluded>,
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
    let sensor = &recording.sensor;
    let camera = &sensor.camera;
    let bench = Workbench::new(
        sensor,
        MeasureOptions { seed: options.seed, ..MeasureOptions::default() },
    );
    let known = Known::of(model, camera);
    let (fields, excluded) = read(recording, &bench, model, &known, progress);
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
    let survey = Survey::of(&fields, camera, &bench.rays);
    let scale_px_m = fields[0].scale_px_m;
    let corner = corner_radius(camera);
    // One error rate for everything: half to the mean, a quarter to the variance, the rest shared.
    let level = options.level;
    let bias = survey.search_bias(camera, 0.4 * level, options.seed);
    let bias_terms = terms_of(&bias, Statistic::Bias);
    let variance =
        survey.search_variance(&bias_terms, &model.sigma, camera, 0.25 * level, options.seed);
    let bias_scene = Scene::bias(&survey, scale_px_m, corner);
    let variance_scene = Scene::variance(&survey, &bias_terms, scale_px_m, corner);
    let mut found = findings::findings(&bias_scene, &bias);
    found.extend(findings::findings(&variance_scene, &variance));
    let sigma_mm = typical_sigma_mm(&fields);
    let fine = fine_bias(&fields, &bias_terms, &bench);
    let structure = structures(&fields, camera, &fine);
    let lattice = lattice(&fields, recording);
    found.extend(
        hanging(&structure, &known, 0.03 * level)
            .into_iter()
            .map(|h| findings::hanging(h, sigma_mm)),
    );
    found.extend(steps(&lattice, &known, &fields, recording, sigma_mm));
    let references = reference::laws(&fields);
    found.extend(reference::findings(&references, &known, 0.1 * level, options.seed));
    let mismatch = found.iter().any(|f| f.status != Status::NotIdentifiable);
    let cannot_tell = reference::cannot_tell(&fields);
    found.extend(cannot_tell.iter().map(not_identifiable));
    shares(&mut found);
    let heldout = heldout::score(&survey, model, camera, scale_px_m, options);
    let mut map = findings::map(&bias_scene, &bias, level);
    map.extend(findings::map(&variance_scene, &variance, level));
    let after = after(&bias, &variance);
    let verdict = if mismatch { Verdict::Mismatch } else { Verdict::Match };
    let extended = extend(model, &found, sensor);
    let views = view_lines(&fields, &survey, &bias_terms, heldout.as_ref());
    let detectable = super::detectable::detectable(&survey, &bias, &variance, camera);
    let mut remarks = recording.remarks.clone();
    remarks.extend(excluded.iter().map(ToString::to_string));
    let diagnosis = Diagnosis {
        format: DIAGNOSIS_FORMAT,
        recording: recording.root.display().to_string(),
        reference: Reference::Model,
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
    Ok(Diagnosed { diagnosis, model: extended, fields, bias: bias_terms, excluded })
}

fn read(
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

/// What was found of the mean at every pixel, where it changes within a few of them: errors that
/// stand still are no noise.
fn fine_bias(fields: &[Field], bias: &[Term], bench: &Workbench<'_>) -> Vec<Vec<f32>> {
    let shows = |t: &&Term| {
        t.basis.is_fine() || t.basis.of_column_alone() || matches!(t.basis.axis(), Axis::Row)
    };
    let fine: Vec<&Term> = bias.iter().filter(shows).collect();
    if fine.is_empty() {
        return Vec::new();
    }
    fields
        .par_iter()
        .map(|f| {
            let places = Places::of(f, &bench.sensor.camera, &bench.rays, f.time_s);
            let mut row = Vec::new();
            (0..f.pixels.len())
                .map(|k| {
                    let place = places.pixel(k);
                    fine.iter().map(|t| t.value(&place, &mut row)).sum::<f64>() as f32
                })
                .collect()
        })
        .collect()
}

fn lattice(fields: &[Field], recording: &Recording) -> Lattice {
    let mut words = Words::none();
    fields.iter().for_each(|f| words.merge(&f.words));
    words.lattice(&recording.sensor, fields[0].scale_px_m)
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
        add("depth-rounding", Axis::Z, "m", z, "step_m", step, 0.0, size);
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
        let keeps = matches!(f.status, Status::Named | Status::OneOf)
            || !f.terms.is_empty();
        if !keeps {
            continue;
        }
        let id = match (f.status, f.effect) {
            (Status::Recalibrate, _) | (_, None) => UNEXPLAINED,
            (_, Some(id)) => id,
        };
        extended.effects.push(Effect {
            id: id.into(),
            parameters: f.parameters.clone(),
            shape: f.terms.clone(),
        });
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

/// Is it a shape that only this recording's board has?
pub fn is_world(term: &Term) -> bool {
    matches!(term.basis, Basis::Bow { .. })
}

/// For messages: the recording's name.
pub fn title(path: &Path) -> String {
    path.file_name().map_or_else(|| path.display().to_string(), |n| n.to_string_lossy().into())
}
