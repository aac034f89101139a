//! What was gained and what remains; and, where nothing was found, what that is worth.

use maud::{Markup, html};

use super::advice::sentence;
use super::names::name;
use super::parameters;
use super::words::{axis, capital, count, list, mm, p_value, statistic};
use crate::diagnose::{CannotTell, Detectable, Diagnosis, HeldOut, Remaining, Verdict};
use crate::report::numbers::fixed;

/// Longer lists fold away.
const LONGEST_OPEN: usize = 6;
/// A threshold is not known better.
const DIGITS: usize = 2;

pub(super) fn gained_and_left(diagnosis: &Diagnosis) -> Markup {
    let put_in = !diagnosis.findings.is_empty();
    html! {
        section.outcome {
            @if let Some(held) = &diagnosis.heldout { div {
                h2 { "What was gained" }
                (gained(held))
            } }
            @if put_in || !diagnosis.after.remaining.is_empty() { div {
                h2 { "What remains" }
                (remains(diagnosis))
            } }
        }
    }
}

fn gained(held: &HeldOut) -> Markup {
    let [low, high] = held.gain_interval;
    let gain = |v: f64| fixed(v, usize::from(held.gain.abs() < 10.0));
    html! {
        p {
            "Tested on " (count(held.views.len(), "view")) " that took no part in the search. Their steady error: "
            b { (mm(held.rms_mm_before)) " → " (mm(held.rms_mm_after)) } "."
        }
        p {
            @if low > 0.0 { "The new simulation predicts such a view better by " }
            @else { "No gain that chance would not make: the new simulation differs by " }
            b { (gain(held.gain)) " nats a view" }
            " (95 % between " (gain(low)) " and " (gain(high)) "). "
            span.units { "A nat more makes what was recorded e ≈ 2.7 times as probable." }
        }
    }
}

fn remains(diagnosis: &Diagnosis) -> Markup {
    let after = &diagnosis.after;
    html! {
        @match (after.verdict, after.remaining.is_empty()) {
            (Verdict::Match, _) => p {
                "Nothing beyond chance: with the findings put in, the same tests find no difference between simulation \
                 and recording."
            },
            (Verdict::Mismatch, true) => p { "With the findings put in, the tests still find a difference." },
            (Verdict::Inconclusive, true) => p { "With the findings put in, the tests do not settle whether anything is left." },
            _ => p { "With the findings put in, the tests still find:" },
        }
        @if !after.remaining.is_empty() { ul { @for r in &after.remaining { (remaining(r)) } } }
    }
}

fn remaining(r: &Remaining) -> Markup {
    html! {
        li {
            @if r.words.is_empty() {
                (capital(statistic(r.statistic))) ", over the " (axis(r.axis))
            } @else { (r.words) }
            " (" (p_value(r.p_adjusted)) ")"
        }
    }
}

/// What a match is worth: what was looked for, and how small it could have been.
pub(super) fn looked_for(diagnosis: &Diagnosis) -> Markup {
    let names: Vec<String> =
        diagnosis.detectable.iter().map(|d| name(d.effect).short.to_string()).collect();
    html! {
        section {
            h2 { "What was looked for" }
            @if names.is_empty() {
                p { "Every known cause, and curves without a name over every axis." }
            } @else {
                p {
                    "Known causes (" (list(&names, "and")) "), and curves without a name. None stands out from \
                     chance. The table tells how small each could have been and still be seen four times out of five."
                }
            }
        }
    }
}

pub(super) fn detectable(all: &[Detectable]) -> Markup {
    html! {
        @if !all.is_empty() { section {
            h2 { "How small an effect these views could have shown" }
            div.wide { table {
                thead { tr { th { "cause" } th { "smallest that would be seen" } th { "what the number is" } } }
                tbody { @for d in all { (smallest(d)) } }
            } }
            p.note { "With a power of 80 %: of five recordings like this one with an effect this large, four would show it." }
        } }
    }
}

/// The strength, and what it was counted at.
fn smallest(d: &Detectable) -> Markup {
    let mut all = d.minimum.iter();
    let Some((strength, least)) = all.next() else { return html! {} };
    html! {
        tr {
            th { (capital(name(d.effect).short)) }
            td {
                (parameters::title(strength)) " " b { (parameters::value(strength, least, DIGITS)) }
                @for (key, value) in all { ", at a " (parameters::title(key)) " of " (parameters::value(key, value, DIGITS)) }
            }
            td.words { (parameters::words(Some(d.effect), strength)) }
        }
    }
}

pub(super) fn cannot_tell(all: &[CannotTell]) -> Markup {
    let list = html! {
        ul { @for c in all { li { b { (capital(name(c.effect).short)) } ": " (sentence(&c.why)) } } }
    };
    html! {
        @if !all.is_empty() { section {
            h2 { "What these views cannot tell" }
            @if all.len() <= LONGEST_OPEN { (list) } @else {
                details open { summary { (capital(&count(all.len(), "cause"))) } (list) }
            }
        } }
    }
}
