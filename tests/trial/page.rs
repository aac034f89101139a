//! The page of a trial, for somebody who does not believe it: what may be relied on, the marks, the
//! power, every failure, and how to check all of it. And the same in a few lines for the terminal.

use std::fmt::Write as _;

use kinoise::report::document::document;
use maud::{Markup, html};

use crate::judge::{Endpoint, Level, QUESTIONS, Rate, Rates, level, word};
use crate::proof::{Proof, ProvenSet};

/// The questions of the table by kind: the mark, its head.
const COLUMNS: [(&str, &str); 10] = [
    ("false_alarm", "alarm"),
    ("detected", "seen"),
    ("first_name", "name"),
    ("exact", "exact"),
    ("axis", "axis"),
    ("abstained", "unexplained"),
    ("recalibrate", "recalibrate"),
    ("said_blind", "says blind"),
    ("nothing_claimed", "silent"),
    ("confident_wrong", "sure, wrong"),
];

/// A table by kind of set, and the five endpoints.
pub fn summary(proof: &Proof) -> String {
    let scores = &proof.scores;
    let mut text = format!("{:<22}", format!("{} sets", scores.sets));
    for (_, head) in COLUMNS {
        let _ = write!(text, "{head:>13}");
    }
    for (kind, rates) in &scores.by_kind {
        let _ = write!(text, "\n{kind:<22}");
        for (mark, _) in COLUMNS {
            let cell = rates.get(mark).map_or(String::new(), |r| format!("{}/{}", r.k, r.n));
            let _ = write!(text, "{cell:>13}");
        }
    }
    for e in &scores.endpoints {
        let _ = write!(text, "\n{:<16} {:>6} of {:<4} {}", e.id, figure(e), e.n, reached(e));
    }
    text
}

/// The page as text: one self-contained file, no scripts.
pub fn page(proof: &Proof) -> String {
    let body = html! {
        header { h1 { "A blind trial of kinoise diagnose" } }
        (reliance(proof))
        (endpoints(proof))
        (power("What is seen, by kind and strength", &proof.scores.by_strength, "detected"))
        (power("What is seen, by cause and strength", &proof.scores.by_effect, "detected"))
        (power("Right name first, of those seen", &proof.scores.by_effect, "first_name"))
        (kinds(proof))
        (certainty(proof))
        (gains(proof))
        (confusion(proof))
        (failures(proof))
        (method(proof))
    };
    document("A blind trial of kinoise diagnose", None, &body).into_string()
}

fn percent(x: f64) -> String {
    format!("{:.0} %", 100.0 * x)
}

fn share(rate: Option<&Rate>) -> Markup {
    html! { @match rate {
        Some(r) => { (r.k) " of " (r.n) " (" (percent(r.interval[0])) " to " (percent(r.interval[1])) ")" },
        None => "not asked",
    } }
}

fn number(x: Option<f64>) -> String {
    x.map_or("-".into(), |x| format!("{x:.2}"))
}

fn figure(e: &Endpoint) -> String {
    number(e.value)
}

fn reached(e: &Endpoint) -> &'static str {
    match e.reached {
        Level::Neither => "missed",
        Level::Good => "good",
        Level::Extraordinary => "extraordinary",
    }
}

/// All sets' answers to one question, over the kinds that pass.
fn pooled(proof: &Proof, question: &str, of: impl Fn(&ProvenSet) -> bool) -> Option<Rate> {
    let sets = proof.sets.iter().filter(|s| of(s));
    Rate::of(sets.filter_map(|s| s.marks.answers.get(question).copied()))
}

