//! The sections of the page, one function each.

use maud::{Markup, PreEscaped, html};
use serde_json::Value;

use super::sentences::{
    advice, axis, badge, called, capital, chance, description, interval, join, missing, physics,
    sentence, statistic, title,
};
use super::{curve, parameters, sentences};
use crate::diagnose::{CannotTell, Diagnosis, Finding, HeldOut, MapRow, Status, Verdict, ViewLine};
use crate::error::Result;
use crate::report::document::{facts, fold, list, row, table};
use crate::report::numbers::{count, degrees, fixed, millimetres, p_value, percent, significant};
use crate::terms::Statistic;

/// Rows of the map that are open; the rest folds away.
const OPEN_ROWS: usize = 12;
/// Longer lists fold away.
const MAX_OPEN: usize = 6;
const PX_DECIMALS: usize = 3;
/// Smaller probabilities are nil.
const MIN_PROBABILITY: f64 = 0.0005;

pub(super) fn verdict(diagnosis: &Diagnosis) -> Markup {
    let (class, mark) = match diagnosis.verdict {
        Verdict::Match => ("match", "Match"),
        Verdict::Mismatch => ("mismatch", "Mismatch"),
        Verdict::Inconclusive => ("inconclusive", "Not settled"),
    };
    html! {
        section class={ "verdict " (class) } {
            p.mark { (mark) }
            p.sentence { (sentences::verdict(diagnosis)) }
            div.tiles { @for [label, big, note] in tiles(diagnosis) { div {
                p.label { (label) }
                p.big { (capital(&big)) }
                p.label { (note) }
            } } }
        }
    }
}

/// Label, value and remark of the numbers that go with the verdict.
fn tiles(diagnosis: &Diagnosis) -> Vec<[String; 3]> {
    let held = diagnosis.views.iter().filter(|v| v.held_out).count();
    let found = missing(&diagnosis.findings);
    let views = count(diagnosis.views.len(), "view");
    let mut tiles =
        vec![["Recording".into(), views, format!("{held} of them held out for the final test")]];
    tiles.push(match found.first() {
        Some(first) => [
            "Effects left out".into(),
            found.len().to_string(),
            format!("largest: {}", called(first)),
        ],
        None => {
            ["Effects left out".into(), "none found".into(), "see what could have been seen".into()]
        }
    });
    tiles.extend(diagnosis.heldout.as_ref().map(|held| {
        let [before, after] = [held.rms_mm_before, held.rms_mm_after].map(mm);
        [
            "Steady error, held-out views".into(),
            format!("{before} → {after}"),
            "before and after".into(),
        ]
    }));
    if !diagnosis.findings.is_empty() {
        let left = match (diagnosis.after.verdict, diagnosis.after.remaining.len()) {
            (Verdict::Match, _) => "nothing".into(),
            (_, 0) => "not settled".into(),
            (_, left) => count(left, "difference"),
        };
        tiles.push(["Still unexplained".into(), left, "when the tests are run again".into()]);
    }
    tiles
}

/// A card for each finding.
pub(super) fn findings(findings: &[Finding]) -> Result<Markup> {
    let cards = findings.iter().enumerate().map(card).collect::<Result<Vec<Markup>>>()?;
    Ok(html! { @if !cards.is_empty() { section.cards { @for card in cards { (card) } } } })
}

fn card((i, finding): (usize, &Finding)) -> Result<Markup> {
    let picture = finding.curve.as_ref().and_then(curve::chart).map(|c| c.svg()).transpose()?;
    let (class, badge) = badge(finding.status);
    Ok(html! {
        article.card {
            header {
                h2 { (i + 1) ". " (capital(&called(finding))) }
                span class={ "badge " (class) } { (badge) }
            }
            p.lead { (physics(finding)) }
            div.halves {
                (facts(finding_facts(finding)))
                @if let Some(svg) = picture { figure {
                    div.drawing role="img" aria-label={ "curve of " (called(finding)) } { (PreEscaped(svg)) }
                    figcaption {
                        span.dot {} " measured ± standard error " span.line {}
                        @if finding.status == Status::Unexplained { " curve given to the simulation" }
                        @else { " simulation with it added" }
                    }
                } }
            }
            (alternatives(finding))
            @if let Some(advice) = advice(finding) { div.todo { p { b { "What to do. " } (advice) } } }
        }
    })
}

