//! Effects of the units' models by id: which units have them, and their parameters.
//!
//! They are descriptive only. Diagnoses split the same bias differently among causes, so parameters scatter
//! by more than their errors even where the sum in metres does not.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::curve::{Curve, same};
use crate::effects::{Parameter, find};
use crate::model::{Effect, UNEXPLAINED};
use crate::stats::RandomEffects;

/// An effect that at least one unit's model holds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SharedEffect {
    pub id: String,
    pub found_in: Vec<String>,
    /// Units where it was not found, which does not prove its absence.
    pub not_found_in: Vec<String>,
    pub parameters: Vec<SharedParameter>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SharedParameter {
    pub name: String,
    pub unit: &'static str,
    pub units: Vec<ParameterOfUnit>,
    /// Over the units that state an error; null where fewer than two do.
    pub random_effects: Option<RandomEffects>,
    /// p-value of the hypothesis that all units have the same value, by the stated errors.
    pub p_same: Option<f64>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ParameterOfUnit {
    pub unit: String,
    pub value: f64,
    /// Null where the model states none.
    pub std_error: Option<f64>,
}

/// Effects by id over the named units; unexplained ones are left to the bias as a whole.
pub(super) fn shared(units: &[(String, &[Effect])]) -> Vec<SharedEffect> {
    let mut ids: Vec<&str> = Vec::new();
    for effect in units.iter().flat_map(|(_, effects)| effects.iter()) {
        if effect.id != UNEXPLAINED && !ids.contains(&effect.id.as_str()) {
            ids.push(&effect.id);
        }
    }
    ids.sort_unstable();
    ids.into_iter().map(|id| by_id(id, units)).collect()
}

fn by_id(id: &str, units: &[(String, &[Effect])]) -> SharedEffect {
    let (mut found_in, mut not_found_in) = (Vec::new(), Vec::new());
    let mut parameters: Vec<SharedParameter> = Vec::new();
    for (unit, effects) in units {
        let Some(effect) = effects.iter().find(|e| e.id == id) else {
            not_found_in.push(unit.clone());
            continue;
        };
        found_in.push(unit.clone());
        for (name, value) in &effect.parameters {
            let Some(number) = effect.number(name).filter(|v| v.is_finite()) else { continue };
            let std_error = value.get("std_error").and_then(serde_json::Value::as_f64);
            let std_error = std_error.filter(|s| s.is_finite());
            let of_unit = ParameterOfUnit { unit: unit.clone(), value: number, std_error };
            match parameters.iter_mut().find(|p| p.name == *name) {
                Some(known) => known.units.push(of_unit),
                None => parameters.push(SharedParameter {
                    name: name.clone(),
                    unit: unit_of(id, name),
                    units: vec![of_unit],
                    random_effects: None,
                    p_same: None,
                }),
            }
        }
    }
    parameters.iter_mut().for_each(weigh);
    SharedEffect { id: id.into(), found_in, not_found_in, parameters }
}

fn unit_of(id: &str, parameter: &str) -> &'static str {
    let known = find(id).and_then(|e| e.card().parameters.iter().find(|p| p.name == parameter));
    known.map_or("", Parameter::unit)
}

fn weigh(parameter: &mut SharedParameter) {
    let known = parameter.units.iter().filter_map(|u| Some((u.value, u.std_error?.powi(2))));
    // A zero error marks a value that was not fitted.
    let known: Vec<(f64, f64)> = known.filter(|(_, v)| *v > 0.0).collect();
    parameter.random_effects = RandomEffects::of(&known);
    let curves: Vec<Curve> =
        known.iter().map(|&(value, variance)| single(value, variance)).collect();
    parameter.p_same = same(&curves.iter().collect::<Vec<_>>());
}

/// A curve with a single value. The fits have thousands of samples, and no model states the degrees of
/// freedom of its effects.
fn single(value: f64, variance: f64) -> Curve {
    Curve {
        values: DVector::from_element(1, value),
        covariance: DMatrix::from_element(1, 1, variance),
        degrees_of_freedom: 1e9,
    }
}
