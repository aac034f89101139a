//! All that the tool finds in a real recording: of a real sensor nobody knows more.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use serde_json::{Map, json};

use super::MIN_VIEWS;
use crate::raytraced::Unit;
use crate::raytraced::eye::World;
use crate::raytraced::geometry::{Board, Stage};
use crate::raytraced::poses::Plan;
use crate::raytraced::question::Hidden;
use kinoise::calibrate::{CalibrateOptions, measure, model_of};
use kinoise::diagnose::{DiagnoseOptions, Finding, Status, Verdict, diagnose};
use kinoise::effects::KINECT_BASELINE_M;
use kinoise::error::{Error, Result};
use kinoise::frame::{DepthCode, KINECT_NO_MEASUREMENT};
use kinoise::io::{Assumed, open};
use kinoise::model::{Form, NoiseModel, Provenance};
use kinoise::plane::Plane;
use kinoise::rng::Seed;
use kinoise::terms::Statistic;
use kinoise::view::Recording;

/// What is learnt of a recording does not depend on the set it is learnt for.
const SEED: Seed = Seed(1);
/// What was hidden behind the first findings is found in the next round.
const MAX_ROUNDS: usize = 3;

/// A recording with a model that it does not contradict.
pub struct Full {
    /// With the views that the diagnosis could use.
    pub recording: Recording,
    pub model: NoiseModel,
    /// One for each of the model's effects.
    pub terms: Vec<Hidden>,
    /// What each view shows.
    pub seen: Vec<Seen>,
    unit: Unit,
}

/// The target in a view.
pub struct Seen {
    plane: Plane,
    /// Ascending.
    pub pixels: Vec<u32>,
    /// What the full model expects there: standard deviation of the disparity, px.
    pub sigma_px: Vec<f32>,
}

/// The full model of the recording at `path`; worked out once in a process, and what cannot be used
/// is not tried again.
pub fn full(path: &Path) -> Result<Arc<Full>, String> {
    type Known = Mutex<HashMap<PathBuf, Result<Arc<Full>, String>>>;
    static KNOWN: OnceLock<Known> = OnceLock::new();
    let key = path.canonicalize().map_err(|e| Error::read(path, e).to_string())?;
    // Held while one is worked out: nobody does it twice.
    let known = KNOWN.get_or_init(Known::default);
    let mut known = known.lock().unwrap_or_else(PoisonError::into_inner);
    let learnt = || learn(read(path)?);
    known
        .entry(key)
        .or_insert_with(|| learnt().map(Arc::new).map_err(|e: Error| e.to_string()))
        .clone()
}

/// The bare pictures that carry no description of their own: a second Kinect v1, whose disparities
/// somebody converted with these numbers; the rooms among them are called test*.
pub const UNDESCRIBED: &str = "kinect-v1-second-unit";

fn read(path: &Path) -> Result<Recording> {
    if !path.ends_with(UNDESCRIBED) {
        return open(path, &Assumed::default());
    }
    let invalid = KINECT_NO_MEASUREMENT;
    let assumed = Assumed {
        intrinsics: Some([585.0, 585.0, 319.5, 239.5]),
        code: Some(DepthCode::Disparity { offset: 3.3309, slope: -0.003_071_1, invalid }),
        baseline_m: Some(KINECT_BASELINE_M),
    };
    let mut recording = open(path, &assumed)?;
    recording.views.retain(|v| !v.name.starts_with("test"));
    Ok(recording)
}

fn learn(mut recording: Recording) -> Result<Full> {
    let Explained { model, mut terms, mut seen, left } = explain(&recording)?;
    recording.views.retain(|v| seen.contains_key(&v.name));
    let views = recording.views.len();
    if !left.is_empty() || views < MIN_VIEWS {
        let left = left.join(", ");
        return Err(Error::recording(
            &recording.root,
            format!(
                "{views} views of a plane; after {MAX_ROUNDS} rounds still unexplained: {left}"
            ),
            "leave it out of the trial; a recording needs six views at least, better are thirty",
        ));
    }
    let seen: Vec<Seen> = recording.views.iter().filter_map(|v| seen.remove(&v.name)).collect();
    let mut sigma = [0.0; 6];
    sigma.iter_mut().zip(&model.sigma.parameters).for_each(|(s, p)| *s = *p);
    let sensor = recording.sensor.clone();
    let baseline_m = sensor.baseline_m.unwrap_or(KINECT_BASELINE_M);
    let unit = Unit { sensor, baseline_m, sigma };
    let mut full = Full { recording, model, terms: Vec::new(), seen, unit };
    let measured = full.measured(&(0..full.seen.len()).collect::<Vec<_>>());
    for term in &mut terms {
        let size = measured / area(&full.model, &term.statistic);
        term.nats = term.nats.map(|each| each * size);
    }
    full.terms = terms;
    Ok(full)
}

impl Full {
    /// Measurements of the target in these views.
    pub fn measured(&self, views: &[usize]) -> f64 {
        let of = |&k: &usize| self.seen[k].pixels.len() * self.recording.views[k].depth.len();
        views.iter().map(of).sum::<usize>() as f64
    }

