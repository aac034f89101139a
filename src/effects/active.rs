//! An effect with its parameters set, from the command line or from a model file.

use std::ops::Deref;
use std::path::Path;
use std::sync::Arc;

use serde_json::{Map, Value, json};
use strsim::levenshtein;

use super::shape::Shape;
use super::{CATALOGUE, Draw, Effect, Exposure, Settings, find};
use crate::error::{Error, Result};
use crate::model;
use crate::model::NoiseModel;
use crate::rng::Seed;
use crate::terms::{ANYWHERE, Term};
use crate::units::{shortest, to_digits};

/// An effect that is switched on.
#[derive(Clone)]
pub struct Active {
    pub effect: Acting,
    pub settings: Settings,
}

/// An effect of the catalogue, or the fitted shapes of a model.
#[derive(Clone)]
pub enum Acting {
    Catalogue(&'static dyn Effect),
    Shape(Arc<Shape>),
}

impl Deref for Acting {
    type Target = dyn Effect;

    fn deref(&self) -> &Self::Target {
        match self {
            Acting::Catalogue(effect) => *effect,
            Acting::Shape(shape) => &**shape,
        }
    }
}

const KNOWN: &str = "see `kinoise effects` for the ids and their parameters";

fn fault(what: String) -> Error {
    Error::Argument { what, remedy: KNOWN }
}

/// The id that was probably meant: it contains the text or is contained in it, or a few letters differ.
fn nearest(text: &str) -> Option<&'static str> {
    let ids = || CATALOGUE.iter().map(|e| e.card().id);
    // One or two letters occur in any word.
    let part = |id: &&str| text.len() > 2 && (id.contains(text) || text.contains(id));
    let away = |id: &str| levenshtein(text, id);
    ids().find(part).or_else(|| {
        // With more than a third of the letters wrong it is another word.
        ids().min_by_key(|id| away(id)).filter(|id| 3 * away(id) <= id.len())
    })
}

impl Active {
    /// The effect of this id, all parameters at their typical values.
    ///
    /// # Errors
    /// When no effect has this id.
    pub fn typical(id: &str) -> Result<Self> {
        let effect = find(id).ok_or_else(|| {
            let hint = nearest(id).map_or_else(
                || {
                    let ids: Vec<&str> = CATALOGUE.iter().map(|e| e.card().id).collect();
                    format!(", which has {}", ids.join(", "))
                },
                |near| format!("; did you mean {near}?"),
            );
            fault(format!("effect \"{id}\" is not in the catalogue{hint}"))
        })?;
        Ok(Active { effect: Acting::Catalogue(effect), settings: Settings::typical(effect.card()) })
    }

    /// `self` with one parameter set.
    ///
    /// # Errors
    /// When the effect has no such parameter, or the value is outside its range.
    pub fn with(mut self, key: &str, value: f64) -> Result<Self> {
        let card = self.effect.card();
        let index = card.parameters.iter().position(|p| p.name == key).ok_or_else(|| {
            let names: Vec<&str> = card.parameters.iter().map(|p| p.name).collect();
            fault(format!("effect {} has no \"{key}\", but {}", card.id, names.join(", ")))
        })?;
        let p = &card.parameters[index];
        let [low, high] = p.range;
        if !(low..=high).contains(&value) {
            return Err(fault(format!(
                "effect {}: {key} = {value} is outside {low} to {high} {}",
                card.id,
                p.unit()
            )));
        }
        self.settings.0[index] = value;
        Ok(self)
    }

    /// Parses `ID`, or `ID:key=value,key=value`.
    ///
    /// # Errors
    /// When the text has another form, or names what is not in the catalogue.
    pub fn parse(text: &str) -> Result<Self> {
        let (id, knobs) = text.split_once(':').unwrap_or((text, ""));
        let mut active = Active::typical(id.trim())?;
        for knob in knobs.split(',').filter(|k| !k.trim().is_empty()) {
            let (key, value) = knob
                .split_once('=')
                .ok_or_else(|| fault(format!("effect {id}: \"{knob}\" is not key=value")))?;
            let number = value
                .trim()
                .parse()
                .map_err(|_| fault(format!("effect {id}: {key} = \"{value}\" is not a number")))?;
            active = active.with(key.trim(), number)?;
        }
        Ok(active)
    }

    /// From an entry of `model.json`: parameters as numbers or as {"value": number, ..}.
    ///
    /// # Errors
    /// As [`Active::with`]; and when a parameter is not a number.
    pub fn from_model(entry: &model::Effect) -> Result<Self> {
        let id = &entry.id;
        let mut active = Active::typical(id)?;
        for (key, value) in &entry.parameters {
            let number = entry
                .number(key)
                .ok_or_else(|| fault(format!("effect {id}: {key} = {value} is not a number")))?;
            active = active.with(key, number)?;
        }
        Ok(active)
    }

