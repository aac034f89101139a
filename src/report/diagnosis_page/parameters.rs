//! Parameters: numbers with errors and units, from the names they have in files.

use maud::{Markup, html};
use serde_json::Value;

use super::words::decimals_for;
use crate::effects;
use crate::report::numbers::{fixed, significant};

/// How a name's ending tells the unit: the ending, what the number is multiplied by, the unit.
/// Longer endings first.
const UNITS: [(&str, f64, &str); 7] = [
    ("_mps", 1e3, " mm/s"),
    ("_deg", 1.0, "°"),
    ("_rad", 57.295_779_513_082_32, "°"),
    ("_px", 1.0, " px"),
    ("_mm", 1.0, " mm"),
    ("_m", 1.0, " m"),
    ("_s", 1.0, " s"),
];
/// Lengths below it are told in mm, m.
const MILLIMETRES_BELOW_M: f64 = 0.3;
pub(super) const DIGITS: usize = 3;
const ERROR_DIGITS: usize = 2;
/// Values below it are easier with powers of ten.
const MIN_PLAIN: f64 = 1e-3;

/// `0.125 ± 0.001 px`, or to so many digits where the error is not known; whatever else stands in
/// the file is shown as it is.
pub(super) fn value(name: &str, value: &Value, digits: usize) -> Markup {
    let number = |key: &str| value.get(key).and_then(Value::as_f64);
    let Some(v) = value.as_f64().or_else(|| number("value")) else {
        return match value.as_str() {
            Some(text) => html! { (text) },
            None => html! { (value.to_string()) },
        };
    };
    let (scale, unit) = unit(name, v);
    match number("std_error") {
        Some(e) => html! { (with_error(scale * v, scale * e)) (unit) },
        None => html! { (significant(scale * v, digits)) (unit) },
    }
}

fn unit(name: &str, value: f64) -> (f64, &'static str) {
    let known = UNITS.iter().find(|(ending, _, _)| name.ends_with(ending));
    match known {
        Some(("_m", _, _)) if value.abs() < MILLIMETRES_BELOW_M => (1e3, " mm"),
        Some((_, scale, unit)) => (*scale, unit),
        None => (1.0, ""),
    }
}

fn with_error(value: f64, error: f64) -> Markup {
    if error.is_nan() || error <= 0.0 || value.abs().max(error) < MIN_PLAIN {
        return html! { (significant(value, DIGITS)) " ± " (significant(error, ERROR_DIGITS)) };
    }
    let decimals = decimals_for(error);
    html! { (fixed(value, decimals)) " ± " (fixed(error, decimals)) }
}

/// What the catalogue says a parameter is.
pub(super) fn words(effect: Option<&str>, name: &str) -> &'static str {
    let card = effect.and_then(effects::find).map(|e| e.card());
    let parameter = card.and_then(|c| c.parameters.iter().find(|p| p.name == name));
    parameter.map_or("", |p| p.summary)
}

/// A parameter's name without its unit: `amplitude_px` is an amplitude.
pub(super) fn title(name: &str) -> String {
    let ending = UNITS.iter().find(|(ending, _, _)| name.ends_with(ending));
    let bare = ending.map_or(name, |(ending, _, _)| &name[..name.len() - ending.len()]);
    bare.replace('_', " ")
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
            ("tilt_rad", json!(0.5), "28.6°"),
            (
                "k1",
                json!({"value": -2e-5, "std_error": 3e-6}),
                "−2.00·10<sup>−5</sup> ± 3.0·10<sup>−6</sup>",
            ),
            ("form", json!("a < b"), "a &lt; b"),
        ] {
            assert_eq!(value(name, &json, DIGITS).into_string(), text);
        }
        assert_eq!(title("time_constant_s"), "time constant");
        assert_eq!(
            words(Some("target-bow"), "span_m"),
            "width of the board over which it is counted"
        );
    }
}
