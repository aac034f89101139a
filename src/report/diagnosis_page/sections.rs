//! The sections of the page except those of the findings, one function each.

use maud::{Markup, html};

use super::sentences::{
    along, axis, called, capital, interval, join, missing, mm, sentence, statistic, title,
};
use super::story::{smooth_residual, story};
use super::{parameters, sentences};
use crate::diagnose::{CannotTell, Diagnosis, MapRow, Verdict, ViewLine};
use crate::report::document::{
    self, Column, answer, fold, list, prose, row, section, table, table_of,
};
use crate::report::numbers::{count, degrees, fixed, nats, p_value, significant};
use crate::terms::Statistic;

/// Rows of the map shown open; the rest is folded.
const OPEN_ROWS: usize = 12;
/// Longest list that is not folded.
const MAX_OPEN: usize = 6;
const PX_DECIMALS: usize = 3;

pub(super) fn verdict(diagnosis: &Diagnosis) -> Markup {
    let it = sentences::subject(diagnosis);
    let (class, mark, sentence) = match diagnosis.verdict {
        Verdict::Match => ("good", "Match", format!("The {it} reproduces this recording.")),
        Verdict::Mismatch => {
            ("bad", "Mismatch", format!("The {it} does not reproduce this recording."))
        }
        Verdict::Inconclusive => {
            let sentence = format!("Whether the {it} reproduces this recording is not settled.");
            ("unsure", "Not settled", sentence)
        }
    };
    let more = html! {
        @for sentence in story(diagnosis) { p { (prose(&sentence)) } }
        (tiles(diagnosis))
    };
    answer(class, mark, &sentence, &more)
}

/// Key numbers below the verdict.
fn tiles(diagnosis: &Diagnosis) -> Markup {
    let held = diagnosis.views.iter().filter(|v| v.held_out).count();
    let held = format!("{held} of them kept out for the final test");
    let found = missing(&diagnosis.findings);
    let (number, largest) = match found.first() {
        Some(largest) => (found.len().to_string(), format!("largest: {}", called(largest))),
        None => ("none found".into(), "see what could have been seen".into()),
    };
    let remaining = match (diagnosis.after.verdict, diagnosis.after.remaining.len()) {
        (Verdict::Match, _) => "nothing".into(),
        (Verdict::Mismatch, 0) => "still a mismatch".into(),
        (_, 0) => "not settled".into(),
        (_, left) => count(left, "difference"),
    };
    let mut tiles = vec![
        ("recording", capital(&count(diagnosis.views.len(), "view")), held),
        ("effects left out", capital(&number), largest),
    ];
    if let Some([before, after]) = diagnosis.heldout.as_ref().and_then(smooth_residual) {
        let change = format!("{before} → {after}");
        tiles.push(("smooth residual, views kept out", change, "rms, before and after".into()));
    }
    if !diagnosis.findings.is_empty() {
        let again = "when the tests are run again".into();
        tiles.push(("still unexplained", capital(&remaining), again));
    }
    document::tiles(tiles)
}

/// Result on the held-out views.
pub(super) fn held_out(diagnosis: &Diagnosis) -> Markup {
    let Some(held) = &diagnosis.heldout else { return html! {} };
    let not_scored = diagnosis.has_no_score();
    let [gain, low, high] = nats([held.gain, held.gain_interval[0], held.gain_interval[1]]);
    let px = |v| format!("{} px", fixed(v, PX_DECIMALS));
    let every = "every pixel of every frame, noise included, rms";
    let score = [held.log_score_before, held.log_score_after].map(|v| fixed(v, 1));
    let corrected = [held.correction_rms_before_px, held.correction_rms_after_px].map(px);
    let rows = [
        row!["smooth residual, rms", mm(held.rms_mm_before), mm(held.rms_mm_after)],
        row![every, px(held.rms_px_before), px(held.rms_px_after)],
        row!["the same after kinoise correct alone", corrected[0], corrected[1]],
        row!["log score, nats a view", score[0], score[1]],
    ];
    let content = html! {
        p {
            "Tested on " (count(held.views.len(), "view")) " that took no part in the search: "
            span.units { (held.views.join(", ")) } "."
        }
        (table(&["", ">before", ">after"], rows))
        @if not_scored {
            p { "What was found has no part in this score." }
        } @else { p {
            @if held.is_clear { "The extended model predicts such a view better by " }
            @else { "No gain beyond chance: the extended model differs by " }
            b { (gain) " nats a view" }
            " (95 % interval " (low) " to " (high) ", by the scatter of the views). "
            span.units { "A nat more makes what was recorded e ≈ 2.7 times as probable." }
        } }
    };
    section("What was gained", &content)
}

/// Results of the same tests against the extended model.
pub(super) fn remaining(diagnosis: &Diagnosis) -> Markup {
    let after = &diagnosis.after;
    if diagnosis.findings.is_empty() && after.remaining.is_empty() {
        return html! {};
    }
    let content = html! {
        p {
            "The same tests against the extended model: "
            @match after.verdict {
                Verdict::Match => "match. Nothing differs beyond chance.",
                Verdict::Mismatch => "still a mismatch.",
                Verdict::Inconclusive => "not settled.",
            }
        }
        (list(after.remaining.iter().map(|r| html! {
            b { (capital(statistic(r.statistic))) } " " (along(r.axis))
            @if !r.words.is_empty() { ": " (prose(&r.words)) } @if let Some(p) = r.p_adjusted { " (" (p_value(p)) ")" }
        })))
    };
    section("What remains", &content)
}

