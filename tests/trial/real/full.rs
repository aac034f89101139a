//! All that the tool finds in a real recording: of a real sensor nobody knows more.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use serde_json::{Map, Value, json};

use super::MIN_VIEWS;
use super::sources::Source;
use kinoise::calibrate::{CalibrateOptions, measure, model_of};
use kinoise::diagnose::{DiagnoseOptions, Diagnosed, Finding, Status, Verdict, diagnose};
use kinoise::error::{Error, Result};
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
pub(super) struct Full {
    /// With the views that the diagnosis could use.
    pub recording: Recording,
    pub model: NoiseModel,
    /// One for each of the model's effects.
    pub terms: Vec<Found>,
    /// What each view shows.
    pub seen: Vec<Seen>,
}

/// The target in a view.
pub(super) struct Seen {
    pub plane: Plane,
    /// Ascending.
    pub pixels: Vec<u32>,
}

/// A term, as it was found.
#[derive(Debug, Clone)]
pub(super) struct Found {
    pub names: Vec<String>,
    pub form: String,
    pub statistic: String,
    pub axis: String,
    pub interval: [f64; 2],
    pub parameters: Map<String, Value>,
    /// Of the whole recording; `None` where it is neither bias nor variance.
    pub nats: Option<f64>,
}

/// What cannot be used says why, and is not tried again.
type Shelf = Mutex<HashMap<PathBuf, Result<Arc<Full>, String>>>;

/// The full model of `source`; worked out once in a process.
///
/// # Errors
/// In words, when it cannot be read, is no recording of a plane, or goes on contradicting its model.
pub(super) fn full(source: &Source) -> Result<Arc<Full>, String> {
    static SHELF: OnceLock<Shelf> = OnceLock::new();
    let path = &source.path;
    let key = path.canonicalize().map_err(|e| Error::read(path, e).to_string())?;
    let shelf = SHELF.get_or_init(Shelf::default);
    // Held while one is worked out: nobody does it twice.
    let mut shelf = shelf.lock().unwrap_or_else(PoisonError::into_inner);
    let learnt = || apart(|| learn(source.open()?)).map(Arc::new).map_err(|e| e.to_string());
    shelf.entry(key).or_insert_with(learnt).clone()
}

/// On threads of its own: a thread that waits for its share of parallel work takes up other work
/// meanwhile, and must not come here again while it holds the shelf.
fn apart<T: Send>(work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
    let failed =
        |what: String| Error::Solver { what, remedy: "use fewer threads, or report this as a bug" };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(rayon::current_num_threads())
        .build()
        .map_err(|e| failed(format!("no threads for a real recording: {e}")))?;
    std::thread::scope(|scope| scope.spawn(|| pool.install(work)).join())
        .unwrap_or_else(|_| Err(failed("a real recording could not be diagnosed".into())))
}

fn learn(mut recording: Recording) -> Result<Full> {
    let mut model = calibrated(&recording)?;
    let (mut terms, mut fields) = (Vec::new(), Vec::new());
    for round in 0..=MAX_ROUNDS {
        let done = examine(&recording, &model)?;
        if round == 0 {
            fields = done.fields;
        }
        if done.diagnosis.verdict != Verdict::Mismatch {
            break;
        }
        if round == MAX_ROUNDS {
            let left: Vec<&str> = done
                .diagnosis
                .findings
                .iter()
                .filter(|f| f.status != Status::NotIdentifiable)
                .map(|f| f.effect.unwrap_or(f.axis.id()))
                .collect();
            return Err(Error::recording(
                &recording.root,
                format!(
                    "after {MAX_ROUNDS} rounds something is still left to be found: {}",
                    left.join(", ")
                ),
                "leave it out of the trial",
            ));
        }
        terms.extend(done.diagnosis.findings.iter().filter(|f| is_kept(f)).map(Found::of));
        model = done.model;
    }
    let mut seen: HashMap<String, Seen> =
        fields.into_iter().map(|f| (f.name, Seen { plane: f.plane, pixels: f.pixels })).collect();
    recording.views.retain(|v| seen.contains_key(&v.name));
    if recording.views.len() < MIN_VIEWS {
        return Err(Error::recording(
            &recording.root,
            format!("{} views of a plane", recording.views.len()),
            "real sets need six at least; better are thirty",
        ));
    }
    let seen: Vec<Seen> = recording.views.iter().filter_map(|v| seen.remove(&v.name)).collect();
    anonymous(&mut model);
    let mut full = Full { recording, model, terms, seen };
    let measured = full.measured(&(0..full.seen.len()).collect::<Vec<_>>());
    for term in &mut full.terms {
        let size = measured / area(&full.model, &term.statistic);
        term.nats = term.nats.map(|each| each * size);
    }
    Ok(full)
}

