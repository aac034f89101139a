//! First part of the page: what a user may and may not rely on, in sentences with figures.

use std::collections::BTreeMap;

use kinoise::report::document::{answer, section};
use maud::{Markup, html};

use crate::judge::{Level, Rate, Rates};
use crate::proof::Proof;

/// Threshold of "mostly", four of five: the usual power of a test, and the mark for a right first name.
const MOSTLY: f64 = 0.8;
/// A name that is stated with this probability or more is stated as certain.
const CERTAIN: f64 = 0.9;
/// Minimum number of times that a name must be stated to be listed.
const MIN_SETS: usize = 5;

/// A sentence, and whether it is good news.
type Line = (bool, String);

pub fn reliance(proof: &Proof) -> Markup {
    let parts = [endpoints(proof), seen(proof), names(proof), other(proof)];
    let (good, bad): (Vec<Line>, Vec<Line>) = parts.into_iter().flatten().partition(|line| line.0);
    let list = |lines: &[Line]| html! { ul { @for (_, text) in lines { li { (text) } } } };
    let sentence = format!(
        "{} concealed sets were diagnosed without knowing what was in them.",
        proof.sets.len()
    );
    html! {
        (answer(if bad.is_empty() { "good" } else { "unsure" }, "What it is worth", &sentence, &html! {
            p.note { "In brackets: 95 % intervals. “Mostly” is four of five." }
        }))
        (section("What a user may rely on", &list(&good)))
        (section("What a user may not rely on", &list(&bad)))
    }
}

fn percent(x: f64) -> String {
    format!("{:.0} %", 100.0 * x)
}

fn of(rate: &Rate) -> String {
    let [low, high] = rate.interval.map(|x| format!("{:.0}", 100.0 * x));
    format!("{} of {} ({low} to {high} %)", rate.k, rate.n)
}

/// The endpoints, chosen in advance.
fn endpoints(proof: &Proof) -> Vec<Line> {
    let line = |e: &crate::judge::Endpoint| {
        let (value, [low, high]) = (e.value?, e.interval?);
        let range = |low: f64, high: f64| format!("({:.0} to {:.0} %)", 100.0 * low, 100.0 * high);
        let (share, of) = (percent(value), format!("of {} sets", e.n));
        let text = match e.id.as_str() {
            "false-alarms" => format!(
                "Silence where nothing is hidden: {} {of} {} raise no alarm.",
                percent(1.0 - value),
                range(1.0 - high, 1.0 - low)
            ),
            "first-name" => format!(
                "The first name: right in {share} {of} {} with one cause of the catalogue, worth 50 nats or more.",
                range(low, high)
            ),
            "abstention" => format!(
                "“Unexplained”: a cause that the catalogue lacks is called so, at the right place, in {share} {of} {}.",
                range(low, high)
            ),
            "gain" => format!(
                "The extended model inside the recording's distances and tilts: {share} {} of what is gained by who \
                 knows the truth (median {of}).",
                range(low, high)
            ),
            "extrapolation" => format!(
                "The extended model outside them: {share} {} of it (median {of}).",
                range(low, high)
            ),
            _ => return None,
        };
        Some((e.reached != Level::Neither, text))
    };
    proof.scores.endpoints.iter().filter_map(line).collect()
}

/// Strength from which single causes are mostly seen.
fn seen(proof: &Proof) -> Vec<Line> {
    let Some(levels) = proof.scores.by_strength.get("rays/single") else { return Vec::new() };
    let rates: Vec<(&str, &Rate)> = levels
        .iter()
        .filter_map(|(nats, rates)| Some((nats.trim_start_matches('0'), rates.get("detected")?)))
        .collect();
    let weak = rates.iter().rposition(|(_, r)| r.rate < MOSTLY).map_or(0, |i| i + 1);
    let strong = rates.get(weak).map(|(nats, r)| {
        (
            true,
            format!("A cause worth {nats} nats or more is mostly seen: at {nats}, in {}.", of(r)),
        )
    });
    let missed = weak.checked_sub(1).map(|i| {
        let (nats, r) = rates[i];
        (
            false,
            format!(
                "“Match” does not exclude a cause worth {nats} nats or less: seen in {}.",
                of(r)
            ),
        )
    });
    strong.into_iter().chain(missed).collect()
}

/// How often stated names are right, by probability and by name.
fn names(proof: &Proof) -> Vec<Line> {
    let stated = || proof.sets.iter().flat_map(|s| &s.marks.stated);
    let certain = Rate::of(stated().filter(|s| s.probability >= CERTAIN).map(|s| s.right));
    let other = Rate::of(stated().filter(|s| s.probability < CERTAIN).map(|s| s.right));
    let mut lines = Vec::new();
    lines.extend(certain.map(|r| {
        (r.rate >= CERTAIN, format!("A name stated with 90 % or more: right in {}.", of(&r)))
    }));
    lines.extend(other.map(|r| {
        let text = format!(
            "A name stated with less: right in {}; take the view that it asks for first.",
            of(&r)
        );
        (r.rate >= MOSTLY, text)
    }));
    let mut each: BTreeMap<&str, Vec<bool>> = BTreeMap::new();
    for s in stated() {
        each.entry(&s.effect).or_default().push(s.right);
    }
    let rates =
        each.into_iter().filter_map(|(name, right)| Some((name, Rate::of(right.into_iter())?)));
    let (sure, doubtful): (Vec<_>, Vec<_>) =
        rates.filter(|(_, r)| r.n >= MIN_SETS).partition(|(_, r)| r.rate >= MOSTLY);
    let told = |names: &[(&str, Rate)]| {
        let names: Vec<String> =
            names.iter().map(|(n, r)| format!("{n} {}/{}", r.k, r.n)).collect();
        names.join(", ")
    };
    if !sure.is_empty() {
        lines.push((true, format!("Names that are mostly right when said: {}.", told(&sure))));
    }
    if !doubtful.is_empty() {
        lines.push((false, format!("Names that are wrong more often: {}.", told(&doubtful))));
    }
    lines
}

/// Interval coverage, alarms on halves, blindness, changed units, advised views.
fn other(proof: &Proof) -> Vec<Line> {
    let scores = &proof.scores;
    let kind = |kind: &str, question: &str| -> Option<&Rate> {
        scores.by_kind.get(kind).and_then(|rates: &Rates| rates.get(question))
    };
    let coverage = scores.coverage.as_ref().map(|r| {
        (
            r.interval[1] >= CERTAIN,
            format!("A parameter's 90 % interval holds the truth in {}.", of(r)),
        )
    });
    let alarms = kind("real/halves", "false_alarm").map(|r| {
        let text = "Half of a real recording against a model of the other half: alarm in";
        (r.rate <= 1.0 - MOSTLY, format!("{text} {}.", of(r)))
    });
    let mostly = |rate: Option<&Rate>, text: &str| {
        rate.map(|r| (r.rate >= MOSTLY, format!("{text}: {}.", of(r))))
    };
    [
        coverage,
        alarms,
        mostly(
            kind("real/amnesia", "first_name"),
            "The first name on a real recording whose model was robbed of a term, of those seen",
        ),
        mostly(kind("rays/blind", "said_blind"), "What planes cannot show is said to be so"),
        mostly(
            kind("rays/drift", "recalibrate"),
            "A unit that has changed is sent back to calibration",
        ),
        mostly(scores.advice.as_ref(), "The view that is asked for settles the name"),
    ]
    .into_iter()
    .flatten()
    .collect()
}
