//! Numbers as people read them, with Unicode's minus and powers of ten.

use maud::{Markup, PreEscaped, html};

pub const MM: f64 = 1e3;
pub const ABSENT: &str = "–";
/// Beyond these, powers of ten are easier to read.
const PLAIN: std::ops::Range<f64> = 1e-3..1e5;

/// A fixed number of decimals.
pub fn fixed(value: f64, decimals: usize) -> String {
    if value.is_finite() {
        crate::units::decimals(value, decimals).replace('-', "−")
    } else {
        ABSENT.into()
    }
}

/// Metres as millimetres, to about three digits.
pub fn millimetres(metres: f64) -> String {
    let decimals = if metres.abs() * MM < 10.0 { 2 } else { 1 };
    fixed(metres * MM, decimals)
}

pub fn degrees(radians: f64) -> String {
    fixed(radians.to_degrees(), 1)
}

/// `low – high`, or one number where they print alike.
pub fn range([low, high]: [f64; 2], decimals: usize) -> String {
    let [low, high] = [low, high].map(|v| fixed(v, decimals));
    if low == high { low } else { format!("{low} – {high}") }
}

/// To `digits` significant digits, with a power of ten where that helps.
pub fn significant(value: f64, digits: usize) -> Markup {
    if value == 0.0 || !value.is_finite() {
        return html! { (fixed(value, 0)) };
    }
    let scientific = format!("{value:.*e}", digits.saturating_sub(1));
    let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    if PLAIN.contains(&value.abs()) {
        let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
        return html! { (fixed(value, decimals)) };
    }
    let [mantissa, exponent] = [mantissa, &exponent.to_string()].map(|t| t.replace('-', "−"));
    html! { (mantissa) "·10" sup { (exponent) } }
}

/// A formula in the notation of [`crate::model::SigmaForm::formula`], for the eye; names that
/// `value` knows are replaced by their numbers.
pub fn formula(text: &str, value: &dyn Fn(&str) -> Option<f64>) -> Markup {
    let mut out = String::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let end = rest.find(|c: char| !c.is_alphanumeric()).unwrap_or(rest.len());
        let length = if end == 0 { first.len_utf8() } else { end };
        let (token, after) = rest.split_at(length);
        rest = after;
        if token == "^" {
            let end = rest.find(|c: char| !c.is_alphanumeric()).unwrap_or(rest.len());
            let (power, after) = rest.split_at(end);
            rest = after;
            out.push_str(&html! { sup { (word(power, value)) } }.into_string());
        } else {
            out.push_str(&word(token, value).into_string());
        }
    }
    PreEscaped(out)
}

fn word(token: &str, value: &dyn Fn(&str) -> Option<f64>) -> Markup {
    const DIGITS: usize = 4;
    match (value(token), token) {
        (Some(v), _) if v < 0.0 => html! { "(" (significant(v, DIGITS)) ")" },
        (Some(v), _) => significant(v, DIGITS),
        (None, "sigma") => html! { i { "σ" } },
        (None, "theta") => html! { i { "θ" } },
        (None, "pi") => html! { "π" },
        (None, "sqrt") => html! { "√" },
        (None, "*") => html! { "·" },
        (None, "-") => html! { "−" },
        (None, t) if t.chars().all(char::is_alphabetic) && t.len() <= 2 => html! { i { (t) } },
        (None, t) => html! { (t) },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn significant_digits() {
        for (value, text) in [
            (0.0, "0"),
            (1.395, "1.40"),
            (-0.8123, "−0.812"),
            (1.39e-9, "1.39·10<sup>−9</sup>"),
            (123.4, "123"),
            (f64::NAN, "–"),
        ] {
            assert_eq!(significant(value, 3).into_string(), text);
        }
    }

    #[test]
    fn ranges_and_units() {
        assert_eq!(range([0.501, 3.54], 2), "0.50 – 3.54");
        assert_eq!(range([1.0, 1.001], 2), "1.00");
        assert_eq!(millimetres(0.00231), "2.31");
        assert_eq!(millimetres(0.0231), "23.1");
        assert_eq!(degrees(std::f64::consts::PI), "180.0");
    }

    #[test]
    fn a_formula_gets_its_numbers() {
        let value = |name: &str| match name {
            "k" => Some(0.001_425),
            "c" => Some(-0.5),
            _ => None,
        };
        assert_eq!(
            formula("sigma = k z^2 * (z - c) < 1", &value).into_string(),
            "<i>σ</i> = 0.001425 <i>z</i><sup>2</sup> · (<i>z</i> − (−0.5000)) &lt; 1"
        );
    }
}
