//! Everything the tool finds in a real recording; nobody knows more of a real sensor.

use std::path::Path;

use serde_json::{Map, json};

use super::MIN_VIEWS;
use crate::raytraced::question::Hidden;
use kinoise::calibrate::paper_model;
use kinoise::diagnose::{DiagnoseOptions, Field, Finding, Status, Verdict, diagnose};
use kinoise::error::{Error, Result};
use kinoise::io::{Assumed, open};
use kinoise::model::{NoiseModel, Provenance};
use kinoise::rng::Seed;
use kinoise::terms::Statistic;
use kinoise::view::{Recording, View};

/// Fixed: what is learnt of a recording does not depend on the set it is learnt for.
const SEED: Seed = Seed(1);
/// Maximum number of rounds: what the first findings masked is found in the next round.
const MAX_ROUNDS: usize = 3;

/// A recording with a model that it does not contradict.
pub struct Full {
    /// Only the views that the diagnosis could use.
    pub recording: Recording,
    pub model: NoiseModel,
    /// One for each of the model's effects, in their order.
    pub terms: Vec<Hidden>,
    /// Number of measurements of the target in each view.
    measured: Vec<f64>,
}

impl Full {
    pub fn learn(path: &Path) -> Result<Self> {
        let mut recording = open(path, &Assumed::default())?;
        let Explained { model, mut terms, fields, left } = explain(&recording)?;
        let field = |v: &View| fields.iter().find(|f| f.name == v.name);
        recording.views.retain(|v| field(v).is_some());
        let views = recording.views.len();
        if !left.is_empty() || views < MIN_VIEWS {
            let left = left.join(", ");
            return Err(Error::recording(
                path,
                format!(
                    "{views} views of a plane; after {MAX_ROUNDS} rounds still unexplained: {left}"
                ),
                "leave it out of the trial; a recording needs six views at least, better are thirty",
            ));
        }
        let of = |v: &View| field(v).map_or(0, |f| f.pixels.len() * v.depth.len()) as f64;
        let measured: Vec<f64> = recording.views.iter().map(of).collect();
        for term in &mut terms {
            let size = measured.iter().sum::<f64>() / area(&model, &term.statistic);
            term.nats = term.nats.map(|each| each * size);
        }
        Ok(Full { recording, model, terms, measured })
    }

    /// Share of all measurements that lie in these views.
    pub fn share(&self, views: &[usize]) -> f64 {
        views.iter().map(|&k| self.measured[k]).sum::<f64>() / self.measured.iter().sum::<f64>()
    }
}

/// A model, what was found to extend it, and what is still unexplained.
pub struct Explained {
    pub model: NoiseModel,
    terms: Vec<Hidden>,
    fields: Vec<Field>,
    left: Vec<String>,
}

/// Calibrates on these views, then diagnoses and extends the model as long as something is found, at most
/// [`MAX_ROUNDS`] times.
pub fn explain(recording: &Recording) -> Result<Explained> {
    let mut model = paper_model(recording, SEED, None, &|_, _| ())?;
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
    // The same bytes every time, and no hint of where they come from.
    let created = "1970-01-01T00:00:00Z".into();
    model.provenance = Provenance { created, sha256: Map::new(), ..model.provenance };
    Ok(Explained { model, terms, fields, left })
}

/// Whether the extended model holds an entry for it.
fn extends(f: &Finding) -> bool {
    let keeps = matches!(f.status, Status::Named | Status::OneOf) || !f.terms.is_empty();
    keeps && f.of_some.is_none()
}

/// A finding as the truth of a set. Its nats are those of one measurement: for a mean off by s sigma, or for
/// a sigma off by the fraction s of itself.
fn hidden(f: &Finding) -> Hidden {
    let mut names: Vec<&str> = Vec::new();
    if !matches!(f.status, Status::Recalibrate | Status::Unexplained) {
        names.extend(f.effect);
        names.extend(
            f.alternatives
                .iter()
                .filter(|a| a.probability.is_none_or(|p| p > 0.1))
                .map(|a| a.effect),
        );
        names.dedup();
    }
    let form = match f.status {
        Status::Recalibrate => "recalibrate",
        _ => f.effect.unwrap_or("unexplained"),
    };
    let statistic = json!(f.statistic);
    let mut hidden =
        Hidden::new(&names, form, [statistic.as_str().unwrap_or_default(), f.axis.id()]);
    // A pattern over the image shows on all of the image's axes.
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

/// Number of pixels that count as one, for a mean or a variance. A flat window of `length_px` squared has
/// this area as the sum of its correlation; for the sum of its squared correlation, two thirds of the
/// length each way.
fn area(model: &NoiseModel, statistic: &str) -> f64 {
    let entry = model.effects.iter().find(|e| e.id == "spatial-correlation");
    let value = entry.and_then(|e| e.parameters.get("length_px"));
    let side = value.and_then(|v| v.get("value").unwrap_or(v).as_f64()).unwrap_or(1.0);
    let side = if statistic == "variance" { side * 2.0 / 3.0 } else { side };
    side.max(1.0).powi(2)
}
