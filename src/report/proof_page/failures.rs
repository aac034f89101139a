//! Every failure: what was hidden, what was said, and the curve that led astray.

use maud::{Markup, html};
use serde_json::Value;

use super::sketch::sketch;
use super::words::{cell, count, name, percent, strongest, world};
use crate::prove::{Cell, Hidden, KeptCurve, Proof, ProvenSet};
use crate::report::numbers::significant;

/// The worst first; a set is listed under its worst, with the others as remarks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Fault {
    NoDiagnosis,
    FalseAlarm,
    Masquerade,
    SureAndWrong,
    WrongName,
    WronglyClaimed,
    NotRecalibrated,
    Missed,
}

const FAULTS: [Fault; 8] = [
    Fault::NoDiagnosis,
    Fault::FalseAlarm,
    Fault::Masquerade,
    Fault::SureAndWrong,
    Fault::WrongName,
    Fault::WronglyClaimed,
    Fault::NotRecalibrated,
    Fault::Missed,
];

/// From here on a cause that is missed is listed, nats.
const STRONG: f64 = 500.0;
/// So many pictures in all, and so many sets of a group before the list is folded.
const MAX_PICTURES: usize = 150;
const LONG: usize = 12;

impl Fault {
    fn title(self) -> &'static str {
        match self {
            Fault::NoDiagnosis => "no diagnosis came",
            Fault::FalseAlarm => "false alarm",
            Fault::Masquerade => "masquerade",
            Fault::SureAndWrong => "confident and wrong",
            Fault::WrongName => "wrong first name",
            Fault::WronglyClaimed => "claimed what planes cannot show",
            Fault::NotRecalibrated => "not sent back to calibration",
            Fault::Missed => "missed",
        }
    }

    fn words(self) -> &'static str {
        match self {
            Fault::NoDiagnosis => {
                "The solver stopped, or ran out of time; counted as wrong in every respect."
            }
            Fault::FalseAlarm => "Nothing is hidden, and something was found.",
            Fault::Masquerade => {
                "The catalogue lacks the cause, and a name was given with 0.9 or more."
            }
            Fault::SureAndWrong => "A name that is not hidden was given with 0.9 or more.",
            Fault::WrongName => {
                "Something was seen, and the first thing said of it is not one of the hidden names."
            }
            Fault::WronglyClaimed => {
                "Without a reference distance nothing can be known of this, and something was claimed."
            }
            Fault::NotRecalibrated => {
                "The unit’s own noise has changed, something was found, and the answer was not “recalibrate”."
            }
            Fault::Missed => "A cause worth 500 nats or more, and nothing was found.",
        }
    }

    fn is_of(self, set: &ProvenSet) -> bool {
        let marks = &set.marks;
        let strong = || strongest(&set.truth).is_some_and(|n| n >= STRONG);
        match self {
            Fault::NoDiagnosis => !marks.ran,
            Fault::FalseAlarm => marks.false_alarm == Some(true),
            Fault::Masquerade => marks.masquerade == Some(true),
            Fault::SureAndWrong => marks.confident_wrong == Some(true),
            Fault::WrongName => marks.first_name == Some(false),
            Fault::WronglyClaimed => marks.nothing_claimed == Some(false),
            Fault::NotRecalibrated => {
                marks.recalibrate == Some(false) && marks.detected == Some(true)
            }
            Fault::Missed => marks.detected == Some(false) && strong(),
        }
    }
}

/// All faults of a set, the worst first.
pub(super) fn faults(set: &ProvenSet) -> Vec<Fault> {
    FAULTS.into_iter().filter(|f| f.is_of(set)).collect()
}

type Curve<'a> = &'a dyn Fn(&ProvenSet) -> Option<KeptCurve>;

pub(super) fn section(proof: &Proof, curve: Curve<'_>) -> Markup {
    let failed: Vec<(&ProvenSet, Vec<Fault>)> =
        proof.sets.iter().map(|s| (s, faults(s))).filter(|(_, f)| !f.is_empty()).collect();
    let mut left = MAX_PICTURES;
    let mut groups = Vec::new();
    for fault in FAULTS {
        let of: Vec<_> = failed.iter().filter(|(_, f)| f[0] == fault).collect();
        if !of.is_empty() {
            let cards: Vec<Markup> =
                of.iter().map(|(set, faults)| card(set, faults, curve, &mut left)).collect();
            groups.push((fault, cards));
        }
    }
    html! {
        section {
            h2 { "Every failure" }
            p { b { (failed.len()) " of " (proof.sets.len()) " sets" } " failed in one of these ways; each is listed once, under the worst of them. "
                (weaker(proof)) }
            @for (fault, cards) in &groups { (group(*fault, cards)) }
            @if left == 0 {
                p.note { "Pictures are drawn for the first " (MAX_PICTURES) " only; every curve is in diagnoses/NAME.json, findings[].curve." }
            }
            p.note { "Dots: the first finding’s curve as measured, bars one standard error; line: the extended model. A failure without a picture claimed \
                      nothing, or its diagnosis is not kept beside the page." }
        }
    }
}

