//! What the advised views did.

use maud::{Markup, html};

use super::words::{of, percents, world};
use crate::{AdviceMarks, AdvisedSet, Proof, ProvenSet, Rate, Rediagnosed, SecondRound};
use kinoise::report::numbers::{ABSENT, fixed};

/// Rates with their words.
const RATES: [(&str, &str); 7] = [
    ("right_in_doubt", "The right name is one of the two in doubt"),
    ("surer", "of these: its probability rose with the view"),
    ("led_before", "of these: it led before"),
    ("leads_after", "of these: it leads with the view"),
    ("settled", "of these: it leads with 0.9 or more"),
    ("settled_as_promised", "the same, where the advice expected two standard errors or more"),
    ("misled", "Neither name in doubt is right, and a wrong one has 0.9 or more with the view"),
];

pub(super) fn section(proof: &Proof) -> Markup {
    html! {
        @if let Some(second) = proof.second.as_ref().filter(|s| !s.sets.is_empty()) {
            section {
                h2 { "Does the advised view settle it?" }
                p {
                    "Where a diagnosis is not sure between two names, it advises a further view. In a second round the first "
                    b { (second.sets.len()) } " sets that asked for one got it: the same unit before the same target with the same cause at work, one view more. \
                     Which sets, and which views, follows from the hashed verdicts alone; the new recordings were hashed before the second diagnosis, and its \
                     verdicts before the answers were opened."
                }
                (rates(second))
                details open[second.sets.len() <= OPEN] {
                    summary { "Every advised view (" (second.sets.len()) ")" }
                    div.wide { table.small {
                        thead { tr {
                            th { "Set" } th { "Hidden" } th { "In doubt, with probabilities" } th { "View taken" }
                            th.n { "Expected apart" } th.n { "Right name, before" } th.n { "with the view" } th { "Then said" }
                        } }
                        tbody { @for (taken, again) in second.advice.sets.iter().zip(&second.sets) {
                            @if let Some(set) = proof.sets.iter().find(|s| s.name == again.name) { (row(set, taken, again)) }
                        } }
                    } }
                }
                p.note {
                    "A view is its distance, its tilt and where it leans to; in brackets what was advised, where the stage could not follow (a wall ends, the matcher \
                     gives up). Expected apart: standard errors between the two names that the advice itself states, as it is and with the view. “–”: neither \
                     of the two is hidden."
                }
            }
        }
    }
}

/// So many rows are not folded away.
const OPEN: usize = 12;

fn rates(second: &SecondRound) -> Markup {
    let worlds = &second.scores.by_world;
    let figure = |rate: Option<&Rate>| {
        html! { @match rate {
            Some(rate) => { (of(rate)) br; span.units { (percents(rate.interval)) } },
            None => (ABSENT),
        } }
    };
    html! {
        table.small.rates {
            thead { tr { th {} th.n { "all" } @for w in worlds.keys() { th.n { (w) } } } }
            tbody { @for (mark, words) in RATES { tr {
                th scope="row" { (words) }
                td.n { (figure(second.scores.all.get(mark))) }
                @for rates in worlds.values() { td.n { (figure(rates.get(mark))) } }
            } } }
        }
    }
}

fn row(set: &ProvenSet, taken: &AdvisedSet, again: &Rediagnosed) -> Markup {
    let marks = &again.marks;
    let hidden: Vec<&str> = set.truth.hidden.iter().map(super::words::name).collect();
    let [before, after] = [0, 1].map(|k| marks.right.map_or(ABSENT.into(), |r| fixed(r[k], 2)));
    html! {
        tr {
            td { code { (set.name) } br; span.units { (world(set.truth.asked.world)) } }
            td { (hidden.join(", ")) @if hidden.is_empty() { "nothing" } }
            td { (doubt(marks)) }
            td { (view(taken)) }
            td.n { (marks.promised.map_or(ABSENT.into(), |[now, then]| format!("{} → {}", fixed(now, 1), fixed(then, 1)))) }
            td.n { (before) }
            td.n { @if marks.settled == Some(true) { b { (after) } } @else { (after) } }
            td { @if marks.ran { (marks.after) } @else { "no diagnosis" } }
        }
    }
}

fn doubt(marks: &AdviceMarks) -> String {
    let one = |(name, p): &(String, f64)| format!("{name} {}", fixed(*p, 2));
    marks.doubt.iter().map(one).collect::<Vec<_>>().join(", ")
}

fn view(set: &AdvisedSet) -> Markup {
    let words = |p: &crate::Pose| {
        let degrees = |rad: f64| fixed(rad.to_degrees(), 0);
        format!("{} m, {}° to {}°", fixed(p.z_m, 1), degrees(p.theta_rad), degrees(p.azimuth_rad))
    };
    html! {
        (words(&set.taken))
        @if set.taken != set.advised { br; span.units { "(" (words(&set.advised)) ")" } }
    }
}
