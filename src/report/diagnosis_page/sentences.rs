//! The page's wording of findings by their status.

use crate::diagnose::{Diagnosis, Finding, Reference, Status};
use crate::effects;
use crate::report::numbers::{decimals_for, fixed, millimetres};
use crate::terms::{Axis, Statistic};

/// Least probability at which a third or later alternative enters a finding's name.
const MIN_PROBABILITY: f64 = 0.05;
/// Times from this on are given in minutes, s.
const MINUTES_FROM_S: f64 = 180.0;
const SECONDS_A_MINUTE: f64 = 60.0;

/// The catalogue's title of an effect, worded to fit into a sentence; an unknown id stands for itself.
pub(super) fn title(id: &'static str) -> &'static str {
    effects::find(id).map_or(id, |effect| effect.card().title)
}

/// The catalogue's description of an effect.
pub(super) fn description(id: &'static str) -> &'static str {
    effects::find(id).map_or(id, |effect| effect.card().summary)
}

/// What the recording was compared with.
pub fn subject(diagnosis: &Diagnosis) -> &'static str {
    match diagnosis.reference {
        Reference::Model => "model",
        Reference::SimulatedRecording => "simulation",
    }
}

/// Findings that are physics missing from the model. Excluded are minor findings, contradicted effects, wrong
/// parameters, and effects that cannot be identified.
pub(super) fn missing(findings: &[Finding]) -> Vec<&Finding> {
    let lacking = [Status::Named, Status::OneOf, Status::Unexplained];
    let lacks = |f: &&Finding| lacking.contains(&f.status) && !f.minor && f.contradicted.is_none();
    findings.iter().filter(lacks).collect()
}

/// Name of a finding in the middle of a sentence.
pub fn called(finding: &Finding) -> String {
    let what = match finding.statistic {
        Statistic::Bias => "an unexplained bias",
        Statistic::Variance => "unexplained noise",
        Statistic::Dropout => "an unexplained loss",
        _ => "an unexplained error",
    };
    let unnamed = || format!("{what} {}", along(finding.axis));
    match finding.status {
        Status::OneOf if finding.alternatives.len() > 1 => {
            let likely = finding.alternatives.iter().enumerate();
            let likely = likely
                .filter(|(i, a)| *i < 2 || a.probability.is_some_and(|p| p >= MIN_PROBABILITY));
            join(&likely.map(|(_, a)| title(a.effect).into()).collect::<Vec<_>>(), "or")
        }
        Status::Unexplained => finding.contradicted.map_or_else(unnamed, against),
        Status::Recalibrate => "parameters that are off".into(),
        _ => finding.effect.map_or_else(unnamed, |id| title(id).into()),
    }
}

fn against(id: &'static str) -> String {
    format!("{}, which the recording contradicts", title(id))
}

/// The axis of a change, worded to follow its name.
pub(super) fn along(axis: Axis) -> String {
    match axis {
        Axis::Pixel => "from pixel to pixel".into(),
        other => format!("over the {}", self::axis(other)),
    }
}

/// CSS class and text of a finding's badge.
pub(super) fn badge(finding: &Finding) -> (&'static str, &'static str) {
    match finding.status {
        _ if finding.contradicted.is_some() => ("bad", "not in the recording"),
        Status::Named => ("good", "effect named"),
        Status::OneOf => ("unsure", "one of several"),
        Status::Unexplained => ("bad", "measured, not in the catalogue"),
        Status::Recalibrate => ("bad", "calibrate again"),
        Status::NotIdentifiable => ("unsure", "cannot be seen here"),
    }
}

pub(super) fn axis(axis: Axis) -> &'static str {
    axis.in_words()
}

/// The statistic that differs from the model, in words.
pub(super) fn statistic(statistic: Statistic) -> &'static str {
    match statistic {
        Statistic::Bias => "mean depth",
        Statistic::Variance => "noise level",
        Statistic::Distribution => "distribution of the noise",
        Statistic::Correlation => "correlation of the noise",
        Statistic::Dropout => "pixels without depth",
    }
}

