//! Findings of the layers that no term of a search describes: textures, steps, losses.

use serde_json::Map;

use super::naming::{MIN_PROBABILITY, none_of_these, physics};
use crate::diagnose::diagnosis::{Alternative, Finding, Size, Status};
use crate::diagnose::missing::finding::{DropoutFinding, NAME_ADEQUATE};
use crate::diagnose::noise::texture_finding::TextureFinding;
use crate::effects;
use crate::model::Covariance;
use crate::terms::{Axis, Statistic};

/// A finding with this name and nothing else said yet; no test has weighed the name.
pub fn named(effect: &'static str, statistic: Statistic, axis: Axis) -> Finding {
    Finding {
        status: Status::Named,
        effect: Some(effect),
        alternatives: vec![Alternative { effect, probability: None }],
        statistic,
        axis,
        interval: [0.0, 0.0],
        unit: axis.unit(),
        share: 0.0,
        minor: false,
        parameters: Map::new(),
        size: Size::default(),
        p_adjusted: None,
        replicated: None,
        physics: physics(Status::Named, Some(effect), statistic, axis, None),
        next_view: None,
        contradicted: None,
        shape: None,
        curve: None,
        terms: Vec::new(),
        covariance: Covariance::default(),
    }
}

/// A mismatch of structure as a finding; `sigma_mm` is the recording's typical sigma.
pub fn texture(found: TextureFinding, sigma_mm: f64, replicated: Option<bool>) -> Finding {
    let effect = found.families.first().copied();
    let status = match found.families.len() {
        0 => Status::Unexplained,
        1 => Status::Named,
        _ => Status::OneOf,
    };
    Finding {
        status,
        effect,
        alternatives: found
            .families
            .iter()
            .map(|&effect| Alternative { effect, probability: None })
            .collect(),
        interval: found.interval,
        share: found.nats,
        parameters: found.parameters,
        size: Size { mm: found.size_sigma * sigma_mm, sigma: found.size_sigma },
        p_adjusted: Some(found.p),
        replicated,
        physics: physics(status, effect, found.statistic, found.axis, found.words.as_deref()),
        shape: found.words,
        ..named(effect.unwrap_or_default(), found.statistic, found.axis)
    }
}

/// Something lost as a finding.
pub fn missing(found: DropoutFinding) -> Finding {
    let status = if found.family.is_some() { Status::Named } else { Status::Unexplained };
    let alternatives = found.family.map_or_else(Vec::new, |name| weighed(name, &found));
    let shape = found
        .family
        .is_none()
        .then(|| format!("more is lost from {:.4} to {:.4}", found.interval[0], found.interval[1]));
    let mut words = physics(status, found.family, Statistic::Dropout, found.axis, shape.as_deref());
    if let Some(since) = found.since_s {
        words += &format!(" It began about {since:.1} s after the first view.");
    }
    Finding {
        status,
        effect: found.family,
        alternatives,
        interval: found.interval,
        share: found.gain,
        parameters: found.parameters,
        size: Size { mm: 0.0, sigma: found.size },
        p_adjusted: Some(found.p),
        replicated: found.replicated,
        physics: words,
        shape,
        curve: Some(found.curve),
        ..named(found.family.unwrap_or_default(), Statistic::Dropout, found.axis)
    }
}

/// The names that losses may have, by how well each predicts views left out; what a nameless curve
/// does better is the chance of none.
fn weighed(name: &'static str, found: &DropoutFinding) -> Vec<Alternative> {
    let best = found.rivals.first().map_or(found.gain, |r| r.1);
    let card = |id: &'static str| effects::find(id).map(|e| e.card().id);
    let curves = found.rivals.iter().filter(|r| card(r.0).is_none());
    let curve = curves.map(|r| r.1).fold(0.0, f64::max);
    let mut odds = vec![(name, 1.0)];
    let rivals = found.rivals.iter().filter_map(|&(id, gain)| Some((card(id)?, gain)));
    odds.extend(
        rivals
            .filter(|r| r.0 != name)
            .map(|(id, gain)| (id, (0.25 * (gain - best).clamp(-60.0, 0.0)).exp())),
    );
    let total: f64 = odds.iter().map(|o| o.1).sum();
    let some = 1.0 - none_of_these(found.gain, curve, NAME_ADEQUATE);
    odds.into_iter()
        .map(|(effect, o)| (effect, some * o / total))
        .filter(|a| a.0 == name || a.1 > MIN_PROBABILITY)
        .map(|(effect, p)| Alternative { effect, probability: Some(p) })
        .collect()
}
