//! Axes, intervals, chances: as people say them.

use maud::{Markup, html};

use crate::report::numbers::{fixed, significant};
use crate::terms::{Axis, Statistic};

/// Below this a chance is not told to the digit.
const MIN_P: f64 = 1e-6;
/// From here on times are told in minutes, s.
const MINUTES_FROM_S: f64 = 180.0;
const SECONDS_A_MINUTE: f64 = 60.0;
const MAX_DECIMALS: i32 = 4;

pub(super) fn axis(axis: Axis) -> &'static str {
    match axis {
        Axis::Z => "distance from the sensor",
        Axis::DisparityPhase => "place between two steps of the matcher",
        Axis::Column => "column of the picture",
        Axis::Row => "row of the picture",
        Axis::Radius => "distance from the middle of the picture",
        Axis::Pixel => "place in the picture",
        Axis::Theta => "slant of the board",
        Axis::Azimuth => "direction of the slant",
        Axis::TargetPosition => "place on the board",
        Axis::EdgeDistance => "distance from the board's edge",
        Axis::Intensity => "brightness in infrared",
        Axis::Frame => "time within a view",
        Axis::SessionTime => "time since the session began",
        Axis::Temperature => "temperature",
        Axis::PixelLag => "distance between two pixels",
        Axis::Residual => "size of the error itself",
    }
}

/// What of a reading is not as simulated.
pub(super) fn statistic(statistic: Statistic) -> &'static str {
    match statistic {
        Statistic::Bias => "depth itself",
        Statistic::Variance => "amount of noise",
        Statistic::Distribution => "shape of the noise",
        Statistic::Correlation => "how noise hangs together",
        Statistic::Dropout => "pixels without depth",
    }
}

/// A stretch of an axis, in units people use.
pub(super) fn interval(axis: Axis, [low, high]: [f64; 2], unit: &str) -> String {
    if !(low.is_finite() && high.is_finite()) {
        return "over its whole range".into();
    }
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
        other => return format!("{} {other}", stretch(low, high)),
    };
    format!("{}{unit}", stretch(scale * low, scale * high))
}

/// With the decimals that tell its ends apart to a percent of its length.
fn stretch(low: f64, high: f64) -> String {
    let decimals = decimals_for((high - low).abs());
    let [low, high] = [low, high].map(|v| fixed(v, decimals));
    if low == high { low } else { format!("{low} to {high}") }
}

/// Decimals that keep two digits of `value`.
pub(super) fn decimals_for(value: f64) -> usize {
    if !(value.is_finite() && value > 0.0) {
        return 2;
    }
    (1 - value.log10().floor() as i32).clamp(0, MAX_DECIMALS) as usize
}

/// Millimetres that already are millimetres.
pub(super) fn mm(value: f64) -> String {
    let size = value.abs();
    let decimals = if size < 0.1 { 3 } else { 2 - usize::from(size >= 10.0) };
    format!("{} mm", fixed(value, decimals))
}

pub(super) fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    let decimals = usize::from(percent > 99.0 && percent < 100.0 || percent > 0.0 && percent < 1.0);
    format!("{} %", fixed(percent, decimals))
}

/// `p = 0.012`, with its sign.
pub(super) fn p_value(p: f64) -> Markup {
    html! {
        @if p < MIN_P { "p < 10" sup { "−6" } }
        @else { "p = " (significant(p, if p < 1e-3 { 1 } else { 2 })) }
    }
}

/// What a p-value means.
pub(super) fn chance(p: f64) -> String {
    if p.is_nan() {
        return "how often chance alone would look like this is not known".into();
    }
    if p < MIN_P {
        return "chance alone would look like this less than once in a million times".into();
    }
    if p > 0.5 {
        return "chance alone looks like this more often than not".into();
    }
    format!("chance alone would look like this about once in {} times", thousands(1.0 / p))
}

/// To two digits, with a thin mark at the thousands.
fn thousands(value: f64) -> String {
    let unit = 10f64.powf((value.log10().floor() - 1.0).max(0.0));
    let digits = format!("{:.0}", (value / unit).round() * unit);
    let mut out = String::new();
    for (i, c) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(c);
    }
    out
}

/// Small numbers as words.
pub(super) fn count(n: usize, noun: &str) -> String {
    const WORDS: [&str; 10] =
        ["no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine"];
    let n_words = WORDS.get(n).map_or_else(|| n.to_string(), ToString::to_string);
    format!("{n_words} {noun}{}", if n == 1 { "" } else { "s" })
}

/// `a, b and c`.
pub(super) fn list(items: &[String], last: &str) -> String {
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
    fn chances_are_told_in_times() {
        assert!(chance(0.0004).contains("once in 2,500 times"));
        assert!(chance(0.0).contains("less than once in a million"));
        assert_eq!(p_value(0.0004).into_string(), "p = 4·10<sup>−4</sup>");
        assert_eq!(p_value(0.31).into_string(), "p = 0.31");
        assert_eq!(percent(0.995), "99.5 %");
        assert_eq!(percent(1.0), "100 %");
    }

    #[test]
    fn lists_end_in_a_word() {
        let items = ["a", "b", "c"].map(String::from);
        assert_eq!(list(&items, "and"), "a, b and c");
        assert_eq!(list(&items[..1], "or"), "a");
        assert_eq!(count(2, "cause"), "two causes");
    }
}
