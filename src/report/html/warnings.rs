//! What to know before trusting the model; the same remark about many views is one entry.

use maud::{Markup, html};

use super::CalibrationPage;
use crate::view::Excluded;

/// Longer lists fold away.
const LONGEST_OPEN: usize = 3;
const ABOUT_A_VIEW: &str = "view ";

pub(super) fn section(input: &CalibrationPage<'_>) -> Markup {
    let all = &input.calibration.warnings;
    let excluded = input.measurements.map_or(&[][..], |m| &m.excluded);
    let (views, general): (Vec<&str>, Vec<&str>) = all
        .iter()
        .map(String::as_str)
        .filter(|w| !excluded.iter().any(|e| tells_of(w, e)))
        .partition(|w| w.starts_with(ABOUT_A_VIEW));
    html! {
        section {
            h2 { "Warnings" }
            @if all.is_empty() { p { "None." } }
            @if !general.is_empty() { (list(&general)) }
            @if !excluded.is_empty() {
                (fold(&format!("{} left out", counted(excluded.len(), "view")), excluded.len(), &html! {
                    ul { @for e in excluded { li { b { (e.view) } ": " (e.reason) } } }
                }))
            }
            @for group in grouped(&views) {
                @if group.len() <= LONGEST_OPEN { (list(&group)) } @else {
                    (fold(&format!("{} like: {}", counted(group.len(), "remark"), group[0]), group.len(), &list(&group)))
                }
            }
        }
    }
}

fn tells_of(warning: &str, excluded: &Excluded) -> bool {
    warning.starts_with(&format!("{ABOUT_A_VIEW}{} was left out", excluded.view))
}

fn list(items: &[&str]) -> Markup {
    html! { ul { @for item in items { li { (item) } } } }
}

fn fold(title: &str, length: usize, content: &Markup) -> Markup {
    html! { details open[length <= LONGEST_OPEN] { summary { (title) } (content) } }
}

fn counted(n: usize, noun: &str) -> String {
    if n == 1 { format!("1 {noun}") } else { format!("{n} {noun}s") }
}

/// Remarks that differ in the view and in numbers only, together; in order of appearance.
fn grouped<'a>(warnings: &[&'a str]) -> Vec<Vec<&'a str>> {
    let mut groups: Vec<(String, Vec<&str>)> = Vec::new();
    for &warning in warnings {
        let shape = shape(warning);
        match groups.iter_mut().find(|(s, _)| *s == shape) {
            Some((_, group)) => group.push(warning),
            None => groups.push((shape, vec![warning])),
        }
    }
    groups.into_iter().map(|(_, group)| group).collect()
}

/// The words after the view's name.
fn shape(warning: &str) -> String {
    let words = warning.split_once(": ").map_or(warning, |(_, text)| text);
    words.chars().filter(|c| !c.is_ascii_digit() && *c != '.').collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn remarks_that_differ_in_numbers_are_one_group() {
        let groups =
            grouped(&["view a: 3.5 mm off", "view b: no infrared", "view c: 14.25 mm off"]);
        assert_eq!(
            groups,
            [vec!["view a: 3.5 mm off", "view c: 14.25 mm off"], vec!["view b: no infrared"],]
        );
    }
}
