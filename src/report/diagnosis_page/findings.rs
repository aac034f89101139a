//! One card for each thing that was found.

use maud::{Markup, PreEscaped, html};

use super::advice::{advice, sentence};
use super::curve::CurveFigure;
use super::names::name;
use super::verdict::{called, rivals};
use super::words::{axis, capital, chance, interval, list, mm, p_value, percent, statistic};
use crate::diagnose::{Finding, Status};
use crate::error::Result;
use crate::report::numbers::{fixed, significant};
use crate::terms::Statistic;

pub(super) fn section(findings: &[Finding]) -> Result<Markup> {
    let cards = findings.iter().enumerate().map(card).collect::<Result<Vec<Markup>>>()?;
    Ok(html! { @if !cards.is_empty() { section.cards { @for card in cards { (card) } } } })
}

fn card((i, finding): (usize, &Finding)) -> Result<Markup> {
    let picture = finding.curve.as_ref().and_then(CurveFigure::of).map(|f| f.svg()).transpose()?;
    Ok(html! {
        article.card {
            header {
                h2 { (i + 1) ". " (capital(&called(finding))) }
                span class={ "badge " (class(finding.status)) } { (badge(finding.status)) }
            }
            p.lead { (sentence(&lead(finding))) }
            div.halves {
                (facts(finding))
                @if let Some(svg) = picture {
                    figure {
                        div.drawing role="img" aria-label={ "curve of " (called(finding)) } { (PreEscaped(svg)) }
                        figcaption { (key(finding)) }
                    }
                }
            }
            @if !finding.physics.is_empty() { p { b { "Why. " } (sentence(&finding.physics)) } }
            @if let Some(advice) = advice(finding) { (advice) }
        }
    })
}

fn class(status: Status) -> &'static str {
    match status {
        Status::Named => "named",
        Status::OneOf => "one-of",
        Status::Unexplained => "unexplained",
        Status::Recalibrate => "recalibrate",
        Status::NotIdentifiable => "not-identifiable",
    }
}

fn badge(status: Status) -> &'static str {
    match status {
        Status::Named => "cause named",
        Status::OneOf => "one of these",
        Status::Unexplained => "measured, no known name",
        Status::Recalibrate => "calibrate again",
        Status::NotIdentifiable => "cannot be seen here",
    }
}

/// What was left out, in a sentence.
fn lead(finding: &Finding) -> String {
    let plain = finding.effect.map(|id| name(id).plain);
    match finding.status {
        Status::Named => plain.unwrap_or_default().into(),
        Status::OneOf => {
            let plain: Vec<String> =
                rivals(finding).iter().map(|id| name(id).plain.into()).collect();
            format!("either {}", list(&plain, "– or"))
        }
        Status::Unexplained => format!(
            "there is an error that none of the known causes explains; it depends on the {}{}",
            axis(finding.axis),
            finding.shape.as_ref().map_or_else(String::new, |s| format!(". Its curve: {s}"))
        ),
        Status::Recalibrate => {
            "no cause is missing: other numbers in the same simulation explain what was seen".into()
        }
        Status::NotIdentifiable => plain.map_or_else(
            || "an error of this kind leaves no trace in views of a flat board".into(),
            |plain| format!("if {plain}, views of a flat board do not show it"),
        ),
    }
}

fn facts(finding: &Finding) -> Markup {
    html! {
        dl {
            div { dt { "What is off" } dd { (capital(statistic(finding.statistic))) } }
            div { dt { "Where" } dd {
                (capital(axis(finding.axis))) ": " b { (interval(finding.axis, finding.interval, finding.unit)) }
            } }
            div { dt { "How large" } dd { (size(finding)) } }
            div { dt { "How sure" } dd { (surety(finding)) } }
            div { dt { "Share" } dd { (share(finding)) } }
        }
    }
}

fn size(finding: &Finding) -> Markup {
    let (size, noise) = (finding.size, finding.statistic != Statistic::Bias);
    if !(size.mm.abs() > 0.0 || size.sigma.abs() > 0.0) {
        return html! { "No size in millimetres can be given" };
    }
    if finding.statistic == Statistic::Dropout {
        return html! { b { (percent(size.sigma)) } " of the pixels are lost" };
    }
    html! {
        b { (mm(size.mm)) } " typically, which is " b { (significant(size.sigma, 2)) " times" }
        @if noise { " the noise that was simulated" } @else { " the noise of a single reading" }
    }
}

fn surety(finding: &Finding) -> Markup {
    let best = finding.alternatives.first();
    let named = best.is_some() && matches!(finding.status, Status::Named | Status::OneOf);
    let rest = 1.0 - finding.alternatives.iter().map(|a| a.probability).sum::<f64>();
    html! {
        @match (finding.status, best) {
            (Status::Named, Some(best)) => { b { (percent(best.probability)) } " that this is the cause; " },
            (Status::OneOf, Some(_)) => {
                @for id in rivals(finding) {
                    @for a in finding.alternatives.iter().filter(|a| a.effect == id) {
                        b { (percent(a.probability)) } " " (name(id).short) ", "
                    }
                }
                @if rest > 0.005 { (percent(rest)) " something else; " }
            },
            _ => {},
        }
        @if named { (chance(finding.p_adjusted)) } @else { (capital(&chance(finding.p_adjusted))) }
        @if finding.p_adjusted.is_finite() { " (" (p_value(finding.p_adjusted)) ")" }
    }
}

fn share(finding: &Finding) -> Markup {
    if !finding.share.is_finite() {
        return html! { "Not known" };
    }
    let percent = (100.0 * finding.share).clamp(0.0, 100.0);
    html! {
        span.bar { span style={ "width:" (format!("{percent:.0}")) "%" } {} }
        " " b { (fixed(percent, 0)) " %" } " of all that was explained"
    }
}

fn key(finding: &Finding) -> Markup {
    html! {
        span.dot {} " measured ± standard error " span.line {} " "
        @match finding.status {
            Status::Unexplained => "curve given to the simulation",
            _ => "simulation with it put in",
        }
    }
}
