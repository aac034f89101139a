//! The first screen: what was done, the five figures, what fell short.

use maud::{Markup, html};

use super::goal::{Goal, level_badge, table};
use super::goals::goals;
use super::words::{count, percent, percents, ratio};
use crate::{Endpoint, Level, Proof};
use kinoise::report::numbers::{ABSENT, significant};

pub(super) fn section(proof: &Proof) -> Markup {
    let goals = goals(proof);
    html! {
        (done(proof))
        section.first {
            h2 { "The five figures chosen beforehand" }
            p.sentence { (sentence(&proof.scores.endpoints)) }
            (endpoints(&proof.scores.endpoints))
        }
        section.short {
            h2 { "What fell short" }
            (short(proof, &goals))
        }
        details.marks {
            summary { "All other marks, side by side (" (goals.len()) " figures)" }
            (table(&goals))
            p.note {
                "Marks as they stand in the plan of the trial, written before it. A figure without “good” has only \
                 the higher mark."
            }
        }
    }
}

fn done(proof: &Proof) -> Markup {
    let (sets, failed) =
        (proof.sets.len(), proof.sets.iter().filter(|s| s.failure.is_some()).count());
    let empties = proof.sets.iter().filter(|s| s.marks.false_alarm.is_some()).count();
    html! {
        p.lead {
            "kinoise claims to find out what a depth sensor’s noise model leaves out, and to name it. Here it was put to "
            b { (sets) " recordings" } " made for the purpose" @if proof.order.real { " or taken by real sensors" }
            ". In " b { (empties) } " of them nothing was hidden; in the others something was, and the program was not told \
             which, nor how many."
        }
        p {
            "The hash of every recording and of every answer, salted, was written down "
            b { "before the first diagnosis" } ". A separate process diagnosed each recording; what kept it from the rest of the machine: "
            (confinement(proof)) ". Its verdicts were hashed too, and only then were the answers opened and counted, by rules \
             whose source text was hashed with the rest. Every recording that was sealed counts"
            @if failed > 0 { "; " b { (count(failed, "recording")) " without a diagnosis count" @if failed == 1 { "s" } " as wrong in every respect" } }
            "."
        }
    }
}

pub(super) fn confinement(proof: &Proof) -> Markup {
    html! {
        @if proof.confinement.is_empty() { "not recorded" }
        @for (i, (how, sets)) in proof.confinement.iter().enumerate() {
            @if i > 0 { "; " }
            (how) " (" (count(*sets, "set")) ")"
        }
    }
}

/// All that was reached, and all that was not.
fn sentence(endpoints: &[Endpoint]) -> String {
    let many =
        |level: Level| endpoints.iter().filter(|e| e.value.is_some() && e.reached == level).count();
    let (best, good, missed) =
        (many(Level::Extraordinary), many(Level::Good), many(Level::Neither));
    let absent = endpoints.iter().filter(|e| e.value.is_none()).count();
    let shown = endpoints.iter().filter(|e| e.shown > Level::Neither).count();
    let mut text =
        format!("{missed} of {} missed, {good} good, {best} extraordinary", endpoints.len());
    if absent > 0 {
        text += &format!(", {absent} not measured");
    }
    text + &format!("; shown beyond chance: {shown}.")
}

fn title(endpoint: &Endpoint) -> &str {
    match endpoint.id.as_str() {
        "false-alarms" => "False alarms where nothing is hidden",
        "first-name" => "Right first name, once detected",
        "gain" => "Gain on fresh views, over the oracle’s",
        "abstention" => "No name where the catalogue has none",
        "extrapolation" => "Gain outside what was recorded, over the oracle’s",
        other => other,
    }
}

fn number(endpoint: &Endpoint, value: f64) -> String {
    if is_ratio(endpoint) { ratio(value) } else { percent(value) }
}

fn is_ratio(endpoint: &Endpoint) -> bool {
    matches!(endpoint.id.as_str(), "gain" | "extrapolation")
}

fn interval(endpoint: &Endpoint) -> String {
    match endpoint.interval {
        None => ABSENT.into(),
        Some([low, high]) if is_ratio(endpoint) => format!("{} to {}", ratio(low), ratio(high)),
        Some(ends) => percents(ends),
    }
}

fn marks(endpoint: &Endpoint) -> [String; 2] {
    let sign = if endpoint.id == "false-alarms" { "≤" } else { "≥" };
    endpoint.marks.map(|m| format!("{sign}\u{a0}{}", number(endpoint, m)))
}

fn reached(endpoint: &Endpoint) -> Option<Level> {
    endpoint.value.map(|_| endpoint.reached)
}

fn endpoints(all: &[Endpoint]) -> Markup {
    html! {
        div.wide { table.endpoints {
            thead { tr {
                th { "Figure" } th.n { "Value" } th.n { "95 % interval" } th.n { "Sets" }
                th.n { "Good" } th.n { "Extraordinary" } th { "Reached" } th { "Beyond chance" }
            } }
            tbody { @for e in all {
                @let [good, best] = marks(e);
                tr {
                    th scope="row" { b { (title(e)) } }
                    td.n.big { (e.value.map_or(ABSENT.into(), |v| number(e, v))) }
                    td.n { (interval(e)) }
                    td.n { (e.n) }
                    td.n { (good) }
                    td.n { (best) }
                    td { (level_badge(reached(e))) }
                    td { (beyond_chance(e)) }
                }
            } }
        } }
        details { summary { "The five, word for word as they were sealed" } ol { @for e in all { li { (e.words) } } } }
        p.note {
            "Intervals of shares are Clopper and Pearson’s, of medians by resampling sets. “Beyond chance”: the best mark that a \
             tool which only just misses it would reach with less than 5 %, after Holm’s correction for five figures. A mark can be \
             reached and still not be beyond chance: then more sets are needed to tell."
        }
    }
}

fn beyond_chance(endpoint: &Endpoint) -> Markup {
    let [good, best] = endpoint.p_adjusted;
    html! {
        @match endpoint.shown {
            Level::Neither => { "no (p = " (significant(good, 2)) ")" },
            Level::Good => { "good (p = " (significant(good, 2)) ")" },
            Level::Extraordinary => { "extraordinary (p = " (significant(best, 2)) ")" },
        }
    }
}

fn short(proof: &Proof, goals: &[Goal]) -> Markup {
    let endpoints: Vec<&Endpoint> =
        proof.scores.endpoints.iter().filter(|e| reached(e) == Some(Level::Neither)).collect();
    let missed: Vec<_> = goals.iter().filter(|g| g.reached() == Some(Level::Neither)).collect();
    let absent: Vec<&str> =
        goals.iter().filter(|g| g.reached().is_none()).map(|g| g.what).collect();
    let unmeasured = proof.scores.endpoints.iter().filter(|e| e.value.is_none()).map(title);
    let absent: Vec<&str> = unmeasured.chain(absent).collect();
    html! {
        @if endpoints.is_empty() && missed.is_empty() { p { "No mark was missed." } }
        ul {
            @for e in &endpoints {
                li { b { (title(e)) } ": " (e.value.map_or(ABSENT.into(), |v| number(e, v)))
                    " (95 % interval " (interval(e)) ", " (count(e.n, "set")) "); asked for: " (marks(e)[0]) ". " b { "Chosen beforehand." } }
            }
            @for goal in &missed { li { b { (goal.what) } ": " (goal.in_words()) "." } }
        }
        @if !absent.is_empty() { p.note { "Not measured in this trial, for want of sets or of anything to compare with: " (absent.join("; ")) "." } }
    }
}
