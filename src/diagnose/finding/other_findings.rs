//! Findings of the layers that no term of a search describes.

use serde_json::Map;

use super::naming::physics;
use crate::diagnose::diagnosis::{Alternative, Finding, Size, Status};
use crate::diagnose::noise::texture_finding::TextureFinding;
use crate::model::Covariance;
use crate::terms::{Axis, Statistic};

/// A finding with this name and nothing else filled in; no test has weighed the name.
pub fn named(effect: &'static str, statistic: Statistic, axis: Axis) -> Finding {
    of_names(&[effect], statistic, axis, None)
}

/// A finding without a name and with nothing else filled in.
pub fn nameless(statistic: Statistic, axis: Axis) -> Finding {
    of_names(&[], statistic, axis, None)
}

/// A finding of this shape with these possible names, best first, or none, and nothing else filled in.
pub fn of_names(
    names: &[&'static str],
    statistic: Statistic,
    axis: Axis,
    shape: Option<String>,
) -> Finding {
    let status = match names.len() {
        0 => Status::Unexplained,
        1 => Status::Named,
        _ => Status::OneOf,
    };
    let effect = names.first().copied();
    let alternative = |&effect: &&'static str| Alternative { effect, probability: None };
    Finding {
        status,
        effect,
        alternatives: names.iter().map(alternative).collect(),
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
        physics: physics(status, effect, statistic, axis, shape.as_deref()),
        next_view: None,
        of_some: None,
        contradicted: None,
        shape,
        curve: None,
        terms: Vec::new(),
        covariance: Covariance::default(),
    }
}

/// A mismatch of structure as a finding; `sigma_mm` is the recording's typical sigma.
pub fn texture(found: TextureFinding, sigma_mm: f64, replicated: Option<bool>) -> Finding {
    let mut finding = Finding {
        interval: found.interval,
        share: found.nats,
        parameters: found.parameters,
        size: Size { mm: found.size_sigma * sigma_mm, sigma: found.size_sigma },
        p_adjusted: Some(found.p),
        replicated,
        of_some: found.of_some,
        ..of_names(&found.families, found.statistic, found.axis, found.words)
    };
    // The text of a name does not have what was measured.
    if let Some(measured) = finding.shape.as_ref().filter(|_| finding.effect.is_some()) {
        finding.physics += &format!(" Measured here: {measured}.");
    }
    finding
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_measured_is_told_with_a_name_and_without() {
        let told = |families: Vec<&'static str>| {
            let (statistic, axis) = (Statistic::Distribution, Axis::Residual);
            let words = Some("in 4 of 14 views".to_string());
            let found =
                TextureFinding { words, ..TextureFinding::named(families, statistic, axis) };
            texture(found, 1.0, None).physics
        };
        for families in [vec!["heavy-tails"], vec![]] {
            assert_eq!(told(families).matches("in 4 of 14 views").count(), 1);
        }
    }
}
