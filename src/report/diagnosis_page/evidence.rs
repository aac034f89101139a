//! The tables behind the answer.

use maud::{Markup, html};

use super::names::name;
use super::parameters;
use super::verdict::called;
use super::words::{axis, capital, interval, mm, p_value, percent, statistic};
use crate::diagnose::{Diagnosis, Finding, HeldOut, MapRow, Verdict, ViewLine};
use crate::report::numbers::{degrees, fixed, significant};
use crate::terms::Statistic;

/// Rows of the map that are open; the rest folds away.
const OPEN_ROWS: usize = 12;
const PX_DECIMALS: usize = 3;

pub(super) fn map(rows: &[MapRow]) -> Markup {
    let (first, rest) = rows.split_at(rows.len().min(OPEN_ROWS));
    html! {
        @if !rows.is_empty() { section {
            h2 { "Where simulation and recording differ" }
            (map_table(first, 0))
            @if !rest.is_empty() { details {
                summary { (rest.len()) " more" }
                (map_table(rest, first.len()))
            } }
            p.note {
                "Each place where the two differ by more than chance makes, one test beside the other; one cause shows at \
                 many places. Size of an error: in noises (σ) of a single reading; of all else: as a share of what was \
                 simulated. p: after correction for the number of places searched."
            }
        } }
    }
}

fn map_table(rows: &[MapRow], before: usize) -> Markup {
    html! {
        div.wide { table {
            thead { tr { th.n { "" } th { "what is off" } th { "along" } th { "where" } th.n { "size" } th.n { "chance" } } }
            tbody { @for (i, r) in rows.iter().enumerate() { tr {
                td.n { (before + i + 1) }
                td { (capital(statistic(r.statistic))) }
                td { (axis(r.axis)) }
                td { (interval(r.axis, r.interval, r.unit)) }
                td.n { (effect_size(r)) }
                td.n { (p_value(r.p_adjusted)) }
            } } }
        } }
    }
}

fn effect_size(row: &MapRow) -> Markup {
    let sign = if row.effect_size > 0.0 { "+" } else { "" };
    match row.statistic {
        Statistic::Bias => html! { (sign) (significant(row.effect_size, 2)) " σ" },
        _ => html! { (sign) (significant(100.0 * row.effect_size, 2)) " %" },
    }
}

pub(super) fn alternatives(findings: &[Finding]) -> Markup {
    html! {
        @if findings.iter().any(|f| !f.alternatives.is_empty()) { section {
            h2 { "What else it could be" }
            div.wide { table {
                thead { tr { th { "finding" } th { "cause" } th { "id" } th.n { "probability" } } }
                tbody {
                    @for (i, f) in findings.iter().enumerate() {
                        @for (k, a) in f.alternatives.iter().enumerate() { tr {
                            th { @if k == 0 { (i + 1) ". " (capital(&called(f))) } }
                            td { (capital(name(a.effect).short)) }
                            td { code { (a.effect) } }
                            td.n { (percent(a.probability)) }
                        } }
                        @let rest = 1.0 - f.alternatives.iter().map(|a| a.probability).sum::<f64>();
                        @if !f.alternatives.is_empty() && rest > 0.0005 { tr {
                            th {} td { "None of these" } td {} td.n { (percent(rest)) }
                        } }
                    }
                }
            } }
        } }
    }
}

pub(super) fn parameters(findings: &[Finding]) -> Markup {
    html! {
        @if findings.iter().any(|f| !f.parameters.is_empty()) { section {
            h2 { "Parameters" }
            div.wide { table {
                thead { tr { th { "finding" } th { "parameter" } th.n { "value ± standard error" } th { "what it is" } } }
                tbody { @for (i, f) in findings.iter().enumerate() {
                    @for (k, (key, value)) in f.parameters.iter().enumerate() { tr {
                        th { @if k == 0 { (i + 1) ". " (capital(&called(f))) } }
                        td { code { (key) } }
                        td.n { (parameters::value(key, value, parameters::DIGITS)) }
                        td.words { (parameters::words(f.effect, key)) }
                    } }
                } }
            } }
        } }
    }
}

pub(super) fn held_out(held: Option<&HeldOut>) -> Markup {
    let Some(held) = held else { return html! {} };
    let [low, high] = held.gain_interval;
    let px = |v| format!("{} px", fixed(v, PX_DECIMALS));
    html! { section {
        h2 { "The final test, on views set aside" }
        div.wide { table {
            thead { tr { th { "" } th.n { "before" } th.n { "after" } } }
            tbody {
                tr { th { "log score, nats a view" } td.n { (fixed(held.log_score_before, 1)) } td.n { (fixed(held.log_score_after, 1)) } }
                tr { th { "steady error, root mean square" } td.n { (mm(held.rms_mm_before)) } td.n { (mm(held.rms_mm_after)) } }
                tr { th { "every pixel of every frame, noise included, root mean square of disparity" }
                    td.n { (px(held.rms_px_before)) } td.n { (px(held.rms_px_after)) } }
            }
        } }
        p { "Gain " b { (fixed(held.gain, 1)) } " nats a view, 95 % interval " (fixed(low, 1)) " to " (fixed(high, 1))
            " by resampling views. Views: " span.units { (held.views.join(", ")) } "." }
    } }
}

/// The same tests once more, against the extended model.
pub(super) fn after(diagnosis: &Diagnosis) -> Markup {
    let after = &diagnosis.after;
    if diagnosis.findings.is_empty() && after.remaining.is_empty() {
        return html! {};
    }
    html! { section {
        h2 { "The same tests once more, with the findings put in" }
        p {
            @match after.verdict {
                Verdict::Match => "Verdict: match.",
                Verdict::Mismatch => "Verdict: still a mismatch.",
                Verdict::Inconclusive => "Verdict: not settled.",
            }
        }
        @if !after.remaining.is_empty() { div.wide { table {
            thead { tr { th { "what is off" } th { "along" } th.n { "chance" } th { "in words" } } }
            tbody { @for r in &after.remaining { tr {
                td { (capital(statistic(r.statistic))) }
                td { (axis(r.axis)) }
                td.n { (p_value(r.p_adjusted)) }
                td.words { (r.words) }
            } } }
        } } }
    } }
}

pub(super) fn views(views: &[ViewLine]) -> Markup {
    html! {
        @if !views.is_empty() { section {
            h2 { "Views" }
            div.wide { table.small {
                thead { tr {
                    th { "view" } th.n { "distance m" } th.n { "slant °" } th.n { "direction °" } th.n { "frames" }
                    th.n { "pixels" } th.n { "steady error before px" } th.n { "after px" } th { "used for" }
                } }
                tbody { @for v in views { tr {
                    th { (v.name) }
                    td.n { (fixed(v.z_m, 3)) }
                    td.n { (degrees(v.theta_rad)) }
                    td.n { (degrees(v.azimuth_rad)) }
                    td.n { (v.frames) }
                    td.n { (v.pixels) }
                    td.n { (fixed(v.bowl_px_before, PX_DECIMALS)) }
                    td.n { (fixed(v.bowl_px_after, PX_DECIMALS)) }
                    td { @if v.held_out { b { "final test" } } @else { "search" } }
                } } }
            } }
            p.note {
                "Steady error: root mean square of the view's smooth residual, px of disparity. Direction: towards the \
                 board's far side, 0 is right and 90 down."
            }
        } }
    }
}

pub(super) fn remarks(remarks: &[String]) -> Markup {
    html! {
        @if !remarks.is_empty() { section {
            h2 { "Remarks" }
            ul { @for remark in remarks { li { (remark) } } }
        } }
    }
}