/// Those that are known.
fn finding_facts(finding: &Finding) -> Vec<(String, Markup)> {
    let place = interval(finding.axis, finding.interval, finding.unit);
    let mut facts = vec![
        ("What is off".into(), html! { (capital(statistic(finding.statistic))) }),
        ("Where".into(), html! { (capital(axis(finding.axis))) ": " b { (place) } }),
    ];
    facts.extend(size(finding).map(|size| ("How large".into(), size)));
    if finding.status != Status::NotIdentifiable {
        facts.push(("How sure".into(), certainty(finding)));
        facts.extend(share(finding).map(|share| ("Share".into(), share)));
    }
    facts.extend(finding.parameters.iter().map(|(k, v)| parameter(finding.effect, k, v)));
    facts
}

fn share(finding: &Finding) -> Option<Markup> {
    let percent = (100.0 * finding.share).clamp(0.0, 100.0);
    finding.share.is_finite().then(|| {
        html! {
            span.bar { span style={ "width:" (format!("{percent:.0}")) "%" } {} }
            " " b { (fixed(percent, 0)) " %" } " of all that was explained"
        }
    })
}

fn size(finding: &Finding) -> Option<Markup> {
    let size = finding.size;
    let noise =
        if finding.statistic == Statistic::Bias { "of a single reading" } else { "in the model" };
    (size.mm.abs() > 0.0 || size.sigma.abs() > 0.0).then(|| html! {
        @if finding.statistic == Statistic::Dropout {
            b { (percent(size.sigma)) } " of the pixels are lost"
        } @else {
            b { (mm(size.mm)) } " rms, " b { (significant(size.sigma, 2)) " times" } " the noise " (noise)
        }
    })
}

fn certainty(finding: &Finding) -> Markup {
    html! {
        (capital(&chance(finding.p_adjusted)))
        @if finding.p_adjusted.is_finite() { " (" (p_value(finding.p_adjusted)) ")" }
    }
}

/// `amplitude_px = 0.3 ± 0.1 px`, and what that is.
fn parameter(effect: Option<&str>, name: &str, value: &Value) -> (String, Markup) {
    let description = parameters::description(effect, name);
    let value = html! {
        b { (parameters::value(name, value, 3)) }
        @if !description.is_empty() { ": " (description) }
    };
    (name.into(), value)
}

/// Every effect that it could be, best first.
fn alternatives(finding: &Finding) -> Markup {
    let none = 1.0 - finding.alternatives.iter().map(|a| a.probability).sum::<f64>();
    let effects = finding.alternatives.iter().map(|a| {
        html! {
            b { (percent(a.probability)) " " (title(a.effect)) }
            ": " (description(a.effect)) " " code { (a.effect) }
        }
    });
    let none = (none > MIN_PROBABILITY).then(|| html! { b { (percent(none)) " none of these" } });
    html! { @if !finding.alternatives.is_empty() {
        h3 { "What it could be" }
        (list(effects.chain(none)))
    } }
}

/// The final test.
pub(super) fn held_out(held: Option<&HeldOut>) -> Markup {
    let Some(held) = held else { return html! {} };
    let [low, high] = held.gain_interval;
    let gain = |v: f64| fixed(v, usize::from(held.gain.abs() < 10.0));
    let px = |v| format!("{} px", fixed(v, PX_DECIMALS));
    let rows = [
        row!["steady error, rms", mm(held.rms_mm_before), mm(held.rms_mm_after)],
        row![
            "every pixel of every frame, noise included, rms",
            px(held.rms_px_before),
            px(held.rms_px_after)
        ],
        row![
            "log score, nats a view",
            fixed(held.log_score_before, 1),
            fixed(held.log_score_after, 1)
        ],
    ];
    html! { div {
        h2 { "What was gained" }
        p {
            "Tested on " (count(held.views.len(), "view")) " that took no part in the search: "
            span.units { (held.views.join(", ")) } "."
        }
        (table(&["", ">before", ">after"], rows))
        p {
            @if low > 0.0 { "The extended model predicts such a view better by " }
            @else { "No gain beyond chance: the extended model differs by " }
            b { (gain(held.gain)) " nats a view" }
            " (95 % interval " (gain(low)) " to " (gain(high)) ", by resampling views). "
            span.units { "A nat more makes what was recorded e ≈ 2.7 times as probable." }
        }
    } }
}

/// The same tests against the extended model.
pub(super) fn remaining(diagnosis: &Diagnosis) -> Markup {
    let after = &diagnosis.after;
    if diagnosis.findings.is_empty() && after.remaining.is_empty() {
        return html! {};
    }
    html! { div {
        h2 { "What remains" }
        p {
            "The same tests against the extended model: "
            @match after.verdict {
                Verdict::Match => "match. Nothing differs beyond chance.",
                Verdict::Mismatch => "still a mismatch.",
                Verdict::Inconclusive => "not settled.",
            }
        }
        (list(after.remaining.iter().map(|r| html! {
            b { (capital(statistic(r.statistic))) } " over the " (axis(r.axis))
            @if !r.words.is_empty() { ": " (r.words) } " (" (p_value(r.p_adjusted)) ")"
        })))
    } }
}

