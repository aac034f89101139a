//! The power curve of every cause, small.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use maud::{Markup, PreEscaped, html};

use super::power::{Line, line_of};
use super::words::name;
use crate::{Cell, ProvenSet};

const WIDTH: f64 = 170.0;
const HEIGHT: f64 = 84.0;
const LEFT: f64 = 26.0;
const RIGHT: f64 = 8.0;
const TOP: f64 = 8.0;
const BOTTOM: f64 = 18.0;
/// Nats at both ends.
const ENDS: [f64; 2] = [4.0, 6300.0];
const TICKS: [f64; 4] = [5.0, 50.0, 500.0, 5000.0];

pub(super) fn section(sets: &[ProvenSet]) -> Markup {
    let mut causes: BTreeMap<(bool, &str), Vec<&ProvenSet>> = BTreeMap::new();
    for set in sets {
        let single = matches!(set.truth.asked.cell, Cell::Single | Cell::Outside);
        if let (true, [one]) = (single, &set.truth.hidden[..]) {
            causes.entry((one.names.is_empty(), name(one))).or_default().push(set);
        }
    }
    html! {
        details open {
            summary { "Each cause by itself (" (causes.len()) ")" }
            p.note {
                span.dot {} " detected, with its 95 % band; " span.ring {} " first name right (for causes outside the catalogue: rightly called \
                 unexplained). Up: 0 to 100 %; across: 5 to 5000 nats. A handful of sets each: the bands are wide, and no single curve proves anything."
            }
            div.multiples { @for ((outside, name), sets) in &causes { (multiple(name, *outside, sets)) } }
        }
    }
}

fn multiple(name: &str, outside: bool, sets: &[&ProvenSet]) -> Markup {
    let answer = if outside { "abstained" } else { "first_name" };
    let [detected, named] = ["detected", answer].map(|m| line_of(sets.iter().copied(), m));
    html! {
        figure {
            figcaption { @if outside { "outside: " } (name) " (" (sets.len()) ")" }
            (PreEscaped(svg(&detected, &named)))
        }
    }
}

fn across(nats: f64) -> f64 {
    let share = (nats / ENDS[0]).ln() / (ENDS[1] / ENDS[0]).ln();
    LEFT + share * (WIDTH - LEFT - RIGHT)
}

fn up(share: f64) -> f64 {
    HEIGHT - BOTTOM - share * (HEIGHT - TOP - BOTTOM)
}

/// Numbers only: nothing to escape.
fn svg(detected: &Line, named: &Line) -> String {
    let mut out =
        format!("<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" class=\"tiny\" aria-hidden=\"true\">");
    for share in [0.0, 0.5, 1.0] {
        let y = up(share);
        let (right, label) = (WIDTH - RIGHT, 100.0 * share);
        let _ = write!(
            out,
            "<path class=\"g\" d=\"M{LEFT} {y}H{right}\"/><text x=\"22\" y=\"{:.1}\" text-anchor=\"end\">{label}</text>",
            y + 3.0
        );
    }
    for nats in TICKS {
        let _ = write!(
            out,
            "<text x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\">{nats}</text>",
            across(nats),
            HEIGHT - 5.0
        );
    }
    let at = |nats: f64, share: f64| format!("{:.1} {:.1}", across(nats), up(share));
    let low = detected.iter().map(|(n, r)| at(*n, r.interval[0]));
    let high = detected.iter().rev().map(|(n, r)| at(*n, r.interval[1]));
    let band: Vec<String> = low.chain(high).collect();
    if detected.len() > 1 {
        let _ = write!(out, "<path class=\"b\" d=\"M{}Z\"/>", band.join("L"));
    } else if let [low, high] = &band[..] {
        let _ = write!(out, "<path class=\"i\" d=\"M{low}L{high}\"/>");
    }
    for (line, class) in [(detected, "d"), (named, "n")] {
        let points: Vec<String> = line.iter().map(|(n, r)| at(*n, r.rate)).collect();
        if points.len() > 1 {
            let _ = write!(out, "<path class=\"{class}\" d=\"M{}\"/>", points.join("L"));
        }
        let radius = if class == "d" { 3.0 } else { 4.2 };
        for (nats, rate) in line {
            let (x, y) = (across(*nats), up(rate.rate));
            let _ = write!(
                out,
                "<circle class=\"{class}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\"/>"
            );
        }
    }
    out + "</svg>"
}
