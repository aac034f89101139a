//! Parameters of findings: numbers with errors and units, from the names they have in files.

use maud::{Markup, html};
use serde_json::Value;

use crate::effects;
use crate::report::numbers::{significant, with_error};

/// How a name's ending gives the unit: the ending, what the number is multiplied by, the unit.
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
/// Lengths below it are in mm, m.
const MILLIMETRES_BELOW_M: f64 = 0.3;

/// `0.125 ± 0.001 px`, or to so many digits where the error is not known; whatever else stands in
/// the file is shown as it is.
pub(super) fn value(name: &str, value: &Value, digits: usize) -> Markup {
    let (name, _) = split(name);
    let number = |key: &str| value.get(key).and_then(Value::as_f64);
    let Some(v) = value.as_f64().or_else(|| number("value")) else {
        return html! { (value.as_str().map_or_else(|| value.to_string(), str::to_string)) };
    };
    let (scale, unit) = match UNITS.iter().find(|(ending, ..)| name.ends_with(ending)) {
        Some(("_m", ..)) if v.abs() < MILLIMETRES_BELOW_M => (1e3, " mm"),
        Some((_, scale, unit)) => (*scale, *unit),
        None => (1.0, ""),
    };
    match number("std_error") {
        Some(e) => html! { (with_error(scale * v, scale * e)) (unit) },
        None => html! { (significant(scale * v, digits)) (unit) },
    }
}

/// What the catalogue says a parameter is.
pub(super) fn description(effect: Option<&str>, name: &str) -> &'static str {
    let card = effect.and_then(effects::find).map(|e| e.card());
    let parameter = card.and_then(|c| c.parameters.iter().find(|p| p.name == name));
    parameter.map_or("", |p| p.summary)
}

/// The key, and what stands behind a comma: `z50_m, near side`.
fn split(name: &str) -> (&str, &str) {
    name.find(',').map_or((name, ""), |at| name.split_at(at))
}

/// A parameter's name without its unit: `amplitude_px` is an amplitude.
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
            ("tilt_rad", json!(0.5), "28.6°"),
            ("form", json!("a < b"), "a &lt; b"),
        ] {
            assert_eq!(value(name, &json, 3).into_string(), text);
        }
        assert_eq!(title("time_constant_s"), "time constant");
        assert_eq!(title("z50_m, near side"), "z50, near side");
        assert_eq!(value("z50_m, near side", &json!(0.481), 2).into_string(), "0.48 m");
        let span = description(Some("target-bow"), "span_m");
        assert_eq!(span, "width of the board over which it is counted");
    }
}
