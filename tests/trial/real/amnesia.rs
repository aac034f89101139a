//! A term that a real recording needs is struck from its model.

use rand::Rng;

use super::full::{Found, Full};
use crate::{Asked, Hidden};
use kinoise::error::{Error, Result};
use kinoise::model::NoiseModel;
use kinoise::rng::Stream;

/// A term that gains less is not what the recording needs, nats.
const MIN_NATS: f64 = 50.0;
/// Terms without a name are told of by where they are only: one set in so many may strike one.
const NAMELESS_EVERY: u32 = 5;

/// The model without one of its terms, and what that was. `share` is that of the pixels which the
/// set keeps.
///
/// # Errors
/// When the model has no such term.
pub(super) fn strike(
    full: &Full,
    asked: &Asked,
    share: f64,
    rng: &mut Stream,
) -> Result<(NoiseModel, Hidden)> {
    let least = asked.nats.unwrap_or(MIN_NATS);
    let wanted = |found: &Found| asked.names.contains(&found.form);
    let needed = |found: &Found| found.nats.is_none_or(|nats| nats * share >= least);
    let those = |fits: &dyn Fn(&Found) -> bool| -> Vec<usize> {
        (0..full.terms.len()).filter(|&k| fits(&full.terms[k])).collect()
    };
    let mut choice = those(&|f| if asked.names.is_empty() { needed(f) } else { wanted(f) });
    if asked.names.is_empty() && rng.random_range(0..NAMELESS_EVERY) > 0 {
        let named = those(&|f| needed(f) && !f.names.is_empty());
        choice = if named.is_empty() { choice } else { named };
    }
    if choice.is_empty() {
        let has: Vec<&str> = full.terms.iter().map(|t| t.form.as_str()).collect();
        return Err(Error::Argument {
            what: format!(
                "{}: no term to strike; its model holds {}",
                full.recording.root.display(),
                has.join(", ")
            ),
            remedy: "name one of these, or ask for fewer nats",
        });
    }
    let k = choice[rng.random_range(0..choice.len())];
    let mut model = full.model.clone();
    model.effects.remove(k);
    Ok((model, hidden(&full.terms[k], share)))
}

fn hidden(found: &Found, share: f64) -> Hidden {
    Hidden {
        names: found.names.clone(),
        form: found.form.clone(),
        statistic: found.statistic.clone(),
        axis: found.axis.clone(),
        also: beside(&found.statistic, &found.axis),
        interval: Some(found.interval),
        parameters: found.parameters.clone(),
        nats: found.nats.map(|n| n * share),
    }
}

/// A pattern of the picture shows on all the picture's axes.
fn beside(statistic: &str, axis: &str) -> Vec<String> {
    let also: &[&str] = match (statistic, axis) {
        ("bias", "pixel") => &["radius", "column", "row"],
        ("bias", "radius") => &["pixel"],
        _ => &[],
    };
    also.iter().map(ToString::to_string).collect()
}