fn reliance(proof: &Proof) -> Markup {
    let any = |_: &ProvenSet| true;
    let strong = |s: &ProvenSet| level(&s.truth).is_some_and(|n| n >= 500.0);
    let weak = |s: &ProvenSet| level(&s.truth).is_some_and(|n| n <= 15.0);
    html! {
        section {
            h2 { "What a user may rely on, and what not" }
            p { (proof.sets.len()) " recordings whose left-out physics was concealed; shares with their 95 % intervals." }
            ul {
                li { "A clean recording is called a mismatch in " (share(pooled(proof, "false_alarm", any).as_ref())) "." }
                li { "A cause worth 500 nats or more over the recording is seen in " (share(pooled(proof, "detected", strong).as_ref()))
                    "; its name comes first in " (share(pooled(proof, "first_name", strong).as_ref())) " of those." }
                li { "A cause worth 15 nats or less is seen in " (share(pooled(proof, "detected", weak).as_ref())) "." }
                li { "What the catalogue lacks is called unexplained, in the right place, in "
                    (share(pooled(proof, "abstained", any).as_ref())) "." }
                li { "A wrong name is stated with 90 % or more in " (share(pooled(proof, "confident_wrong", any).as_ref())) "." }
                li { "A stated 90 % interval of a parameter holds the truth in " (share(proof.scores.coverage.as_ref())) "." }
            }
        }
    }
}

fn endpoints(proof: &Proof) -> Markup {
    html! {
        section {
            h2 { "The five endpoints, chosen beforehand" }
            div.wide { table {
                thead { tr { th { "endpoint" } th.n { "figure" } th.n { "95 %" } th.n { "of" } th { "reached" }
                    th.n { "p, good" } th { "in words" } } }
                tbody { @for e in &proof.scores.endpoints { tr {
                    th { (e.id) } td.n { (figure(e)) }
                    td.n { @if let Some([low, high]) = e.interval { (format!("{low:.2} to {high:.2}")) } }
                    td.n { (e.n) } td { (reached(e)) } td.n { (format!("{:.3}", e.p_adjusted[0])) }
                    td.words { (e.words) }
                } } }
            } }
        }
    }
}

type ByStrength = std::collections::BTreeMap<String, std::collections::BTreeMap<String, Rates>>;

/// Rows by name, columns by strength, a cell as dark as its share.
fn power(title: &str, rows: &ByStrength, question: &str) -> Markup {
    let mut levels: Vec<&String> = rows.values().flat_map(|r| r.keys()).collect();
    levels.sort();
    levels.dedup();
    let cell = |rate: Option<&Rate>| {
        html! { @match rate {
            Some(r) => td.n style={ "background: color-mix(in srgb, #2a78b8 " (percent(r.rate).replace(' ', "")) ", transparent)" } { (r.k) "/" (r.n) },
            None => td {},
        } }
    };
    html! {
        section {
            h2 { (title) }
            div.wide { table {
                thead { tr { th { "nats" } @for level in &levels { th.n { (level.trim_start_matches('0')) } } } }
                tbody { @for (name, by_level) in rows {
                    @if by_level.values().any(|r| r.contains_key(question)) { tr {
                        th { (name) }
                        @for level in &levels { (cell(by_level.get(*level).and_then(|r| r.get(question)))) }
                    } }
                } }
            } }
        }
    }
}

fn kinds(proof: &Proof) -> Markup {
    html! {
        section {
            h2 { "All kinds of sets" }
            div.wide { table {
                thead { tr { th { "kind" } @for (_, head) in COLUMNS { th.n { (head) } } } }
                tbody { @for (kind, rates) in &proof.scores.by_kind { tr {
                    th { (kind) }
                    @for (mark, _) in COLUMNS { td.n { @if let Some(r) = rates.get(mark) { (r.k) "/" (r.n) } } }
                } } }
            } }
            dl { @for (question, words) in QUESTIONS { div { dt { (question) } dd { (words) } } } }
        }
    }
}

fn certainty(proof: &Proof) -> Markup {
    let scores = &proof.scores;
    html! {
        section {
            h2 { "How far stated probabilities hold" }
            p { "Calibration error " (number(scores.calibration_error)) ", Brier score " (number(scores.brier))
                "; parameters are off by " (number(scores.parameter_error)) " (median, relative); the stated stretch of an axis overlaps the true one by "
                (number(scores.overlap)) " (median); an advised view settles the name in " (share(scores.advice.as_ref())) "." }
            div.wide { table {
                thead { tr { th.n { "stated" } th.n { "right" } th.n { "95 %" } th.n { "names" } } }
                tbody { @for bin in &scores.calibration { tr {
                    td.n { (percent(bin.stated)) } td.n { (percent(bin.right.rate)) }
                    td.n { (percent(bin.right.interval[0])) " to " (percent(bin.right.interval[1])) }
                    td.n { (bin.right.n) }
                } } }
            } }
        }
    }
}