/// What is not listed one by one.
fn weaker(proof: &Proof) -> Markup {
    let weak =
        |s: &&ProvenSet| s.marks.ran && s.marks.detected == Some(false) && faults(s).is_empty();
    let misses = proof.sets.iter().filter(weak).count();
    let open = proof.sets.iter().filter(|s| s.marks.abstained == Some(false));
    let unlisted = open.filter(|s| faults(s).is_empty() && s.marks.detected == Some(true)).count();
    html! {
        "Not listed: " (count(misses, "set")) " with something hidden below 500 nats (or, in the world of light, of any size) in which nothing was found, and "
        (count(unlisted, "cause")) " outside the catalogue, seen and given no confident name, yet not called unexplained in the right place. Both are in the rates above."
    }
}

fn group(fault: Fault, cards: &[Markup]) -> Markup {
    html! {
        details.failures open[cards.len() <= LONG] {
            summary { h3 { (capital(fault.title())) ": " (cards.len()) } }
            p.note { (fault.words()) }
            div.cards { @for card in cards { (card) } }
        }
    }
}

fn capital(words: &str) -> String {
    let mut chars = words.chars();
    chars.next().map_or_else(String::new, |c| c.to_uppercase().chain(chars).collect())
}

fn card(set: &ProvenSet, faults: &[Fault], curve: Curve<'_>, left: &mut usize) -> Markup {
    let picture = if *left > 0 { curve(set).as_ref().and_then(sketch) } else { None };
    *left -= usize::from(picture.is_some());
    let asked = &set.truth.asked;
    html! {
        article {
            p.set { code { (set.name) } " · " (world(asked.world)) ", " (cell(asked.cell))
                @for fault in &faults[1..] { " · " b { "also " (fault.title()) } } }
            p { span.label { "Hidden: " } (hidden(&set.truth.hidden)) }
            p { span.label { "Said: " } (said(set)) }
            @if let Some(picture) = picture { (picture) }
        }
    }
}

fn hidden(all: &[Hidden]) -> Markup {
    html! {
        @if all.is_empty() { "nothing." }
        @for (i, h) in all.iter().enumerate() {
            @if i > 0 { "; " }
            b { (name(h)) }
            @for other in h.names.iter().skip(1) { " or " (other) }
            " (" @if !h.names.is_empty() && h.form != name(h) { (h.form) ", " }
            (h.statistic) " over " (h.axis)
            @if let Some(nats) = h.nats.filter(|n| n.is_finite() && *n > 0.0) { ", " (significant(nats, 2)) " nats" } ")"
        }
    }
}

fn text<'a>(value: &'a Value, key: &str) -> Option<&'a str> {
    value.get(key).and_then(Value::as_str)
}

fn said(set: &ProvenSet) -> Markup {
    let Some(verdict) = &set.verdict else {
        return html! { "nothing: " (set.failure.as_deref().unwrap_or("no diagnosis came")) };
    };
    let findings = verdict.get("findings").and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
    let claims: Vec<&Value> =
        findings.iter().filter(|f| text(f, "status") != Some("not-identifiable")).collect();
    let drift = set.truth.asked.cell == Cell::Drift;
    html! {
        (text(verdict, "verdict").unwrap_or("no verdict"))
        @if claims.is_empty() { @if drift { ", nothing to recalibrate" } @else { ", no finding" } }
        @for (i, claim) in claims.iter().enumerate() {
            @if i == 0 { ": " } @else { "; then " }
            (finding(claim))
        }
        "."
    }
}

fn finding(claim: &Value) -> Markup {
    let none = Vec::new();
    let names = claim.get("alternatives").and_then(Value::as_array).unwrap_or(&none);
    let status = text(claim, "status").unwrap_or_default();
    let named = status == "named" || status == "one-of";
    html! {
        b { @match text(claim, "effect").filter(|_| named) { Some(id) => (id), None => (status) } }
        @if named { " (" @for (i, a) in names.iter().take(3).enumerate() {
            @if i > 0 { ", " (text(a, "effect").unwrap_or_default()) " " }
            @if let Some(p) = a.get("probability").and_then(Value::as_f64) { (percent(p)) }
        } ")" }
        " in " (text(claim, "statistic").unwrap_or("?")) " over " (text(claim, "axis").unwrap_or("?"))
        @if let Some(p) = claim.get("p_adjusted").and_then(Value::as_f64) { ", p = " (significant(p, 1)) }
    }
}
