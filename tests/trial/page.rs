//! The page of a trial, for sceptics: the marks, the power, every failure and how to check it all. Also a
//! summary of a few lines for the terminal.

use std::fmt::Write as _;
use std::time::{Duration, SystemTime};

use kinoise::report::Origin;
use kinoise::report::document::{document, facts, fold, section, table};
use maud::{Markup, html};

use crate::judge::{ByStrength, Endpoint, Level, QUESTIONS, Rate, Ratio, level, word};
use crate::proof::{Proof, ProvenSet};
use crate::reliance::reliance;

/// Columns of the table by kind of set: question and heading.
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

/// Table by kind of set and the five endpoints, as text for the terminal.
pub fn summary(proof: &Proof) -> String {
    let scores = &proof.scores;
    let mut text = format!("{:<22}", format!("{} sets", scores.sets));
    for (_, head) in COLUMNS {
        let _ = write!(text, "{head:>13}");
    }
    for (kind, rates) in &scores.by_kind {
        let _ = write!(text, "\n{kind:<22}");
        for (mark, _) in COLUMNS {
            let _ = write!(text, "{:>13}", count(rates.get(mark)));
        }
    }
    for e in &scores.endpoints {
        let _ = write!(text, "\n{:<16} {:>6} of {:<4} {}", e.id, number(e.value), e.n, reached(e));
    }
    text
}

/// The page as one self-contained HTML file.
pub fn page(proof: &Proof) -> String {
    const TITLE: &str = "A blind trial of kinoise diagnose";
    let scores = &proof.scores;
    let body = html! {
        header { h1 { (TITLE) } }
        (reliance(proof))
        (endpoints(proof))
        (power("What is seen, by kind and strength", &scores.by_strength, "detected"))
        (power("What is seen, by cause and strength", &scores.by_effect, "detected"))
        (power("Right name first, of those seen", &scores.by_effect, "first_name"))
        (kinds(proof))
        (certainty(proof))
        (gains(proof))
        (confusion(proof))
        (failures(proof))
        (method(proof))
    };
    document(TITLE, &origin(proof), &[], &body).into_string()
}

fn origin(proof: &Proof) -> Origin {
    let order = &proof.order;
    let epoch = std::env::var("SOURCE_DATE_EPOCH").ok().and_then(|s| s.parse().ok());
    let time = epoch.map(|s| SystemTime::UNIX_EPOCH + Duration::from_secs(s));
    let data = if order.real { " --data RECORDINGS" } else { "" };
    let command = format!("./run prove -o DIR --sets {} --seed {}{data}", order.sets, order.seed);
    Origin::at("", &command, Some(order.seed), time)
}

fn percent(x: f64) -> String {
    format!("{:.0} %", 100.0 * x)
}

fn number(x: Option<f64>) -> String {
    x.map_or("-".into(), |x| format!("{x:.2}"))
}

fn count(rate: Option<&Rate>) -> String {
    rate.map_or(String::new(), |r| format!("{}/{}", r.k, r.n))
}

fn share(rate: Option<&Rate>) -> String {
    rate.map_or("not asked".into(), |r| {
        let [low, high] = r.interval.map(percent);
        format!("{} of {} ({low} to {high})", r.k, r.n)
    })
}

/// Cells of plain text.
fn row(cells: impl IntoIterator<Item = String>) -> Vec<Markup> {
    cells.into_iter().map(|cell| html! { (cell) }).collect()
}

fn reached(e: &Endpoint) -> &'static str {
    match e.reached {
        Level::Neither => "missed",
        Level::Good => "good",
        Level::Extraordinary => "extraordinary",
    }
}

fn endpoints(proof: &Proof) -> Markup {
    let heads = ["~mark", ">figure", ">95 %", ">sets", "reached", ">p, good"];
    let line = |e: &Endpoint| {
        let interval = e.interval.map(|[low, high]| format!("{low:.2} to {high:.2}"));
        let (n, p) = (e.n.to_string(), e.p_adjusted[0]);
        let p = if p < 0.001 { "< 0.001".into() } else { format!("{p:.3}") };
        let figures = [number(e.value), interval.unwrap_or_default(), n, reached(e).into(), p];
        let name = html! { b { (e.id) } br; (e.words) };
        std::iter::once(name).chain(row(figures)).collect()
    };
    let rows = proof.scores.endpoints.iter().map(line);
    section("The five marks, chosen beforehand", &table(&heads, rows))
}

/// Table of rates: rows by name, columns by strength, cells shaded by the rate.
fn power(title: &str, rows: &ByStrength, question: &str) -> Markup {
    let mut levels: Vec<&String> = rows.values().flat_map(|r| r.keys()).collect();
    levels.sort();
    levels.dedup();
    let heads = levels.iter().map(|level| format!(">{}", level.trim_start_matches('0')));
    let heads: Vec<String> = std::iter::once("nats".into()).chain(heads).collect();
    let cell = |rate: Option<&Rate>| {
        let style = rate.map(|r| format!("--share: {:.0}%", 100.0 * r.rate));
        html! { @if rate.is_some() { span.share style=[style] { (count(rate)) } } }
    };
    let asked = rows.iter().filter(|(_, r)| r.values().any(|r| r.contains_key(question)));
    let lines = asked.map(|(name, by_level)| {
        let cells =
            levels.iter().map(|level| cell(by_level.get(*level).and_then(|r| r.get(question))));
        std::iter::once(html! { (name) }).chain(cells).collect()
    });
    section(title, &table(&heads, lines))
}