    /// The unit in front of a wall without end.
    pub fn world(&self) -> World<'_> {
        World { unit: &self.unit, causes: &[], printed: false, edged: false }
    }

    /// The `k`th view, as the raytraced causes see it.
    pub fn plan(&self, k: usize) -> Plan {
        let stamps = |k: usize| {
            self.recording.views[k].depth.iter().map(|f| f.timestamp).collect::<Vec<_>>()
        };
        let begin = (0..self.seen.len()).flat_map(stamps).fold(f64::INFINITY, f64::min);
        let (plane, stamps) = (self.seen[k].plane, stamps(k));
        let (theta, azimuth) = (plane.theta(), plane.azimuth());
        let board = Board::posed(plane.depth(0.0, 0.0), [theta, azimuth], [0.0; 2], 0.0);
        Plan {
            view: k,
            stage: Stage { board, wall: None, theta, azimuth },
            session_s: stamps.first().map_or(0.0, |first| first - begin),
            stamps,
            lux: 0.0,
            temperature_c: 22.0,
            notes: self.recording.views[k].notes.clone(),
        }
    }
}

/// A model, what was found to extend it, and what is still left to be found.
pub struct Explained {
    pub model: NoiseModel,
    terms: Vec<Hidden>,
    /// By the view's name.
    seen: HashMap<String, Seen>,
    left: Vec<String>,
}

/// What calibration makes of these views, and diagnosis as often as it finds something, in
/// [`MAX_ROUNDS`] at most. On threads of its own: a thread that waits for its share of parallel work
/// takes up other work meanwhile, and must not come to wait for what it is working out itself.
pub fn explain(recording: &Recording) -> Result<Explained> {
    let failed = |what: String| Error::Solver { what, remedy: "use fewer threads, or report this" };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(rayon::current_num_threads())
        .build()
        .map_err(|e| failed(format!("no threads for a real recording: {e}")))?;
    std::thread::scope(|scope| scope.spawn(|| pool.install(|| in_rounds(recording))).join())
        .unwrap_or_else(|_| Err(failed("a real recording could not be diagnosed".into())))
}

fn in_rounds(recording: &Recording) -> Result<Explained> {
    let mut options = CalibrateOptions { form: Some(Form::Paper), ..Default::default() };
    options.measure.seed = SEED;
    let views = measure(recording, &options.measure, &|_, _| ())?;
    let mut model = model_of(recording, &views, &options)?.model;
    let mut terms = Vec::new();
    let mut round = 0;
    let (fields, left) = loop {
        let options = DiagnoseOptions { seed: SEED, ..DiagnoseOptions::default() };
        let done = diagnose(recording, &model, &options, &|_, _| ())?;
        let findings = &done.diagnosis.findings;
        if done.diagnosis.verdict != Verdict::Mismatch {
            break (done.fields, Vec::new());
        }
        if round == MAX_ROUNDS {
            let left = findings.iter().filter(|f| f.status != Status::NotIdentifiable);
            break (done.fields, left.map(|f| f.effect.unwrap_or(f.axis.id()).into()).collect());
        }
        terms.extend(findings.iter().filter(|f| extends(f)).map(hidden));
        model = done.model;
        round += 1;
    };
    // The same bytes every time, and no word of where they come from.
    let created = "1970-01-01T00:00:00Z".into();
    model.provenance = Provenance { created, sha256: Map::new(), ..model.provenance };
    let seen = fields
        .into_iter()
        .map(|f| (f.name, Seen { plane: f.plane, pixels: f.pixels, sigma_px: f.sigma }));
    Ok(Explained { model, terms, seen: seen.collect(), left })
}

/// Does the extended model hold an entry for it?
fn extends(f: &Finding) -> bool {
    matches!(f.status, Status::Named | Status::OneOf) || !f.terms.is_empty()
}

/// A finding as the truth of a set: its nats are those of one measurement, for a mean that is off by
/// s sigma and for a sigma that is off by s of itself.
fn hidden(f: &Finding) -> Hidden {
    let mut names: Vec<&str> = Vec::new();
    if !matches!(f.status, Status::Recalibrate | Status::Unexplained) {
        names.extend(f.effect);
        names.extend(f.alternatives.iter().filter(|a| a.probability > 0.1).map(|a| a.effect));
        names.dedup();
    }
    let form = match f.status {
        Status::Recalibrate => "recalibrate",
        _ => f.effect.unwrap_or("unexplained"),
    };
    let statistic = json!(f.statistic);
    let statistic = statistic.as_str().unwrap_or_default();
    let mut hidden = Hidden::new(&names, form, [statistic, f.axis.id()]);
    // A pattern of the picture shows on all the picture's axes.
    let also: &[&str] = match (f.statistic, f.axis.id()) {
        (Statistic::Bias, "pixel") => &["radius", "column", "row"],
        (Statistic::Bias, "radius") => &["pixel"],
        _ => &[],
    };
    hidden.also = also.iter().map(ToString::to_string).collect();
    hidden.interval = Some(f.interval);
    hidden.parameters = f.parameters.clone();
    hidden.nats = match f.statistic {
        Statistic::Bias => Some(0.5 * f.size.sigma.powi(2)),
        Statistic::Variance => Some(f.size.sigma.powi(2)),
        _ => None,
    };
    hidden
}

/// Pixels that count as one, for a mean or a variance: a flat window of `length_px` squared has that
/// sum of its correlation, and two thirds of the length each way that of its square.
pub fn area(model: &NoiseModel, statistic: &str) -> f64 {
    let entry = model.effects.iter().find(|e| e.id == "spatial-correlation");
    let value = entry.and_then(|e| e.parameters.get("length_px"));
    let side = value.and_then(|v| v.get("value").unwrap_or(v).as_f64()).unwrap_or(1.0);
    let side = if statistic == "variance" { side * 2.0 / 3.0 } else { side };
    side.max(1.0).powi(2)
}