fn gains(proof: &Proof) -> Markup {
    html! {
        section {
            h2 { "What was gained on fresh views, over who knows the truth" }
            div.wide { table {
                thead { tr { th { "method" } th.n { "inside, median" } th.n { "10th percentile" } th.n { "sets" }
                    th.n { "outside, median" } th.n { "10th percentile" } th.n { "sets" } } }
                tbody { @for (method, sides) in &proof.scores.gains { tr {
                    th { (method) }
                    @for side in sides { @match side {
                        Some(r) => { td.n { (format!("{:.2}", r.median)) } td.n { (format!("{:.2}", r.low)) } td.n { (r.n) } },
                        None => { td {} td {} td {} },
                    } }
                } } }
            } }
        }
    }
}

fn confusion(proof: &Proof) -> Markup {
    html! {
        section {
            h2 { "What was hidden, and what was said first" }
            div.wide { table {
                thead { tr { th { "hidden" } th { "said first, of those seen" } } }
                tbody { @for (hidden, said) in &proof.scores.confusion { tr {
                    th { (hidden) }
                    td { @for (i, (name, n)) in said.iter().enumerate() { @if i > 0 { ", " } (name) " " (n) } }
                } } }
            } }
        }
    }
}

/// A set of which any answer is not what it should be.
fn failed(set: &ProvenSet) -> Vec<&str> {
    let wrong = |(question, yes): (&'static str, bool)| {
        set.marks.answers.get(question).is_some_and(|answer| *answer == yes).then_some(question)
    };
    let bad = [("ran", false), ("false_alarm", true), ("detected", false), ("first_name", false)];
    let worse = [("abstained", false), ("confident_wrong", true), ("said_blind", false)];
    bad.into_iter().chain(worse).filter_map(wrong).collect()
}

fn failures(proof: &Proof) -> Markup {
    let all: Vec<(&ProvenSet, Vec<&str>)> =
        proof.sets.iter().map(|s| (s, failed(s))).filter(|f| !f.1.is_empty()).collect();
    html! {
        section {
            h2 { "Every failure (" (all.len()) " of " (proof.sets.len()) " sets)" }
            details { summary { "The list" } div.wide { table {
                thead { tr { th { "set" } th { "kind" } th { "hidden" } th.n { "nats" } th { "said first" } th { "what failed" } } }
                tbody { @for (set, failed) in all { tr {
                    th { (set.name) }
                    td { (word(set.truth.asked.world)) "/" (word(set.truth.asked.cell)) }
                    td { @for h in &set.truth.hidden { (h.names.first().unwrap_or(&h.form)) " " } }
                    td.n { @if let Some(n) = level(&set.truth) { (n) } }
                    td { (set.marks.first) }
                    td { (failed.join(", ")) @if let Some(why) = &set.answer.failure { ": " (why) } }
                } } }
            } } }
        }
    }
}

fn method(proof: &Proof) -> Markup {
    let files =
        ["commitments.json", "verdicts.json", "commitments-advised.json", "verdicts-advised.json"];
    html! {
        section {
            h2 { "How it was done, and how to check it" }
            p { "Seed " (proof.order.seed) ", " (proof.order.sets) " sets"
                @if proof.order.real { ", some of real recordings" } ". The makers of sets share no formula with the catalogue and no code with the diagnosis. "
                "Data and answers were hashed before the first diagnosis, verdicts before the first answer was opened; where a diagnosis asked for another view, "
                "it was taken, hashed and diagnosed again. Kept apart from the machine by: "
                @for (how, n) in &proof.confinement { (how) " (" (n) " diagnoses) " } }
            dl { @for (file, hash) in files.iter().zip(&proof.published) { div { dt { (file) } dd { code { (hash) } } } } }
            p { "Check it: " code { "./run prove --check DIR" } " compares hashes, marks and scores and makes a sample of the sets again; "
                code { "--all" } " makes every one. " code { "summary.json" } " has a row a set." }
        }
    }
}
