//! A card for each finding: what it is, where, how large, how sure, and what to do next.

use maud::{Markup, PreEscaped, html};
use serde_json::Value;

use super::advice::advice;
use super::sentences::{
    axis, badge, called, capital, chance, description, interval, mm, physics, statistic, title,
};
use super::{curve, parameters};
use crate::diagnose::{Finding, Status};
use crate::error::Result;
use crate::report::document::{facts, list};
use crate::report::numbers::{fixed, p_value, percent, significant};
use crate::terms::Statistic;

/// Smaller probabilities are nil.
const MIN_PROBABILITY: f64 = 0.0005;

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