impl Full {
    /// Measurements of the target in these views.
    pub fn measured(&self, views: &[usize]) -> f64 {
        let of = |&k: &usize| self.seen[k].pixels.len() * self.recording.views[k].depth.len();
        views.iter().map(of).sum::<usize>() as f64
    }
}

/// What calibration makes of these views, and diagnosis as often as with the whole recording.
///
/// # Errors
/// When too few of them can be used.
pub(super) fn learnt(recording: &Recording) -> Result<NoiseModel> {
    apart(|| {
        let mut model = calibrated(recording)?;
        for _ in 0..MAX_ROUNDS {
            let done = examine(recording, &model)?;
            if done.diagnosis.verdict != Verdict::Mismatch {
                break;
            }
            model = done.model;
        }
        anonymous(&mut model);
        Ok(model)
    })
}

fn calibrated(recording: &Recording) -> Result<NoiseModel> {
    let mut options = CalibrateOptions { form: Some(Form::Paper), ..Default::default() };
    options.measure.seed = SEED;
    let views = measure(recording, &options.measure, &|_, _| ())?;
    Ok(model_of(recording, &views, &options)?.model)
}

fn examine(recording: &Recording, model: &NoiseModel) -> Result<Diagnosed> {
    let options = DiagnoseOptions { seed: SEED, ..DiagnoseOptions::default() };
    diagnose(recording, model, &options, &|_, _| ())
}

/// Does the extended model hold an entry for it?
fn is_kept(f: &Finding) -> bool {
    matches!(f.status, Status::Named | Status::OneOf) || !f.terms.is_empty()
}

/// The same bytes every time, and no word of where they come from.
fn anonymous(model: &mut NoiseModel) {
    let created = "1970-01-01T00:00:00Z".into();
    model.provenance = Provenance { created, sha256: Map::new(), ..model.provenance.clone() };
}

/// Pixels that count as one, for a mean or a variance: a flat window of `length_px` squared has that
/// sum of its correlation, and two thirds of the length each way that of its square.
pub(super) fn area(model: &NoiseModel, statistic: &str) -> f64 {
    let entry = model.effects.iter().find(|e| e.id == "spatial-correlation");
    let value = entry.and_then(|e| e.parameters.get("length_px"));
    let side = value.and_then(|v| v.get("value").unwrap_or(v).as_f64()).unwrap_or(1.0);
    let side = if statistic == "variance" { side * 2.0 / 3.0 } else { side };
    side.max(1.0).powi(2)
}

impl Found {
    fn of(f: &Finding) -> Self {
        let mut names: Vec<String> = Vec::new();
        if f.status != Status::Recalibrate {
            names.extend(f.effect.map(String::from));
            let others = f.alternatives.iter().filter(|a| a.probability > 0.1);
            names.extend(others.map(|a| a.effect.to_string()));
            names.dedup();
        }
        let form = match f.status {
            Status::Recalibrate => "recalibrate".to_string(),
            _ => f.effect.map_or("unexplained", |id| id).to_string(),
        };
        // Gain of a mean that is off by s sigma, and of a sigma that is off by s of itself.
        let s2 = f.size.sigma.powi(2);
        let nats = match f.statistic {
            Statistic::Bias => Some(0.5 * s2),
            Statistic::Variance => Some(s2),
            _ => None,
        };
        let text = |v: Value| v.as_str().unwrap_or_default().to_string();
        Found {
            names: if f.status == Status::Unexplained { Vec::new() } else { names },
            form,
            statistic: text(json!(f.statistic)),
            axis: f.axis.id().to_string(),
            interval: f.interval,
            parameters: f.parameters.clone(),
            nats,
        }
    }
}
