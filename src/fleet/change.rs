//! Detects changes of a unit from models of the same serial number made at different dates.

use std::path::PathBuf;

use serde::Serialize;

use super::bias::{self, mean_squares};
use super::curve::same;
use super::own::LEVEL;
use super::sigma;
use super::unit::UnitModel;
use crate::error::Result;
use crate::stats::student_quantile;

/// An older model of a unit compared with its newest.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Change {
    pub unit: String,
    pub from: PathBuf,
    pub from_created: String,
    pub to: PathBuf,
    pub to_created: String,
    pub sigma: ChangeOfSigma,
    /// Null where one of the models holds no measured bias, or none at a distance that both have seen.
    pub bias: Option<ChangeOfBias>,
    /// Ids of effects only in the newest model, and only in the older one.
    pub found_now: Vec<String>,
    pub found_then: Vec<String>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChangeOfSigma {
    pub changed: bool,
    /// p-value times the number of tests for changes.
    pub p_adjusted: f64,
    pub places: Vec<SigmaThenAndNow>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SigmaThenAndNow {
    pub z_m: f64,
    pub theta_rad: f64,
    pub from_m: f64,
    pub to_m: f64,
    pub change_m: f64,
    /// 95 % interval at this place alone.
    pub interval_m: [f64; 2],
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChangeOfBias {
    pub changed: bool,
    pub p_adjusted: f64,
    pub distances: Vec<BiasThenAndNow>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BiasThenAndNow {
    pub z_m: f64,
    /// RMS over the picture, minus what the errors alone would give.
    pub change_rms_m: f64,
    pub error_rms_m: f64,
}

/// Compares every older model with the newest; `groups` hold the models of a unit in order of time.
pub(super) fn changes(groups: &[(String, Vec<&UnitModel>)]) -> Result<Vec<Change>> {
    let mut changes = Vec::new();
    for (unit, models) in groups {
        let Some((newest, older)) = models.split_last() else { continue };
        for before in older {
            changes.push(change(unit, before, newest)?);
        }
    }
    let tests = changes.iter().map(|c| 1 + usize::from(c.bias.is_some())).sum::<usize>() as f64;
    let adjust = |p: &mut f64, changed: &mut bool| {
        *p = (*p * tests).min(1.0);
        *changed = *p < LEVEL;
    };
    for change in &mut changes {
        adjust(&mut change.sigma.p_adjusted, &mut change.sigma.changed);
        if let Some(bias) = &mut change.bias {
            adjust(&mut bias.p_adjusted, &mut bias.changed);
        }
    }
    Ok(changes)
}

fn change(unit: &str, from: &UnitModel, to: &UnitModel) -> Result<Change> {
    let only = |these: &UnitModel, those: &UnitModel| {
        let known = |id: &String| those.model.effects.iter().any(|e| e.id == *id);
        let mut ids: Vec<String> = Vec::new();
        for effect in &these.model.effects {
            if !known(&effect.id) && !ids.contains(&effect.id) {
                ids.push(effect.id.clone());
            }
        }
        ids
    };
    Ok(Change {
        unit: unit.into(),
        from: from.path.clone(),
        from_created: from.model.provenance.created.clone(),
        to: to.path.clone(),
        to_created: to.model.provenance.created.clone(),
        sigma: change_of_sigma(from, to)?,
        bias: change_of_bias(from, to),
        found_now: only(to, from),
        found_then: only(from, to),
    })
}

fn change_of_sigma(from: &UnitModel, to: &UnitModel) -> Result<ChangeOfSigma> {
    let places = sigma::places(&[from, to])?;
    let [then, now] = [from, to].map(|u| sigma::curve(&u.model.sigma, &places));
    let reach = student_quantile(0.95, now.minus(&then).degrees_of_freedom);
    let at = |(i, &(z_m, theta_rad)): (usize, &sigma::Place)| {
        let [from_m, to_m] = [&then, &now].map(|c| c.values[i].exp());
        let change_m = to_m - from_m;
        let error = f64::hypot(from_m * then.std_error(i), to_m * now.std_error(i));
        let interval_m = [change_m - reach * error, change_m + reach * error];
        SigmaThenAndNow { z_m, theta_rad, from_m, to_m, change_m, interval_m }
    };
    // The errors are known: models without them were refused.
    let p_adjusted = same(&[&then, &now]).unwrap_or(1.0);
    Ok(ChangeOfSigma {
        changed: false,
        p_adjusted,
        places: places.iter().enumerate().map(at).collect(),
    })
}

fn change_of_bias(from: &UnitModel, to: &UnitModel) -> Option<ChangeOfBias> {
    let shapes = [from, to].map(|u| bias::shapes(&u.model).ok());
    let [Some(before), Some(after)] = shapes else { return None };
    let distances = bias::distances(&[&from.model, &to.model]);
    let then = bias::curve(&from.model, &before, &distances)?;
    let now = bias::curve(&to.model, &after, &distances)?;
    let p_adjusted = same(&[&then, &now])?;
    let difference = now.minus(&then);
    let at = |(d, &z_m): (usize, &f64)| {
        let [square, error] = mean_squares(&difference, d);
        BiasThenAndNow {
            z_m,
            change_rms_m: (square - error).max(0.0).sqrt(),
            error_rms_m: error.sqrt(),
        }
    };
    Some(ChangeOfBias {
        changed: false,
        p_adjusted,
        distances: distances.iter().enumerate().map(at).collect(),
    })
}
