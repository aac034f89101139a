//! What was hidden against what was said first.

use std::collections::{BTreeMap, BTreeSet};

use maud::{Markup, html};

use super::words::name;
use crate::{Cell, ProvenSet};

/// How a cell is coloured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Right,
    Wrong,
    /// Nothing was said.
    Silent,
}

/// How often something was said, and how it is judged.
#[derive(Debug, Clone, Copy, Default)]
struct Count {
    all: usize,
    right: usize,
}

/// Rows in their order with what was said first.
pub(super) struct Matrix {
    rows: Vec<(String, BTreeMap<String, Count>)>,
    columns: Vec<String>,
}

/// In the order in which they are shown after the names.
const LAST: [&str; 4] = ["unexplained", "recalibrate", "nothing", "failed"];

fn head(said: &str) -> &str {
    if said == "nothing" { "match" } else { said }
}

/// The row of a set that hides one thing or none.
fn row(set: &ProvenSet) -> Option<(u8, String)> {
    let hidden = &set.truth.hidden;
    match (set.truth.asked.cell, &hidden[..]) {
        (Cell::Drift, _) => Some((1, "the unit’s own noise has changed".into())),
        (Cell::Blind, _) => None,
        (_, []) => Some((0, "nothing hidden".into())),
        // The world of light has switches that the catalogue lacks.
        (Cell::Single | Cell::Outside, [one]) if one.names.is_empty() => {
            Some((3, format!("outside: {}", name(one))))
        }
        (Cell::Single | Cell::Outside, [one]) => Some((2, name(one).into())),
        _ => None,
    }
}

fn right(set: &ProvenSet) -> bool {
    let m = &set.marks;
    let unexplained = m.abstained == Some(true) && m.first == "unexplained";
    unexplained
        || m.first_name == Some(true)
        || m.recalibrate == Some(true)
        || m.false_alarm == Some(false)
}

impl Matrix {
    pub fn of(sets: &[ProvenSet]) -> Self {
        let mut rows: BTreeMap<(u8, String), BTreeMap<String, Count>> = BTreeMap::new();
        let mut said = BTreeSet::new();
        for set in sets {
            let Some(row) = row(set) else { continue };
            let count = rows.entry(row).or_default().entry(set.marks.first.clone()).or_default();
            count.all += 1;
            count.right += usize::from(right(set));
            said.insert(set.marks.first.clone());
        }
        let names = said.iter().filter(|s| !LAST.contains(&s.as_str())).cloned();
        let last = LAST.iter().filter(|l| said.contains(**l)).map(ToString::to_string);
        let columns = names.chain(last).collect();
        Matrix { rows: rows.into_iter().map(|((_, name), row)| (name, row)).collect(), columns }
    }

    #[cfg(test)]
    pub fn count(&self, row: &str, said: &str) -> usize {
        let row = self.rows.iter().find(|r| r.0 == row);
        row.and_then(|r| r.1.get(said)).map_or(0, |c| c.all)
    }
}

fn kind(said: &str, count: Count) -> Kind {
    match (said, 2 * count.right >= count.all) {
        (_, true) => Kind::Right,
        ("nothing", _) => Kind::Silent,
        _ => Kind::Wrong,
    }
}

pub(super) fn section(sets: &[ProvenSet]) -> Markup {
    let matrix = Matrix::of(sets);
    html! {
        section {
            h2 { "What was hidden, and what was said first" }
            @if matrix.rows.is_empty() { p { "No set hides one cause or none." } }
            @else { (table(&matrix)) (key()) }
        }
    }
}

fn table(matrix: &Matrix) -> Markup {
    html! {
        div.wide { table.matrix {
            thead { tr {
                th { "hidden ↓ said first →" }
                th.n { "sets" }
                @for said in &matrix.columns { th.up { span { (head(said)) } } }
            } }
            tbody { @for (name, row) in &matrix.rows { tr {
                @let all: usize = row.values().map(|c| c.all).sum();
                th scope="row" { (name) }
                td.n { (all) }
                @for said in &matrix.columns { (cell(said, row.get(said).copied(), all)) }
            } } }
        } }
    }
}

fn cell(said: &str, count: Option<Count>, all: usize) -> Markup {
    let Some(count) = count else { return html! { td {} } };
    let colour = match kind(said, count) {
        Kind::Right => "29, 145, 192",
        Kind::Wrong => "214, 96, 60",
        Kind::Silent => return html! { td.silent { (count.all) } },
    };
    const FAINTEST: f64 = 0.2;
    const SPAN: f64 = 0.5;
    let opacity = FAINTEST + SPAN * count.all as f64 / all.max(1) as f64;
    html! { td style=(format!("background: rgba({colour}, {opacity:.2})")) { (count.all) } }
}

fn key() -> Markup {
    html! {
        p.note {
            span.swatch.right {} " right, " span.swatch.wrong {} " wrong: the darker, the larger the share of the row; grey figures: nothing \
             was said and something is hidden. Rows: sets with one hidden cause or none; causes outside the catalogue have “unexplained” as \
             their right answer, a unit whose own noise has changed “recalibrate”, empty sets “match”. All strengths together, so a row’s grey \
             figures are mostly its weak sets; the power curves tell them apart."
        }
    }
}
