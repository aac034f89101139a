//! What the model knows already: it is taken out before anything is looked for.

use serde_json::{Map, Value};

use crate::camera::Camera;
use crate::effects;
use crate::model::NoiseModel;
use crate::terms::{Statistic, Term};

/// The model's effects as terms, and the rest by name.
#[derive(Debug, Clone, Default)]
pub struct KnownTerms {
    /// Of the disparity, px.
    pub bias: Vec<Term>,
    /// Of the logarithm of its variance.
    pub variance: Vec<Term>,
    entries: Vec<(String, Map<String, Value>)>,
}

impl KnownTerms {
    pub fn of(model: &NoiseModel, camera: &Camera) -> Self {
        let mut known = KnownTerms::default();
        for entry in &model.effects {
            let simple;
            let terms: &[Term] = if entry.shape.is_empty() {
                let known = |name: &str| number(&entry.parameters, name);
                simple = effects::find(&entry.id).and_then(|e| e.term(&known, camera));
                simple.as_slice()
            } else {
                &entry.shape
            };
            for term in terms {
                match term.statistic {
                    Statistic::Bias => known.bias.push(term.clone()),
                    Statistic::Variance => known.variance.push(term.clone()),
                    _ => {}
                }
            }
            known.entries.push((entry.id.clone(), entry.parameters.clone()));
        }
        known
    }

    /// Take a parameter of an effect for known; nothing is taken out for it.
    pub fn learn(&mut self, id: &str, name: &str, value: f64) {
        let entry = match self.entries.iter().position(|e| e.0 == id) {
            Some(k) => &mut self.entries[k],
            None => {
                self.entries.push((id.into(), Map::new()));
                let last = self.entries.len() - 1;
                &mut self.entries[last]
            }
        };
        entry.1.insert(name.into(), value.into());
    }

    /// Take what `found` has for known, whatever was learnt since.
    pub fn overrule(&mut self, found: &KnownTerms) {
        for (id, parameters) in &found.entries {
            for name in parameters.keys() {
                if let Some(value) = number(parameters, name) {
                    self.learn(id, name, value);
                }
            }
        }
    }

    pub fn has(&self, id: &str) -> bool {
        self.entries.iter().any(|(known, _)| known == id)
    }

    /// A parameter of an entry.
    pub fn parameter(&self, id: &str, name: &str) -> Option<f64> {
        self.entries.iter().find(|(known, _)| known == id).and_then(|(_, p)| number(p, name))
    }
}

fn number(parameters: &Map<String, Value>, name: &str) -> Option<f64> {
    let value = parameters.get(name)?;
    value.get("value").unwrap_or(value).as_f64()
}

#[cfg(test)]
#[path = "known_tests.rs"]
mod tests;