    /// Checks that the catalogue knows these effects, and that those given by a formula have its
    /// parameters, within their ranges. Parameters beside a fitted shape are no settings and are ignored.
    ///
    /// # Errors
    /// When an effect fails the check.
    pub fn check_model(effects: &[model::Effect]) -> Result<()> {
        effects.iter().try_for_each(|entry| match &entry.shape[..] {
            [] => Active::from_model(entry).map(drop),
            _ if entry.id == model::UNEXPLAINED => Ok(()),
            _ => Active::typical(&entry.id).map(drop),
        })
    }

    /// All effects of a model: formulas, and fitted shapes where an effect has one.
    ///
    /// # Errors
    /// As [`Active::from_model`], for effects without a shape.
    pub fn all_of_model(effects: &[model::Effect]) -> Result<Vec<Self>> {
        let formulas = effects.iter().filter(|e| e.shape.is_empty());
        let mut all: Vec<Active> = formulas.map(Active::from_model).collect::<Result<_>>()?;
        let shapes = Shape::of(effects.iter().flat_map(|e| {
            let learnt = e.learnt_px.unwrap_or(ANYWHERE);
            e.shape.iter().map(move |term| (term.clone(), learnt))
        }));
        all.extend(shapes.map(|shape| Active {
            effect: Acting::Shape(Arc::new(shape)),
            settings: Settings(Vec::new()),
        }));
        Ok(all)
    }

    /// JSON for a recipe: the formula's parameters, or the terms of the shape.
    pub fn described(&self) -> Value {
        let id = self.effect.card().id;
        match &self.effect {
            Acting::Catalogue(_) => json!({"id": id, "parameters": self.parameters()}),
            Acting::Shape(shape) => {
                let terms: Vec<&Term> = shape.terms.iter().map(|(term, _)| term).collect();
                json!({"id": id, "shape": terms})
            }
        }
    }

    /// Whether the strength is the one at which the effect does nothing.
    pub fn is_identity(&self) -> bool {
        // A shape has no parameters.
        self.settings.0.first().is_some_and(|strength| *strength == self.effect.card().identity)
    }

    /// Applies it to an exposure, unless it is at its identity.
    pub fn act(&self, exposure: &mut Exposure, seed: Seed) {
        if !self.is_identity() {
            let draw = Draw { seed, id: self.effect.card().id, instant: exposure.instant };
            self.effect.forward(&self.settings, exposure, &draw);
        }
    }

    /// Refuses duplicates: they would share their random numbers, and so would not be independent.
    ///
    /// # Errors
    /// When an effect occurs twice.
    pub fn refuse_twice(effects: &[Active]) -> Result<()> {
        let ids: Vec<&str> = effects.iter().map(|a| a.effect.card().id).collect();
        match ids.iter().enumerate().find(|(n, id)| ids[..*n].contains(id)) {
            None => Ok(()),
            Some((_, id)) => Err(Error::Argument {
                what: format!("effect {id} is there twice (a model brings its own)"),
                remedy: "give it once, all its knobs in one: ID:KEY=VALUE,KEY=VALUE",
            }),
        }
    }

    /// The effects in light-path order, whatever the order given: by stage, within a stage as in the
    /// catalogue.
    pub fn in_light_path(effects: &[Active]) -> Vec<&Active> {
        let place = |a: &&Active| {
            let card = a.effect.card();
            (card.stage, CATALOGUE.iter().position(|e| e.card().id == card.id))
        };
        let mut ordered: Vec<&Active> = effects.iter().collect();
        ordered.sort_by_key(place);
        ordered
    }

    /// Text for [`Active::parse`], with every parameter to four digits.
    pub fn argument(&self) -> String {
        let card = self.effect.card();
        let knobs = card.parameters.iter().zip(&self.settings.0);
        let knobs: Vec<String> =
            knobs.map(|(p, &v)| format!("{}={}", p.name, shortest(to_digits(v, 4)))).collect();
        format!("{}:{}", card.id, knobs.join(","))
    }

    /// The parameters by name.
    pub fn parameters(&self) -> Map<String, Value> {
        let names = self.effect.card().parameters.iter().map(|p| p.name.to_string());
        names.zip(self.settings.0.iter().map(|&v| Value::from(v))).collect()
    }
}

impl std::fmt::Debug for Active {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}:{:?}", self.effect.card().id, self.settings.0)
    }
}

impl NoiseModel {
    /// Reads a `model.json`, or the folder that holds one.
    ///
    /// # Errors
    /// When the file is missing, not a model, damaged, or of a newer format; and when an effect without a
    /// fitted shape is not in the catalogue, or has a parameter that is unknown or out of range: nothing
    /// that reads the model would do what it says.
    pub fn read(path: &Path) -> Result<Self> {
        let file = Self::file(path);
        let model = Self::read_unchecked(&file)?;
        Active::check_model(&model.effects).map_err(|e| e.of(&file))?;
        Ok(model)
    }
}
