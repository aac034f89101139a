//! Several units of a kind: what they have in common, what is one unit's own, and whether a unit has
//! changed since.
//!
//! Two things are compared, each with the covariance that the models carry: sigma along the
//! optical axis at distances and tilts that all units have measured, and the bias of depth over the
//! picture. Coefficients are not: they are correlated, and different ones make the same curve.
//!
//! - *In common*: a random-effects mean and the scatter between units ([`crate::stats::RandomEffects`]).
//! - *One's own*: units that differ from the others' mean by more than the errors, taken out one by
//!   one (`own`).
//! - *Changed since*: an older model of the same serial number against its newest (`change`).
//!
//! Each question raises a false alarm in one run of a hundred at most ([`LEVEL`]), however many units.

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

/// What came out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    pub format: &'static str,
    pub sensor: String,
    pub width: usize,
    pub height: usize,
    /// Of the tests: the chance of a false alarm in one question.
    pub level: f64,
    /// Each with its newest model.
    pub units: Vec<Unit>,
    /// Null where there is one unit only.
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

/// Compare them: two models at least, of one kind of sensor.
/// An error when they cannot be compared: too few, of several kinds, without errors, of the same frames, or
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

/// By serial number; models without one stand for themselves. Names are told apart by the file
/// where two would be the same.
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
        } else {
            remarks.push(format!(
                "{name}: its models do not tell two dates apart; the last one given is taken for the newest"
            ));
        }
    }
    groups
}