/// What the absence of a finding is worth.
pub(super) fn detectable(diagnosis: &Diagnosis) -> Markup {
    let names: Vec<String> =
        diagnosis.detectable.iter().map(|d| title(d.effect).to_string()).collect();
    let rows = diagnosis.detectable.iter().filter_map(|d| {
        let (strength, least) = d.minimum.iter().next()?;
        let smallest = html! {
            (parameters::title(strength)) " " b { (parameters::value(strength, least, 2)) }
            @for (key, value) in d.minimum.iter().skip(1) {
                ", at a " (parameters::title(key)) " of " (parameters::value(key, value, 2))
            }
        };
        let description = parameters::description(Some(d.effect), strength);
        Some(row![capital(title(d.effect)), smallest, description])
    });
    html! { section {
        @if diagnosis.verdict == Verdict::Match {
            h2 { "What was looked for" }
            @if names.is_empty() { p { "Every effect of the catalogue, and curves without a name over every axis." } }
            @else {
                p {
                    "Effects of the catalogue (" (join(&names, "and")) "), and curves without a name. None of them \
                     stands out from chance."
                }
            }
        }
        @if !names.is_empty() {
            h2 { "How small an effect these views could have shown" }
            (table(&["effect", "smallest that would be seen", "~what the number is"], rows))
            p.note { "With a power of 80 %: four of five recordings like this one would show an effect this large." }
        }
    } }
}

pub(super) fn cannot_tell(all: &[CannotTell]) -> Markup {
    let items = list(all.iter().map(|c| {
        html! { b { (capital(title(c.effect))) } ": " (sentence(&c.why)) }
    }));
    html! { @if !all.is_empty() { section {
        h2 { "What these views cannot show" }
        @if all.len() <= MAX_OPEN { (items) } @else { (fold(&capital(&count(all.len(), "effect")), true, &items)) }
    } } }
}

/// Every located mismatch.
pub(super) fn map(rows: &[MapRow]) -> Markup {
    let columns = [">", "what is off", "along", "where", ">size", ">chance"];
    let cells = |(i, r): (usize, &MapRow)| {
        row![
            i + 1,
            capital(statistic(r.statistic)),
            axis(r.axis),
            interval(r.axis, r.interval, r.unit),
            effect_size(r),
            p_value(r.p_adjusted),
        ]
    };
    let numbered = || rows.iter().enumerate();
    html! { @if !rows.is_empty() { section {
        h2 { "Where model and recording differ" }
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
    } } }
}

fn effect_size(row: &MapRow) -> Markup {
    let sign = if row.effect_size > 0.0 { "+" } else { "" };
    match row.statistic {
        Statistic::Bias => html! { (sign) (significant(row.effect_size, 2)) " σ" },
        _ => html! { (sign) (significant(100.0 * row.effect_size, 2)) " %" },
    }
}

pub(super) fn views(views: &[ViewLine]) -> Markup {
    let columns = [
        "view",
        ">distance m",
        ">tilt °",
        ">azimuth °",
        ">frames",
        ">pixels",
        ">steady error before px",
        ">after px",
        "used for",
    ];
    let cells = |v: &ViewLine| {
        row![
            v.name,
            fixed(v.z_m, 3),
            degrees(v.theta_rad),
            degrees(v.azimuth_rad),
            v.frames,
            v.pixels,
            fixed(v.bowl_px_before, PX_DECIMALS),
            fixed(v.bowl_px_after, PX_DECIMALS),
            html! { @if v.held_out { b { "final test" } } @else { "search" } },
        ]
    };
    html! { @if !views.is_empty() { section {
        h2 { "Views" }
        (table(&columns, views.iter().map(cells)))
        p.note {
            "Steady error: root mean square of the view's smooth residual, px of disparity. Azimuth: towards the \
             target's far side, 0 is right and 90 down."
        }
    } } }
}

pub(super) fn remarks(remarks: &[String]) -> Markup {
    html! { @if !remarks.is_empty() { section {
        h2 { "Remarks" }
        (list(remarks.iter().map(|remark| html! { (remark) })))
    } } }
}

/// Of a size that already is in mm.
fn mm(value: f64) -> String {
    format!("{} mm", millimetres(1e-3 * value))
}
