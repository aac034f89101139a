//! Rates, kinds of sets and strengths in words.

use serde::Serialize;

use crate::{Cell, Hidden, Rate, Truth, World};
use kinoise::report::numbers::fixed;

/// Shares below a tenth, and those close to all, get a decimal.
const FINE: f64 = 0.1;

pub(super) fn percent(share: f64) -> String {
    format!("{}\u{a0}%", bare_percent(share))
}

/// Without its sign.
fn bare_percent(share: f64) -> String {
    let near_an_end = share > 0.0 && share < FINE || share > 1.0 - FINE && share < 1.0;
    let fine = fixed(100.0 * share, 1);
    match fine.strip_suffix(".0") {
        Some("0" | "100") | None if near_an_end => fine,
        _ => fixed(100.0 * share, 0),
    }
}

/// `0.3 to 48 %`.
pub(super) fn percents([low, high]: [f64; 2]) -> String {
    format!("{} to {}", bare_percent(low), percent(high))
}

/// `0.3–48`, where the head says that it is percent.
pub(super) fn bare_percents(ends: [f64; 2]) -> String {
    ends.map(bare_percent).join("–")
}

pub(super) fn count(n: usize, noun: &str) -> String {
    format!("{n} {noun}{}", if n == 1 { "" } else { "s" })
}

pub(super) fn of(rate: &Rate) -> String {
    format!("{} of {}", rate.k, rate.n)
}

/// A number over the oracle's, or an error.
pub(super) fn ratio(value: f64) -> String {
    let text = fixed(value, 2);
    if text == "−0.00" { "0.00".into() } else { text }
}

/// The word that a file has for it.
pub(super) fn word(of: impl Serialize) -> String {
    serde_json::to_value(of).ok().and_then(|v| v.as_str().map(String::from)).unwrap_or_default()
}

pub(super) fn world(world: World) -> &'static str {
    match world {
        World::Rays => "rays (S1)",
        World::Light => "light (S2)",
        World::Real => "real recordings (S3)",
    }
}

pub(super) fn cell(cell: Cell) -> &'static str {
    match cell {
        Cell::Null => "nothing hidden",
        Cell::Drift => "the unit's noise has changed",
        Cell::Single => "one cause",
        Cell::Pair => "two causes",
        Cell::Triple => "three causes",
        Cell::Outside => "outside the catalogue",
        Cell::Blind => "what planes cannot show",
        Cell::Referenced => "the same, with a reference distance",
        Cell::Mimic => "beside a cause that mimics it",
        Cell::FewViews => "in a few views only",
        Cell::Region => "in one region only",
        Cell::Far => "past one distance only",
        Cell::Late => "late in the session only",
        Cell::Amnesia => "a needed term struck out",
        Cell::Transplant => "added to real residuals",
        Cell::Halves => "halves of one recording",
    }
}

/// The name of a cause, or the form of one that the catalogue lacks.
pub(super) fn name(hidden: &Hidden) -> &str {
    hidden.names.first().unwrap_or(&hidden.form)
}

/// Nats of the strongest hidden cause: what its world reached, else what was ordered.
pub(super) fn strongest(truth: &Truth) -> Option<f64> {
    let nats = truth.hidden.iter().filter_map(|h| h.nats.or(truth.asked.nats));
    nats.filter(|n| *n > 0.0).reduce(f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_near_an_end_keep_a_decimal() {
        for (share, text) in [
            (0.0, "0 %"),
            (0.0281, "2.8 %"),
            (0.02, "2 %"),
            (0.5, "50 %"),
            (0.111, "11 %"),
            (0.9953, "99.5 %"),
            (0.9496, "95 %"),
            (0.9999, "100.0 %"),
            (1.0, "100 %"),
            (f64::NAN, "– %"),
        ] {
            assert_eq!(percent(share).replace('\u{a0}', " "), text);
        }
        assert_eq!((ratio(-1e-9), ratio(-0.5)), ("0.00".into(), "−0.50".into()));
    }
}
