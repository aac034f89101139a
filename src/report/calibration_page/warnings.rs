//! The warnings; the same remark about many views is one entry.

use maud::{Markup, html};

use crate::report::document::{self, fold, list, prose};
use crate::units::counted;
use crate::view::Excluded;

/// Longest list that is not folded.
const MAX_OPEN: usize = 3;
const ABOUT_A_VIEW: &str = "view ";

pub(super) fn section(warnings: &[String], excluded: &[Excluded]) -> Markup {
    let of_an_excluded = |warning: &str| {
        let left_out = |e: &Excluded| format!("{ABOUT_A_VIEW}{} was left out", e.view);
        excluded.iter().any(|e| warning.starts_with(&left_out(e)))
    };
    let (views, general): (Vec<&str>, Vec<&str>) = warnings
        .iter()
        .map(String::as_str)
        .filter(|warning| !of_an_excluded(warning))
        .partition(|warning| warning.starts_with(ABOUT_A_VIEW));
    let content = html! {
        @if warnings.is_empty() { p { "None." } }
        (list(general.iter().map(|w| prose(w))))
        @if !excluded.is_empty() {
            @let title = format!("{} left out", counted(excluded.len(), "view"));
            @let items = list(excluded.iter().map(|e| html! { b { (e.view) } ": " (prose(&e.reason)) }));
            (fold(&title, excluded.len() <= MAX_OPEN, &items))
        }
        @for group in grouped(&views) {
            @let items = list(group.iter().map(|w| prose(w)));
            @let title = format!("{} like: {}", counted(group.len(), "remark"), group[0]);
            @if group.len() <= MAX_OPEN { (items) } @else { (fold(&title, false, &items)) }
        }
    };
    document::section("Warnings", &content)
}

/// Groups remarks that differ only in the view and in numbers, in order of appearance.
fn grouped<'a>(warnings: &[&'a str]) -> Vec<Vec<&'a str>> {
    let mut groups: Vec<(String, Vec<&str>)> = Vec::new();
    for &warning in warnings {
        let words = warning.split_once(": ").map_or(warning, |(_, text)| text);
        let shape: String = words.chars().filter(|c| !c.is_ascii_digit() && *c != '.').collect();
        match groups.iter_mut().find(|(s, _)| *s == shape) {
            Some((_, group)) => group.push(warning),
            None => groups.push((shape, vec![warning])),
        }
    }
    groups.into_iter().map(|(_, group)| group).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn remarks_that_differ_in_numbers_are_one_group() {
        let groups =
            grouped(&["view a: 3.5 mm off", "view b: no infrared", "view c: 14.25 mm off"]);
        let expected =
            [vec!["view a: 3.5 mm off", "view c: 14.25 mm off"], vec!["view b: no infrared"]];
        assert_eq!(groups, expected);
    }
}
