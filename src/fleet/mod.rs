//! Compares several units of a kind: what they share, what is specific to one unit, and whether a unit has
//! changed.
//!
//! Two quantities are compared, each with the covariance in the models: sigma along the optical axis at
//! distances and tilts that all units have measured, and the bias of depth over the picture. Coefficients are
//! not compared: they are correlated, and different ones give the same curve.
//!
//! - *Shared*: a random-effects mean and the scatter between units ([`crate::stats::RandomEffects`]).
//! - *Specific*: units that differ from the others' mean by more than the errors, removed one at a time
//!   (`own`).
//! - *Changed*: an older model of the same serial number against its newest (`change`).
//!
//! Each question raises a false alarm in at most one run in a hundred ([`LEVEL`]), whatever the number of
//! units.

mod bias;
mod change;
mod curve;
mod own;
mod parameters;
mod sigma;
mod unit;

use std::path::PathBuf;

use serde::Serialize;

use crate::error::Result;

pub use bias::{BiasOfUnit, SharedBias, SharedDistance};
pub use change::{BiasThenAndNow, Change, ChangeOfBias, ChangeOfSigma, SigmaThenAndNow};
pub use own::{LEVEL, Standing};
pub use parameters::{ParameterOfUnit, SharedEffect, SharedParameter};
pub use sigma::{SharedPlace, SharedSigma, SigmaOfUnit};
pub use unit::UnitModel;

pub const FORMAT: &str = "kinoise-units/1";

/// Result of a comparison.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    pub format: &'static str,
    pub sensor: String,
    pub width: usize,
    pub height: usize,
    /// Significance level: the false-alarm probability of one question.
    pub level: f64,
    /// The units, each with its newest model.
    pub units: Vec<Unit>,
    /// Null for a single unit.
    pub sigma: Option<SharedSigma>,
    /// Null where fewer than two units hold a measured bias.
    pub bias: Option<SharedBias>,
    pub effects: Vec<SharedEffect>,
    pub changes: Vec<Change>,
    pub remarks: Vec<String>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Unit {
    pub name: String,
    pub model: PathBuf,
    pub created: String,
    pub views: usize,
    pub degrees_of_freedom: f64,
}

/// A unit's models in order of time.
type Group<'a> = (String, Vec<&'a UnitModel>);

/// Compares at least two models of one kind of sensor.
/// Fails if they cannot be compared: too few, of several kinds, without errors, of the same frames, or
/// measured at distances that have nothing in common.
pub fn compare(models: &[UnitModel]) -> Result<Comparison> {
    let mut remarks = unit::check(models)?;
    let groups = group(models, &mut remarks);
    let newest: Vec<(String, &UnitModel)> =
        groups.iter().filter_map(|(name, models)| Some((name.clone(), *models.last()?))).collect();
    let biases = bias::comparable(&newest, &mut remarks);
    let statistics = 1 + usize::from(biases.is_some());
    let sigma = match newest.len() {
        0 | 1 => None,
        _ => sigma::shared(&newest, statistics)?,
    };
    let of_sensor = models.first().and_then(|u| u.model.sensor.as_ref());
    let effects: Vec<_> =
        newest.iter().map(|(name, u)| (name.clone(), &u.model.effects[..])).collect();
    Ok(Comparison {
        format: FORMAT,
        sensor: of_sensor.map_or(String::new(), |s| s.sensor.clone()),
        width: of_sensor.map_or(0, |s| s.camera.width),
        height: of_sensor.map_or(0, |s| s.camera.height),
        level: LEVEL,
        units: newest.iter().map(describe).collect(),
        sigma,
        bias: biases.and_then(|biases| bias::shared(&biases, statistics)),
        effects: parameters::shared(&effects),
        changes: change::changes(&groups)?,
        remarks,
    })
}

fn describe((name, unit): &(String, &UnitModel)) -> Unit {
    Unit {
        name: name.clone(),
        model: unit.path.clone(),
        created: unit.model.provenance.created.clone(),
        views: unit.model.fit.views,
        degrees_of_freedom: unit.model.sigma.degrees_of_freedom,
    }
}

/// Groups models by serial number; a model without one is its own group. Where two names would be the same,
/// the file's path is used.
fn group<'a>(models: &'a [UnitModel], remarks: &mut Vec<String>) -> Vec<Group<'a>> {
    let mut groups: Vec<Group<'a>> = Vec::new();
    for unit in models {
        let same_unit = |g: &&mut Group<'a>| {
            unit.serial().is_some() && g.1.first().and_then(|u| u.serial()) == unit.serial()
        };
        if let Some(group) = groups.iter_mut().find(same_unit) {
            group.1.push(unit);
            continue;
        }
        let taken = groups.iter().any(|(name, _)| *name == unit.name());
        let name = if taken { unit.path.display().to_string() } else { unit.name() };
        groups.push((name, vec![unit]));
    }
    for (name, models) in &mut groups {
        let dates: Vec<_> = models.iter().map(|u| u.created()).collect();
        let mut sorted = dates.clone();
        sorted.sort();
        sorted.dedup();
        if dates.iter().all(Option::is_some) && sorted.len() == dates.len() {
            models.sort_by_key(|u| u.created());
        } else if models.len() > 1 {
            remarks.push(format!(
                "{name}: its models do not tell two dates apart; the last one given is taken for the newest"
            ));
        }
    }
    groups
}
