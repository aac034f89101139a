//! The answer in one sentence, and the three numbers that go with it.

use maud::{Markup, html};

use super::names::name;
use super::words::{axis, capital, count, list, mm};
use crate::diagnose::{Diagnosis, Finding, HeldOut, Reference, Status, Verdict};

pub(super) fn section(diagnosis: &Diagnosis) -> Markup {
    let (class, mark) = match diagnosis.verdict {
        Verdict::Match => ("match", "Match"),
        Verdict::Mismatch => ("mismatch", "Mismatch"),
        Verdict::Inconclusive => ("inconclusive", "Not settled"),
    };
    html! {
        section class={ "verdict " (class) } {
            p.mark { (mark) }
            p.sentence { (sentence(diagnosis)) }
            div.tiles { @for tile in tiles(diagnosis) { div {
                p.label { (tile.label) }
                p.big { (tile.big) }
                p.label { (tile.note) }
            } } }
        }
    }
}

fn sentence(diagnosis: &Diagnosis) -> String {
    match diagnosis.verdict {
        Verdict::Match => format!(
            "The simulation explains this recording: nothing in it differs from {} by more than chance.",
            reference(diagnosis.reference)
        ),
        Verdict::Inconclusive => format!(
            "This recording does not settle whether the simulation is right{}",
            match hints(diagnosis) {
                hints if hints.is_empty() => ".".into(),
                hints => format!("; there are hints of {}.", list(&hints, "and")),
            }
        ),
        Verdict::Mismatch => mismatch(&diagnosis.findings),
    }
}

fn reference(reference: Reference) -> &'static str {
    match reference {
        Reference::Model => "the calibrated model",
        Reference::SimulatedRecording => "the simulated recording",
    }
}

fn hints(diagnosis: &Diagnosis) -> Vec<String> {
    diagnosis.findings.iter().filter(|f| is_physics(f)).map(called).collect()
}

fn mismatch(findings: &[Finding]) -> String {
    let missing: Vec<&Finding> = findings.iter().filter(|f| is_physics(f)).collect();
    let recalibrate = findings.iter().any(|f| f.status == Status::Recalibrate);
    let first = match missing[..] {
        [] if recalibrate => {
            "Nothing is missing from the simulation, but its numbers do not fit this sensor: it must be calibrated again.".into()
        }
        [] => "Simulation and recording differ, and these views cannot tell why.".to_string(),
        [Finding { status: Status::Named, effect: Some(id), .. }] => {
            format!("The simulation leaves one thing out: {}.", name(id).plain)
        }
        ref several => {
            let names: Vec<String> = several.iter().map(|f| called(f)).collect();
            let things = count(several.len(), "thing");
            format!("The simulation leaves {things} out: {}.", list(&names, "and"))
        }
    };
    if recalibrate && !missing.is_empty() {
        return format!("{first} Its own numbers are off as well.");
    }
    first
}

/// Physics that the simulation lacks; the rest is about numbers, or cannot be told.
fn is_physics(finding: &Finding) -> bool {
    matches!(finding.status, Status::Named | Status::OneOf | Status::Unexplained)
}

/// What a finding is called in the middle of a sentence.
pub(super) fn called(finding: &Finding) -> String {
    let alone = finding.effect.map(|id| name(id).short.to_string());
    match finding.status {
        Status::OneOf => {
            let names: Vec<String> =
                rivals(finding).iter().map(|id| name(id).short.into()).collect();
            if names.len() < 2 {
                alone.unwrap_or_else(|| nameless(finding))
            } else {
                list(&names, "or")
            }
        }
        Status::Unexplained => nameless(finding),
        Status::Recalibrate => "numbers of the simulation that are off".into(),
        Status::Named | Status::NotIdentifiable => alone.unwrap_or_else(|| nameless(finding)),
    }
}

fn nameless(finding: &Finding) -> String {
    format!("something without a name that follows the {}", axis(finding.axis))
}

/// The names of a one-of that are worth telling, best first.
pub(super) fn rivals(finding: &Finding) -> Vec<&'static str> {
    /// Less likely ones stay in the table.
    const WORTH_TELLING: f64 = 0.05;
    let likely = finding.alternatives.iter().enumerate();
    likely
        .filter(|(i, a)| *i < 2 || a.probability >= WORTH_TELLING)
        .map(|(_, a)| a.effect)
        .collect()
}

struct Tile {
    label: &'static str,
    big: String,
    note: String,
}

fn tiles(diagnosis: &Diagnosis) -> Vec<Tile> {
    let held = diagnosis.views.iter().filter(|v| v.held_out).count();
    let found = diagnosis.findings.iter().filter(|f| is_physics(f)).count();
    let searched = Tile {
        label: "Recording",
        big: count(diagnosis.views.len(), "view"),
        note: format!("{held} of them set aside for the final test"),
    };
    let causes = Tile {
        label: "Left out of the simulation",
        big: if found == 0 { "nothing found".into() } else { count(found, "thing") },
        note: match diagnosis.findings.first() {
            Some(first) if found > 0 => format!("largest: {}", called(first)),
            _ => "see below what could have been seen".into(),
        },
    };
    let mut tiles = vec![searched, causes];
    tiles.extend(diagnosis.heldout.as_ref().map(gained));
    if !diagnosis.findings.is_empty() {
        tiles.push(remains(diagnosis));
    }
    tiles.iter_mut().for_each(|t| t.big = capital(&t.big));
    tiles
}

fn gained(held: &HeldOut) -> Tile {
    Tile {
        label: "Steady error, views set aside",
        big: format!("{} → {}", mm(held.rms_mm_before), mm(held.rms_mm_after)),
        note: "before and after it was put in".into(),
    }
}

fn remains(diagnosis: &Diagnosis) -> Tile {
    let remaining = diagnosis.after.remaining.len();
    let big = match diagnosis.after.verdict {
        Verdict::Match => "nothing".into(),
        _ if remaining > 0 => count(remaining, "thing"),
        _ => "not settled".into(),
    };
    Tile { label: "Still unexplained", big, note: "when the same tests are run again".into() }
}
