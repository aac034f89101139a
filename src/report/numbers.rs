//! Formats numbers for readers, with Unicode's minus and powers of ten.

use maud::{Markup, html};

pub(super) const MM: f64 = 1e3;
pub(super) const ABSENT: &str = "–";
/// Range written without a power of ten.
const PLAIN: std::ops::Range<f64> = 1e-3..1e5;
/// p-values below this are given as a bound.
const MIN_P: f64 = 1e-6;

/// A number with a fixed number of decimals.
pub(super) fn fixed(value: f64, decimals: usize) -> String {
    if value.is_finite() {
        crate::units::decimals(value, decimals).replace('-', "−")
    } else {
        ABSENT.into()
    }
}

/// Metres as millimetres, to about three digits.
pub(super) fn millimetres(metres: f64) -> String {
    let mm = metres * MM;
    let decimals = [0.1, 10.0].iter().filter(|below| mm.abs() < **below).count();
    fixed(mm, 1 + decimals)
}

pub(super) fn degrees(radians: f64) -> String {
    fixed(radians.to_degrees(), 1)
}

/// A percentage, with a decimal where it is needed to tell it from 0 or 100 %.
pub(super) fn percent(share: f64) -> String {
    if share > 0.0 && share < 0.0005 {
        return "less than 0.1 %".into();
    }
    let near_an_end = |share: f64| share > 0.0 && share < 0.01;
    let decimals = usize::from(near_an_end(share) || near_an_end(1.0 - share));
    // Less than all must not read as 100 %.
    let shown = if share < 1.0 { share.min(0.999) } else { share };
    format!("{} %", fixed(100.0 * shown, decimals))
}

/// `low – high`, or one number where both print alike.
pub(super) fn range([low, high]: [f64; 2], decimals: usize) -> String {
    let [low, high] = [low, high].map(|v| fixed(v, decimals));
    if low == high { low } else { format!("{low} – {high}") }
}

/// A gain in nats and the ends of its interval; from a million on in millions.
pub(super) fn nats(values: [f64; 3]) -> [String; 3] {
    let decimals = usize::from(values[0].abs() < 10.0);
    values.map(|v| {
        if v.abs() >= 1e6 { format!("{} million", fixed(1e-6 * v, 1)) } else { fixed(v, decimals) }
    })
}

/// Number of decimals that keeps two digits of `value`, at most seven.
pub(super) fn decimals_for(value: f64) -> usize {
    if !(value.is_finite() && value > 0.0) {
        return 2;
    }
    (1 - value.log10().floor() as i32).clamp(0, 7) as usize
}