/// An interval of an axis in everyday units.
pub(super) fn interval(axis: Axis, [low, high]: [f64; 2], unit: &str) -> String {
    // What was not measured along an axis has no place on it.
    if !(low.is_finite() && high.is_finite()) || [low, high] == [0.0; 2] {
        return "over its whole range".into();
    }
    let other = format!(" {unit}");
    let (scale, unit) = match unit {
        "m" if axis == Axis::TargetPosition => (1e3, " mm"),
        "m" => (1.0, " m"),
        "rad" => (1f64.to_degrees(), "°"),
        "s" if high >= MINUTES_FROM_S => (1.0 / SECONDS_A_MINUTE, " min"),
        "degrees Celsius" => (1.0, " °C"),
        "sigma" => (1.0, " σ"),
        "of the median" => (1.0, " times the median"),
        "periods" => (1.0, " of a step"),
        "" | "1" => (1.0, ""),
        _ => (1.0, other.as_str()),
    };
    let decimals = decimals_for(scale * (high - low).abs());
    let [low, high] = [low, high].map(|v| fixed(scale * v, decimals));
    if low == high { format!("{low}{unit}") } else { format!("{low} to {high}{unit}") }
}

/// Whether the two halves of the views agree on a finding, in words.
pub(super) fn halves(replicated: Option<bool>) -> &'static str {
    match replicated {
        Some(true) => "Both show it alike",
        Some(false) => "They do not agree: either one lacks it, or their sizes differ",
        None => "Not tested",
    }
}

/// A size that already is in mm.
pub(super) fn mm(value: f64) -> String {
    format!("{} mm", millimetres(1e-3 * value))
}

/// A p-value in words.
pub(super) fn chance(p: Option<f64>) -> String {
    let Some(p) = p else { return "no test gave a p-value".into() };
    let often = match p {
        _ if p < 1e-6 => "less than once in a million recordings".into(),
        _ if p > 0.5 => "more often than not".into(),
        _ => format!("about once in {} recordings", thousands(1.0 / p)),
    };
    format!("chance alone does this {often}")
}

/// A number to two digits, with a comma at the thousands.
fn thousands(value: f64) -> String {
    let unit = 10f64.powf((value.log10().floor() - 1.0).max(0.0));
    let mut digits = format!("{:.0}", (value / unit).round() * unit);
    let commas = (3..digits.len()).step_by(3).map(|k| digits.len() - k).collect::<Vec<usize>>();
    commas.into_iter().for_each(|at| digits.insert(at, ','));
    digits
}

/// Joins items as in `a, b and c`.
pub(super) fn join(items: &[String], last: &str) -> String {
    match items {
        [] => String::new(),
        [one] => one.clone(),
        [head @ .., tail] => format!("{} {last} {tail}", head.join(", ")),
    }
}

pub(super) fn capital(words: &str) -> String {
    let mut chars = words.chars();
    chars.next().map_or_else(String::new, |c| c.to_uppercase().chain(chars).collect())
}

/// Capitalises the words and ends them with a full stop.
pub(super) fn sentence(words: &str) -> String {
    let words = capital(words.trim());
    if words.is_empty() || words.ends_with(['.', '!', '?']) { words } else { words + "." }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_have_peoples_units() {
        for (at, ends, unit, text) in [
            (Axis::Z, [0.8, 3.204], "m", "0.8 to 3.2 m"),
            (Axis::TargetPosition, [-0.4, 0.4], "m", "−400 to 400 mm"),
            (Axis::Theta, [0.0, 0.698_132], "rad", "0 to 40°"),
            (Axis::Radius, [120.0, 398.4], "px", "120 to 398 px"),
            (Axis::SessionTime, [0.0, 1260.0], "s", "0 to 21 min"),
            (Axis::DisparityPhase, [0.0, 0.5], "periods", "0.00 to 0.50 of a step"),
            (Axis::Row, [f64::NEG_INFINITY, 3.0], "px", "over its whole range"),
        ] {
            assert_eq!(interval(at, ends, unit), text);
        }
    }

    #[test]
    fn titles_fit_into_a_sentence() {
        for effect in effects::CATALOGUE {
            for words in [effect.card().title, effect.card().summary] {
                assert!(!words.ends_with('.') && words.starts_with(char::is_lowercase), "{words}");
            }
        }
        assert_eq!(title("not-yet"), "not-yet");
    }

    #[test]
    fn chances_are_in_times() {
        assert!(chance(Some(0.0004)).contains("once in 2,500 recordings"));
        assert!(chance(Some(0.0)).contains("less than once in a million"));
        assert!(chance(None).starts_with("no test"));
        assert_eq!([thousands(12_345.0), thousands(990_000.0)], ["12,000", "990,000"]);
        assert_eq!(join(&["a", "b", "c"].map(String::from), "and"), "a, b and c");
    }
}