/// What was looked for and the smallest detectable effects, which tell what the absence of a finding is
/// worth.
pub(super) fn detectable(diagnosis: &Diagnosis) -> Markup {
    let names: Vec<String> =
        diagnosis.detectable.iter().map(|d| title(d.effect).to_string()).collect();
    let rows = diagnosis.detectable.iter().filter_map(|d| {
        let (strength, size) = d.minimum.iter().next()?;
        let smallest = html! {
            (parameters::title(strength)) " " b { (parameters::value(Some(d.effect), strength, size, 2)) }
            @for (key, value) in d.minimum.iter().skip(1) {
                ", at a " (parameters::title(key)) " of " (parameters::value(Some(d.effect), key, value, 2))
            }
        };
        let description = parameters::description(Some(d.effect), strength);
        Some(row![capital(title(d.effect)), smallest, description])
    });
    let looked_for = html! {
        @if names.is_empty() { p { "Every effect of the catalogue, and curves without a name over every axis." } }
        @else {
            p {
                "Effects of the catalogue (" (join(&names, "and")) "), and curves without a name. None of them \
                 stands out from chance."
            }
        }
    };
    let smallest = html! {
        (table(&["effect", "smallest that would be seen", "~what the number is"], rows))
        p.note { "With a power of 80 %: four of five recordings like this one would show an effect this large." }
    };
    html! {
        @if diagnosis.verdict == Verdict::Match { (section("What was looked for", &looked_for)) }
        @if !names.is_empty() { (section("How small an effect these views could have shown", &smallest)) }
    }
}

pub(super) fn cannot_tell(all: &[CannotTell]) -> Markup {
    let items = list(all.iter().map(|c| {
        html! { b { (capital(title(c.effect))) } ": " (prose(&sentence(&c.why))) }
    }));
    let items = match all.len() > MAX_OPEN {
        true => fold(&capital(&count(all.len(), "effect")), true, &items),
        false => items,
    };
    html! { @if !all.is_empty() { (section("What these views cannot show", &items)) } }
}

/// Table of every located mismatch.
pub(super) fn map(rows: &[MapRow]) -> Markup {
    let columns = [">no.", "what is off", "along", "where", ">size", ">chance"];
    let cells = |(i, r): (usize, &MapRow)| {
        let place = interval(r.axis, r.interval, r.unit);
        let (what, size) = (capital(statistic(r.statistic)), effect_size(r));
        row![i + 1, what, axis(r.axis), place, size, p_value(r.p_adjusted)]
    };
    let numbered = || rows.iter().enumerate();
    let content = html! {
        (table(&columns, numbered().take(OPEN_ROWS).map(cells)))
        @if rows.len() > OPEN_ROWS {
            @let rest = table(&columns, numbered().skip(OPEN_ROWS).map(cells));
            (fold(&format!("{} more", rows.len() - OPEN_ROWS), false, &rest))
        }
        p.note {
            "Each place where the two differ beyond chance, tested one by one; one effect shows at many places. Size of \
             an error: in units of σ of a single reading; of all else: as a share of the model's value. p: corrected \
             for the number of places searched."
        }
    };
    html! { @if !rows.is_empty() { (section("Where model and recording differ", &content)) } }
}

fn effect_size(row: &MapRow) -> Markup {
    let sign = if row.effect_size > 0.0 { "+" } else { "" };
    match row.statistic {
        Statistic::Bias => html! { (sign) (significant(row.effect_size, 2)) " σ" },
        _ => html! { (sign) (significant(100.0 * row.effect_size, 2)) " %" },
    }
}

pub(super) fn views(views: &[ViewLine]) -> Markup {
    let columns: [Column<'_, ViewLine>; 9] = [
        ("view", &|v| html! { (v.name) }),
        (">z m", &|v| html! { (fixed(v.z_m, 3)) }),
        (">tilt θ °", &|v| html! { (degrees(v.theta_rad)) }),
        (">azimuth °", &|v| html! { (degrees(v.azimuth_rad)) }),
        (">frames", &|v| html! { (v.frames) }),
        (">pixels", &|v| html! { (v.pixels) }),
        (">smooth residual before px", &|v| html! { (fixed(v.bowl_px_before, PX_DECIMALS)) }),
        (">after px", &|v| html! { (fixed(v.bowl_px_after, PX_DECIMALS)) }),
        ("used for", &|v| html! { @if v.held_out { b { "final test" } } @else { "search" } }),
    ];
    let content = html! {
        (table_of(&columns, views))
        p.note {
            "Smooth residual: root mean square over the view, px of disparity. Azimuth: towards the target's far \
             side, 0 is right and 90 down."
        }
    };
    html! { @if !views.is_empty() { (section("Views", &content)) } }
}

pub(super) fn remarks(remarks: &[String]) -> Markup {
    let items = list(remarks.iter().map(|remark| prose(remark)));
    html! { @if !remarks.is_empty() { (section("Remarks", &items)) } }
}
