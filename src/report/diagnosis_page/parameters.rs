//! Formats the parameters of findings with errors and units, taken from their names in files.

use maud::{Markup, html};
use serde_json::Value;

use crate::effects::{self, Parameter};
use crate::report::numbers::{decimals_for, fixed, significant, with_error};

/// Units by the ending of a name: ending, factor to that unit, unit. Longer endings come first.
const UNITS: [(&str, f64, &str); 7] = [
    ("_mps", 1e3, " mm/s"),
    ("_deg", 1.0, "°"),
    ("_rad", 1f64.to_degrees(), "°"),
    ("_px", 1.0, " px"),
    ("_mm", 1.0, " mm"),
    ("_m", 1.0, " m"),
    ("_s", 1.0, " s"),
];
/// Lengths below this are given in mm, m.
const MILLIMETRES_BELOW_M: f64 = 0.3;

/// Half-width of a Gaussian's 90 % interval, in standard errors.
const NINETY_PERCENT: f64 = 1.645;

/// How well a number is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Known {
    /// Without a standard error.
    Bare(f64),
    /// With its standard error.
    Within(f64, f64),
    /// An upper bound, because its 90 % interval reaches zero; at most what the catalogue allows.
    UpTo(f64),
}

pub(super) fn known(effect: Option<&str>, name: &str, value: &Value) -> Option<Known> {
    let (name, _) = split(name);
    let number = |key: &str| value.get(key).and_then(Value::as_f64);
    let v = value.as_f64().or_else(|| number("value"))?;
    Some(match number("std_error") {
        None => Known::Bare(v),
        Some(e) if NINETY_PERCENT * e < v.abs() => Known::Within(v, e),
        Some(e) => {
            let [low, high] = parameter(effect, name).map_or([f64::MIN, f64::MAX], |p| p.range);
            Known::UpTo((v + (NINETY_PERCENT * e).copysign(v)).max(low).min(high))
        }
    })
}

/// `0.1250 ± 0.0010 px`, `up to 0.59 px`, or the value to `digits` where its error is not known. Anything
/// else in the file is shown as it is.
pub(super) fn value(effect: Option<&str>, name: &str, value: &Value, digits: usize) -> Markup {
    let (name, _) = split(name);
    let Some(known) = known(effect, name, value) else {
        return html! { (value.as_str().map_or_else(|| value.to_string(), str::to_string)) };
    };
    let (Known::Bare(v) | Known::Within(v, _) | Known::UpTo(v)) = known;
    let (scale, unit) = match UNITS.iter().find(|(ending, ..)| name.ends_with(ending)) {
        Some(("_m", ..)) if v.abs() < MILLIMETRES_BELOW_M => (1e3, " mm"),
        Some((_, scale, unit)) => (*scale, *unit),
        None => (1.0, ""),
    };
    match known {
        Known::Bare(v) => html! { (significant(scale * v, digits)) (unit) },
        Known::Within(v, e) => html! { (with_error(scale * v, scale * e)) (unit) },
        Known::UpTo(v) => html! { "up to " (significant(scale * v, 2)) (unit) },
    }
}

/// Largest relative error for which two digits alone show how well a number is known.
const CLEAR: f64 = 0.1;

/// The parameter by its name in files, for a sentence; `None` if it was not estimated.
pub(super) fn brief(effect: Option<&str>, name: &str, value: &Value) -> Option<String> {
    value.get("value")?;
    let digits = |x: f64| fixed(x, decimals_for(x.abs()));
    Some(match known(effect, name, value)? {
        Known::Within(v, e) if e > CLEAR * v.abs() => {
            format!("{name} {} ± {}", digits(v), digits(e))
        }
        Known::Bare(v) | Known::Within(v, _) => format!("{name} {}", digits(v)),
        Known::UpTo(v) => format!("{name} up to {}", digits(v)),
    })
}

fn parameter(effect: Option<&str>, name: &str) -> Option<&'static Parameter> {
    effect.and_then(effects::find)?.card().parameters.iter().find(|p| p.name == name)
}

/// The catalogue's description of a parameter.
pub(super) fn description(effect: Option<&str>, name: &str) -> &'static str {
    parameter(effect, name).map_or("", |p| p.summary)
}

/// Splits `z50_m, near side` into the key and the rest from the comma on.
fn split(name: &str) -> (&str, &str) {
    name.find(',').map_or((name, ""), |at| name.split_at(at))
}

/// A parameter's name without its unit: `amplitude_px` becomes `amplitude`.
pub(super) fn title(name: &str) -> String {
    let (name, rest) = split(name);
    let bare = UNITS.iter().find_map(|(ending, ..)| name.strip_suffix(ending));
    bare.unwrap_or(name).replace('_', " ") + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn numbers_with_errors_and_units() {
        for (name, json, text) in [
            ("step_px", json!({"value": 0.125, "std_error": 0.001}), "0.1250 ± 0.0010 px"),
            ("sagitta_m", json!({"value": 0.00412, "std_error": 0.0003}), "4.12 ± 0.30 mm"),
            ("z50_m", json!(3.2), "3.20 m"),
            ("width_m", json!({"value": 0.1, "std_error": 0.3}), "up to 0.59 m"),
            ("width_m", json!({"value": -1.5, "std_error": 3.0}), "up to −2.0 m"),
            ("width_m", json!({"value": 0.0, "std_error": 0.01}), "up to 16 mm"),
            ("tilt_rad", json!(0.5), "28.6°"),
            ("form", json!("a < b"), "a &lt; b"),
        ] {
            assert_eq!(value(Some("range-dropout"), name, &json, 3).into_string(), text);
        }
        assert_eq!(title("time_constant_s"), "time constant");
        assert_eq!(title("z50_m, near side"), "z50, near side");
        assert_eq!(value(None, "z50_m, near side", &json!(0.481), 2).into_string(), "0.48 m");
        let span = description(Some("target-bow"), "span_m");
        assert_eq!(span, "width of the board over which it is counted");
    }

    #[test]
    fn a_sentence_claims_no_more_digits_than_are_known() {
        for (value, text) in [
            (json!({"value": 0.31, "std_error": 0.01}), Some("k_px 0.31")),
            (json!({"value": 0.31, "std_error": 0.1}), Some("k_px 0.31 ± 0.10")),
            (json!({"value": 0.31, "std_error": 0.9}), Some("k_px up to 1.8")),
            (json!({"value": 0.31, "std_error": null}), Some("k_px 0.31")),
            (json!(0.31), None),
        ] {
            assert_eq!(brief(Some("radial-disparity-bias"), "k_px", &value).as_deref(), text);
        }
    }
}