fn kinds(proof: &Proof) -> Markup {
    let heads = COLUMNS.map(|(_, head)| format!(">{head}"));
    let heads: Vec<String> = std::iter::once("kind".into()).chain(heads).collect();
    let lines = proof.scores.by_kind.iter().map(|(kind, rates)| {
        row(std::iter::once(kind.clone()).chain(COLUMNS.map(|(mark, _)| count(rates.get(mark)))))
    });
    let words = QUESTIONS.map(|(question, words, _)| (question, html! { (words) }));
    section("All kinds of sets", &html! { (table(&heads, lines)) (facts(words)) })
}

fn certainty(proof: &Proof) -> Markup {
    let scores = &proof.scores;
    let lines = scores.calibration.iter().map(|bin| {
        let [low, high] = bin.right.interval.map(percent);
        let right = percent(bin.right.rate);
        row([percent(bin.stated), right, format!("{low} to {high}"), bin.right.n.to_string()])
    });
    section(
        "How far stated probabilities hold",
        &html! {
            p { "A stated 90 % interval of a parameter holds the truth in " (share(scores.coverage.as_ref()))
                ". Calibration error " (number(scores.calibration_error)) ", Brier score " (number(scores.brier))
                "; parameters are off by " (number(scores.parameter_error)) " (median, relative); the stated stretch of an axis overlaps the true one by "
                (number(scores.overlap)) " (median); an advised view settles the name in " (share(scores.advice.as_ref())) "." }
            (table(&[">stated", ">right", ">95 %", ">names"], lines))
        },
    )
}

fn gains(proof: &Proof) -> Markup {
    let heads =
        ["inside, median", "10th percentile", "sets", "outside, median", "10th percentile", "sets"];
    let heads: Vec<String> =
        std::iter::once("method".into()).chain(heads.map(|h| format!(">{h}"))).collect();
    let lines = proof.scores.gains.iter().map(|(method, sides)| {
        let cells = sides.iter().flat_map(|side| {
            let of = |x: fn(&Ratio) -> String| side.as_ref().map_or(String::new(), x);
            [of(|r| number(Some(r.median))), of(|r| number(Some(r.low))), of(|r| r.n.to_string())]
        });
        row(std::iter::once(method.clone()).chain(cells))
    });
    section("What was gained on fresh views, over who knows the truth", &table(&heads, lines))
}

fn confusion(proof: &Proof) -> Markup {
    let lines = proof.scores.confusion.iter().map(|(hidden, said)| {
        let said: Vec<String> = said.iter().map(|(name, n)| format!("{name} {n}")).collect();
        row([hidden.clone(), said.join(", ")])
    });
    section(
        "What was hidden, and what was said first",
        &table(&["hidden", "said first, of those seen"], lines),
    )
}

/// Questions with a wrong answer.
fn failed(set: &ProvenSet) -> Vec<&'static str> {
    let asked = QUESTIONS.iter().map(|q| q.0);
    let wrong = |question: &&str| {
        let right = !["false_alarm", "confident_wrong"].contains(question);
        let graded = ["ran", "detected", "first_name", "abstained", "said_blind"];
        let graded = !right || graded.contains(question);
        graded && set.marks.answers.get(*question).is_some_and(|answer| *answer != right)
    };
    asked.filter(wrong).collect()
}

fn failures(proof: &Proof) -> Markup {
    let all: Vec<(&ProvenSet, Vec<&str>)> =
        proof.sets.iter().map(|s| (s, failed(s))).filter(|f| !f.1.is_empty()).collect();
    let lines = all.iter().map(|(set, failed)| {
        let asked = &set.truth.asked;
        let hidden: Vec<&str> = set.truth.hidden.iter().map(|h| h.name()).collect();
        let why = set.answer.failure.as_ref().map_or(String::new(), |why| format!(": {why}"));
        row([
            set.name.clone(),
            format!("{}/{}", word(asked.world), word(asked.cell)),
            hidden.join(" "),
            level(&set.truth).map_or(String::new(), |n| n.to_string()),
            set.marks.first.clone(),
            failed.join(", ") + &why,
        ])
    });
    let heads = ["set", "kind", "hidden", ">nats", "said first", "what failed"];
    section(
        &format!("Every failure ({} of {} sets)", all.len(), proof.sets.len()),
        &fold("The list", false, &table(&heads, lines)),
    )
}

fn method(proof: &Proof) -> Markup {
    let files =
        ["commitments.json", "verdicts.json", "commitments-advised.json", "verdicts-advised.json"];
    let hashes = files.iter().zip(&proof.published).map(|(f, h)| (f, html! { code { (h) } }));
    section(
        "How it was done, and how to check it",
        &html! {
            p { "Seed " (proof.order.seed) ", " (proof.order.sets) " sets"
                @if proof.order.real { ", some of real recordings" } ". The makers of sets share no formula with the catalogue and no code with the diagnosis. "
                "Data and answers were hashed before the first diagnosis, verdicts before the first answer was opened; where a diagnosis asked for another view, "
                "it was taken, hashed and diagnosed again. Kept apart from the machine by: "
                @for (how, n) in &proof.confinement { (how) " (" (n) " diagnoses) " } }
            (facts(hashes))
            p { "Check it: " code { "./run prove --check DIR" } " compares hashes, marks and scores and makes a sample of the sets again; "
                code { "--all" } " makes every one. " code { "summary.json" } " has a row a set." }
        },
    )
}
