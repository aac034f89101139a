//! Every rate by world and cell.

use std::collections::BTreeMap;

use maud::{Markup, html};

use super::words::{bare_percents, cell, word, world};
use crate::{Cell, Rate, Scores, World};

/// The marks with their heads; a rate of the last group is better small.
const COLUMNS: [(&str, &str); 15] = [
    ("ran", "ran"),
    ("detected", "de\u{ad}tected"),
    ("first_name", "first name right"),
    ("in_two", "right in two"),
    ("exact", "exact set"),
    ("axis", "right axis"),
    ("abstained", "ab\u{ad}stained"),
    ("said_blind", "said blind"),
    ("nothing_claimed", "nothing claimed"),
    ("recalibrate", "re\u{ad}calibrate"),
    ("after_clean", "clean after"),
    ("advice", "advice"),
    ("false_alarm", "false alarm"),
    ("masquerade", "mas\u{ad}querade"),
    ("confident_wrong", "sure and wrong"),
];

const WORLDS: [World; 3] = [World::Rays, World::Light, World::Real];
const CELLS: [Cell; 16] = [
    Cell::Null,
    Cell::Halves,
    Cell::Drift,
    Cell::Single,
    Cell::Pair,
    Cell::Triple,
    Cell::Outside,
    Cell::Blind,
    Cell::Referenced,
    Cell::Mimic,
    Cell::FewViews,
    Cell::Region,
    Cell::Far,
    Cell::Late,
    Cell::Amnesia,
    Cell::Transplant,
];

type Rates = BTreeMap<String, Rate>;

pub(super) fn section(scores: &Scores) -> Markup {
    html! {
        section {
            h2 { "All rates, by world and kind of set" }
            div.wide { table.small.rates {
                thead { tr {
                    th { "Sets" }
                    @for (_, head) in COLUMNS { th.n { (head) } }
                } }
                tbody {
                    (row("all", &scores.all, true))
                    @for w in WORLDS {
                        @if let Some(rates) = scores.by_world.get(&word(w)) { (row(world(w), rates, true)) }
                        @for c in CELLS {
                            @if let Some(rates) = scores.by_world_and_cell.get(&format!("{}/{}", word(w), word(c))) {
                                (row(cell(c), rates, false))
                            }
                        }
                    }
                }
            } }
            p.note {
                "k/n and, below it, the 95 % interval of Clopper and Pearson, in percent. Small numbers are better in the last three \
                 columns. Names, axes and two-name rates are of what was detected; abstention is of all. S1 draws rays, S2 renders \
                 speckle and matches blocks, S3 starts from what a real sensor recorded."
            }
            (others(&scores.others))
        }
    }
}

fn row(name: &str, rates: &Rates, bold: bool) -> Markup {
    html! {
        tr.ours[bold] {
            th scope="row" { (name) }
            @for (mark, _) in COLUMNS { td.n {
                @if let Some(rate) = rates.get(mark) { (figures(rate)) }
            } }
        }
    }
}

fn figures(rate: &Rate) -> Markup {
    html! { (rate.k) "/" (rate.n) br; span.units { (bare_percents(rate.interval)) } }
}

/// Names that other methods give, judged likewise.
fn others(others: &BTreeMap<String, Rates>) -> Markup {
    const MARKS: [(&str, &str); 4] = [
        ("false_alarm", "false alarm"),
        ("detected", "detected"),
        ("first_name", "first name right"),
        ("exact", "exact set"),
    ];
    html! {
        @if !others.is_empty() {
            h3 { "Names that other methods give" }
            table.small.rates {
                thead { tr { th { "Method" } @for (_, head) in MARKS { th.n { (head) } } } }
                tbody { @for (method, rates) in others { tr {
                    th scope="row" { (method) }
                    @for (mark, _) in MARKS { td.n { @if let Some(rate) = rates.get(mark) { (figures(rate)) } } }
                } } }
            }
        }
    }
}
