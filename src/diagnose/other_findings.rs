//! Findings of the layers that no term of a search describes: textures, steps, losses.

use serde_json::Map;

use super::diagnosis::{Alternative, Finding, Size, Status};
use super::missing::DropoutFinding;
use super::naming::physics;
use super::noise::Hanging;
use crate::effects;
use crate::terms::{Axis, Statistic};

/// A finding with this name and nothing else said yet.
pub fn named(effect: &'static str, probability: f64, statistic: Statistic, axis: Axis) -> Finding {
    Finding {
        status: Status::Named,
        effect: Some(effect),
        alternatives: vec![Alternative { effect, probability }],
        statistic,
        axis,
        interval: [0.0, 0.0],
        unit: axis.unit(),
        share: 0.0,
        parameters: Map::new(),
        size: Size::default(),
        p_adjusted: 1.0,
        replicated: None,
        physics: physics(Status::Named, Some(effect), statistic, axis, None),
        next_view: None,
        shape: None,
        curve: None,
        terms: Vec::new(),
    }
}

/// A mismatch of structure as a finding; `sigma_mm` is the recording's typical sigma.
pub fn hanging(found: Hanging, sigma_mm: f64, replicated: Option<bool>) -> Finding {
    let effect = found.families.first().copied();
    let status = match found.families.len() {
        0 => Status::Unexplained,
        1 => Status::Named,
        _ => Status::OneOf,
    };
    let n = found.families.len() as f64;
    let each = if n > 1.0 { 0.96 / n } else { 0.97 };
    Finding {
        status,
        effect,
        alternatives: found
            .families
            .iter()
            .map(|&effect| Alternative { effect, probability: each })
            .collect(),
        statistic: found.statistic,
        axis: found.axis,
        interval: found.interval,
        unit: found.axis.unit(),
        share: found.nats,
        parameters: found.parameters,
        size: Size { mm: found.size_sigma * sigma_mm, sigma: found.size_sigma },
        p_adjusted: found.p,
        replicated,
        physics: physics(status, effect, found.statistic, found.axis, found.words.as_deref()),
        next_view: None,
        shape: found.words,
        curve: None,
        terms: Vec::new(),
    }
}

/// Something lost as a finding.
pub fn missing(found: DropoutFinding) -> Finding {
    let status = if found.family.is_some() { Status::Named } else { Status::Unexplained };
    let best = found.rivals.first().map_or(found.gain, |r| r.1);
    let mut alternatives: Vec<Alternative> = Vec::new();
    if let Some(effect) = found.family {
        let known: Vec<(&'static str, f64)> = found
            .rivals
            .iter()
            .filter_map(|&(id, gain)| Some((effects::find(id)?.card().id, gain)))
            .filter(|r| r.0 != effect)
            .map(|(id, gain)| (id, (0.25 * (gain - best).clamp(-60.0, 0.0)).exp()))
            .collect();
        let total = 1.0 + known.iter().map(|k| k.1).sum::<f64>();
        alternatives.push(Alternative { effect, probability: 0.97 / total });
        alternatives.extend(
            known
                .iter()
                .map(|&(effect, odds)| Alternative { effect, probability: 0.97 * odds / total })
                .filter(|a| a.probability > 0.005),
        );
    }
    let shape = found
        .family
        .is_none()
        .then(|| format!("more is lost from {:.4} to {:.4}", found.interval[0], found.interval[1]));
    let words = physics(status, found.family, Statistic::Dropout, found.axis, shape.as_deref());
    Finding {
        status,
        effect: found.family,
        alternatives,
        statistic: Statistic::Dropout,
        axis: found.axis,
        interval: found.interval,
        unit: found.axis.unit(),
        share: found.gain,
        parameters: found.parameters,
        size: Size { mm: 0.0, sigma: found.size },
        p_adjusted: found.p,
        replicated: found.replicated,
        physics: words,
        next_view: None,
        shape,
        curve: Some(found.curve),
        terms: Vec::new(),
    }
}
