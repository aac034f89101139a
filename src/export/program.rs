//! What exported programs need of a model: one list of terms, written once for each language.

use super::expressions::{Expressions, number, sigma};
use crate::correct::Correction;
use crate::error::Result;
use crate::model::NoiseModel;
use crate::terms::{LearntTerm, Term};
use crate::view::Sensor;

/// A term of the program: its expression, and when it applies.
pub(super) struct Line {
    pub expression: String,
    /// Disparity range to which the place is clamped, px.
    pub held: Option<[f64; 2]>,
    pub asks_temperature: bool,
}

/// The expressions of a model.
pub(super) struct Program {
    pub sigma: String,
    pub still: Vec<Line>,
    pub bias: Vec<Line>,
    pub variance: Vec<Line>,
    pub expressions: Expressions,
}

impl Program {
    /// Program of a model; `correction` is given where its sensor is known. Names begin with `prefix`.
    pub fn of(model: &NoiseModel, correction: Option<&Correction>, prefix: &'static str) -> Self {
        let mut expressions = Expressions::new(prefix);
        let mut line = |term: &Term, [low, high]: [f64; 2]| {
            let bounded = high.is_finite() && term.basis.still_power().is_some();
            Line {
                expression: expressions.term(term),
                held: bounded.then_some([low, high]),
                asks_temperature: term.needs().temperature,
            }
        };
        let mut lines =
            |terms: &[LearntTerm]| terms.iter().map(|(t, learnt)| line(t, *learnt)).collect();
        let bias = correction.map_or_else(Vec::new, |c| lines(&c.terms));
        let variance = correction.map_or_else(Vec::new, |c| lines(&c.variance));
        let still = correction.map_or(&[][..], |c| &c.still_terms[..]);
        let still = still.iter().map(|t| line(t, [0.0, f64::INFINITY])).collect();
        Program { sigma: sigma(&model.sigma, prefix), still, bias, variance, expressions }
    }
}

/// The sensor of a model and its correction; `None` for a model of a bare table.
pub(super) fn correction_of(model: &NoiseModel) -> Result<Option<(Sensor, Correction)>> {
    let Some(sensor) = model.described_sensor()? else { return Ok(None) };
    let correction = Correction::of(model, &sensor)?;
    Ok(Some((sensor, correction)))
}

/// A list of numbers, a few per line.
pub(super) fn listed(numbers: &[f64]) -> String {
    const A_LINE: usize = 6;
    let lines: Vec<String> = numbers
        .chunks(A_LINE)
        .map(|few| few.iter().copied().map(number).collect::<Vec<_>>().join(", "))
        .collect();
    lines.join(",\n    ")
}

/// The ids without duplicates.
pub(super) fn once<'a>(ids: impl Iterator<Item = &'a str>) -> String {
    let mut known: Vec<&str> = Vec::new();
    ids.for_each(|id| known.extend((!known.contains(&id)).then_some(id)));
    known.join(", ")
}

/// Notes on what programs leave out of a model.
pub(super) fn left_out(model: &NoiseModel, correction: Option<&Correction>) -> Vec<String> {
    let mut told = Vec::new();
    match correction {
        None => told.push("the model has no sensor: sigma() alone is in the file".to_string()),
        Some(correction) if !correction.unpredicted().is_empty() => told.push(format!(
            "not in the file, for they are more than a pixel's bias and noise: {}",
            once(correction.unpredicted().iter().map(String::as_str))
        )),
        Some(_) => {}
    }
    if correction.is_some_and(|c| c.column_steps) {
        told.push("the file leaves in the steps of whole columns, which every image shows anew: `kinoise correct` takes them out".into());
    }
    if model.effects.iter().any(|e| e.covariance.is_some()) {
        told.push("the file holds best values; how sure they are stays in model.json".into());
    }
    told
}