/// A number to `digits` significant digits, with a power of ten where that helps.
pub(super) fn significant(value: f64, digits: usize) -> Markup {
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

/// `0.1250 ± 0.0010`: both to two digits of the error.
pub(super) fn with_error(value: f64, error: f64) -> Markup {
    if error.is_nan() || error <= 0.0 || value.abs().max(error) < PLAIN.start {
        return html! { (significant(value, 3)) " ± " (significant(error, 2)) };
    }
    let decimals = decimals_for(error);
    html! { (fixed(value, decimals)) " ± " (fixed(error, decimals)) }
}

/// `p = 0.012`, or `p < 10^−6`.
pub(super) fn p_value(p: f64) -> Markup {
    html! {
        @if p < MIN_P { "p < 10" sup { "−6" } }
        @else { "p = " (significant(p, if p < 1e-3 { 1 } else { 2 })) }
    }
}

/// `two causes`: a count with its noun, small numbers as words.
pub(super) fn count(n: usize, noun: &str) -> String {
    const WORDS: [&str; 10] =
        ["no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine"];
    let number = WORDS.get(n).map_or_else(|| n.to_string(), ToString::to_string);
    format!("{number} {noun}{}", if n == 1 { "" } else { "s" })
}

/// Typesets a formula in the notation of [`crate::model::SigmaForm::formula`]. Names that `value` knows are
/// replaced by their numbers.
pub(super) fn formula(text: &str, value: &dyn Fn(&str) -> Option<f64>) -> Markup {
    // Tokens are whole words and single other characters.
    let letters: Vec<char> = text.chars().collect();
    let tokens = letters.chunk_by(|a, b| a.is_alphanumeric() && b.is_alphanumeric());
    let tokens: Vec<String> = tokens.map(String::from_iter).collect();
    html! { @for (i, token) in tokens.iter().enumerate() {
        @if i > 0 && tokens[i - 1] == "^" { sup { (word(token, value)) } }
        @else if token != "^" { (word(token, value)) }
    } }
}

/// The same formula as a line of Python, to six digits: `sigma_m = 0.0014*z**2`.
pub(super) fn plain(text: &str, value: &dyn Fn(&str) -> Option<f64>) -> String {
    let (left, right) = text.split_once('=').unwrap_or(("sigma", text));
    let letters: Vec<char> = right.trim().chars().collect();
    let tokens = letters.chunk_by(|a, b| a.is_alphanumeric() && b.is_alphanumeric());
    let (mut plain, mut operand, mut power) = (String::new(), false, false);
    let short = |v: f64| format!("{v:.5e}").parse().unwrap_or(v);
    for token in tokens.map(String::from_iter) {
        let starts = token == "(" || token.chars().all(char::is_alphanumeric);
        if starts && operand && !power {
            // Juxtaposition means product.
            plain = plain.trim_end().to_string() + "*";
        }
        match (value(&token).map(short), token.as_str()) {
            (Some(v), _) if v < 0.0 => plain += &format!("({v})"),
            (Some(v), _) => plain += &v.to_string(),
            (None, "^") => plain += "**",
            (None, token) => plain += token,
        }
        if token != " " {
            operand = token == ")" || starts && token != "(" && token != "sqrt";
        }
        power = token == "^";
    }
    match left.contains("^2") {
        true => format!("sigma_m = sqrt({plain})"),
        false => format!("sigma_m = {plain}"),
    }
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
    fn what_views_are_worth() {
        assert_eq!(nats([4.25, -1.0, 9.0]), ["4.2", "−1.0", "9.0"]);
        assert_eq!(nats([48763.4, 3115.2, 132_750.1]), ["48763", "3115", "132750"]);
        assert_eq!(nats([5.79e7, 3115.0, 1.3e8]), ["57.9 million", "3115", "130.0 million"]);
    }

    #[test]
    fn ranges_and_units() {
        assert_eq!(range([0.501, 3.54], 2), "0.50 – 3.54");
        assert_eq!(range([1.0, 1.001], 2), "1.00");
        assert_eq!(millimetres(0.000_057), "0.057");
        assert_eq!(millimetres(0.00231), "2.31");
        assert_eq!(millimetres(-0.0231), "−23.1");
        assert_eq!(degrees(std::f64::consts::PI), "180.0");
        assert_eq!([0.995, 0.99996, 1.0].map(percent), ["99.5 %", "99.9 %", "100 %"]);
        assert_eq!([0.0, 0.0004, 0.004].map(percent), ["0 %", "less than 0.1 %", "0.4 %"]);
        assert_eq!(count(2, "cause"), "two causes");
    }

    #[test]
    fn errors_and_p_values() {
        assert_eq!(with_error(0.125, 0.001).into_string(), "0.1250 ± 0.0010");
        assert_eq!(with_error(0.0098371, 1.6e-5).into_string(), "0.009837 ± 0.000016");
        let tiny = "−2.00·10<sup>−5</sup> ± 3.0·10<sup>−6</sup>";
        assert_eq!(with_error(-2e-5, 3e-6).into_string(), tiny);
        assert_eq!(p_value(0.0004).into_string(), "p = 4·10<sup>−4</sup>");
        assert_eq!(p_value(0.31).into_string(), "p = 0.31");
        assert_eq!(p_value(0.0).into_string(), "p &lt; 10<sup>−6</sup>");
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
        for (text, expected) in [
            ("sigma = k z^2", "sigma_m = 0.001425*z**2"),
            (
                "sigma = k (z - c)^2 + c / sqrt(z) * theta^2",
                "sigma_m = 0.001425*(z - (-0.5))**2 + (-0.5) / sqrt(z) * theta**2",
            ),
            ("sigma^2 = k^2 + (k z^2)^2", "sigma_m = sqrt(0.001425**2 + (0.001425*z**2)**2)"),
            ("sigma = k z^c theta^2", "sigma_m = 0.001425*z**(-0.5)*theta**2"),
        ] {
            assert_eq!(plain(text, &value), expected);
        }
    }
}
