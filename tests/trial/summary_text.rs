//! What a trial says to people.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use crate::{Checked, Endpoint, Level, Proof, Rate, Scores};

/// Columns of the table: the mark, its head.
const COLUMNS: [(&str, &str); 10] = [
    ("false_alarm", "alarm"),
    ("detected", "seen"),
    ("first_name", "name"),
    ("in_two", "in two"),
    ("exact", "exact"),
    ("axis", "axis"),
    ("abstained", "abstains"),
    ("recalibrate", "recalib."),
    ("nothing_claimed", "silent"),
    ("confident_wrong", "sure+wrong"),
];

/// A table by kind of set, and the five endpoints.
pub fn summary(proof: &Proof) -> String {
    let scores = &proof.scores;
    let mut text = format!("{:<20}", format!("{} sets", scores.sets));
    for (_, head) in COLUMNS {
        let _ = write!(text, "{head:>11}");
    }
    for (kind, rates) in &scores.by_world_and_cell {
        let _ = write!(text, "\n{kind:<20}");
        for (mark, _) in COLUMNS {
            let cell = rates.get(mark).map_or("-".into(), |r| format!("{}/{}", r.k, r.n));
            let _ = write!(text, "{cell:>11}");
        }
    }
    text += "\n";
    for (kind, head, unit) in KINDS {
        if let Some(levels) = scores.by_strength.get(kind) {
            let _ = write!(text, "\n{head}:\n{}", strengths(levels, unit));
        }
    }
    text += &advised(proof);
    text += &others(scores);
    text += "\nchosen beforehand:\n";
    scores.endpoints.iter().for_each(|e| text += &endpoint(e));
    for (how, sets) in &proof.confinement {
        let _ = writeln!(text, "solver shut in: {how} ({sets} sets)");
    }
    let failed = proof.sets.iter().filter(|s| s.failure.is_some()).count();
    if failed > 0 {
        let _ = writeln!(text, "{failed} sets without a diagnosis: counted as wrong");
    }
    let _ = write!(text, "sha256 of seal.json {}", proof.seal_sha256);
    text
}

/// Single causes: what they are, and what their strength is in.
const KINDS: [(&str, &str, &str); 4] = [
    ("rays/single", "one cause of the catalogue, by rays", "nats"),
    ("rays/outside", "one cause outside the catalogue, by rays", "nats"),
    ("light/single", "one cause with a name in the catalogue, by light", "of size"),
    ("light/nameless", "one cause without a name in the catalogue, by light", "of size"),
];

/// A line for each strength.
fn strengths(levels: &BTreeMap<String, BTreeMap<String, Rate>>, unit: &str) -> String {
    let mut text = String::new();
    for (level, rates) in levels {
        let level = level.trim_start_matches('0');
        let level =
            if unit == "nats" { format!("{level} {unit}") } else { format!("{unit} {level}") };
        let _ = write!(text, "{level:>12}: ");
        let told = [
            ("detected", "seen"),
            ("first_name", "right first name, of those seen,"),
            ("abstained", "called unexplained in the right place"),
        ];
        let parts = told.iter().filter_map(|(mark, words)| {
            let rate = rates.get(*mark)?;
            Some(format!("{words} {} of {}, {}", rate.k, rate.n, percent(rate)))
        });
        text += &parts.collect::<Vec<_>>().join("; ");
        text += "\n";
    }
    text
}

/// The second round in a few lines.
fn advised(proof: &Proof) -> String {
    let Some(second) = &proof.second else { return String::new() };
    let scores = &second.scores;
    let mut text = format!("\nadvised views taken: {}\n", scores.sets);
    let told = [
        ("right_in_doubt", "the right name is one of the two in doubt"),
        ("surer", "of these, its probability rose"),
        ("led_before", "it led before"),
        ("leads_after", "it leads with the view"),
        ("settled", "it leads with 0.9 or more"),
        ("settled_as_promised", "the same, where the advice expected it"),
        ("misled", "neither name in doubt is right, and some wrong one became sure"),
    ];
    for (mark, words) in told {
        if let Some(rate) = scores.all.get(mark) {
            let _ = writeln!(text, "  {words}: {} of {}, {}", rate.k, rate.n, percent(rate));
        }
    }
    text
}

fn others(scores: &Scores) -> String {
    let mut text = String::new();
    if let (Some(ece), Some(brier)) = (scores.certainty.ece, scores.certainty.brier) {
        let n = scores.certainty.n;
        let _ =
            writeln!(text, "stated probabilities: off by {ece:.3}, Brier {brier:.3} ({n} names)");
    }
    if let (Some(error), Some(coverage)) = (scores.parameter_error, &scores.coverage) {
        let off = 100.0 * error;
        let _ = writeln!(
            text,
            "parameters: median error {off:.0} %, 90 % intervals hold {}",
            percent(coverage)
        );
    }
    for (method, learnt) in &scores.learnt {
        let of = |r: Option<f64>| r.map_or("-".into(), |m| format!("{m:.2}"));
        let _ = writeln!(
            text,
            "gain of {method:<12} over the oracle's: {} inside, {} outside",
            of(learnt.within.map(|r| r.median)),
            of(learnt.beyond.map(|r| r.median))
        );
    }
    text
}

fn percent(rate: &Rate) -> String {
    let [low, high] = rate.interval.map(|p| 100.0 * p);
    format!("{:.0} % [{low:.0}, {high:.0}]", 100.0 * rate.rate)
}

fn endpoint(e: &Endpoint) -> String {
    let Some(value) = e.value else { return format!("  {:<14} not measured\n", e.id) };
    let interval = e.interval.map_or(String::new(), |[a, b]| format!(" [{a:.3}, {b:.3}]"));
    format!(
        "  {:<14} {value:.3}{interval} of {}: {}; beyond chance: {}\n",
        e.id,
        e.n,
        word(e.reached),
        word(e.shown)
    )
}

fn word(level: Level) -> &'static str {
    match level {
        Level::Neither => "neither",
        Level::Good => "good",
        Level::Extraordinary => "extraordinary",
    }
}

/// What was checked, what does not hold.
pub fn checked(checked: &Checked) -> String {
    let mut lines: Vec<String> = checked.checked.iter().map(|c| format!("checked: {c}")).collect();
    lines.extend(checked.remarks.iter().map(|r| format!("note: {r}")));
    lines.extend(checked.faults.iter().map(|f| format!("DOES NOT HOLD: {f}")));
    lines.push(match checked.faults.len() {
        0 => "the proof holds".into(),
        n => format!("the proof does not hold: {n} faults"),
    });
    lines.join("\n")
}
