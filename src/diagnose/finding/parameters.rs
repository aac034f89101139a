//! The parameters reported for a finding.

use serde_json::{Map, Value, json};

use crate::diagnose::search::candidate::RECALIBRATE;
use crate::effects::{self, Estimate, Fitted};
use crate::terms::Basis;

/// A parameter with its standard error, which is null where it is not finite.
pub fn estimate(value: f64, std_error: f64) -> Value {
    json!({ "value": value, "std_error": std_error })
}

/// A single parameter, by its name.
pub fn one(name: &str, value: f64, std_error: f64) -> Map<String, Value> {
    Map::from_iter([(name.into(), estimate(value, std_error))])
}

/// Parameters of a family's fitted shape, whose formula has this relative error; none for a nameless curve.
pub fn parameters(family: Option<&str>, formula_error: f64, fit: &Fitted) -> Map<String, Value> {
    let all = match family {
        Some(RECALIBRATE) => sigma_factor(fit),
        Some(id) => effects::find(id).map_or_else(Vec::new, |e| e.estimates(fit)),
        None => Vec::new(),
    };
    let all = all.into_iter().map(|e| e.of_any_formula(formula_error));
    all.map(|e| (e.parameter.to_string(), estimate(e.value, e.std_error))).collect()
}

/// Factor of sigma, for a level only.
fn sigma_factor(fit: &Fitted) -> Vec<Estimate> {
    let level = |b: &[f64]| (0.5 * b[0]).exp();
    if *fit.shape == Basis::Level { vec![fit.estimate("sigma_factor", &level)] } else { Vec::new() }
}

#[cfg(test)]
#[path = "parameters_tests.rs"]
mod tests;
