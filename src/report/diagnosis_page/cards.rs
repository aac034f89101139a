//! A card for each finding: what it is, where, how large, how sure, and what to do next.

use maud::{Markup, PreEscaped, html};

use super::sentences::{
    axis, badge, called, capital, chance, description, interval, mm, physics, sentence, statistic,
    title,
};
use super::{curve, parameters};
use crate::capture::far_side;
use crate::diagnose::{Finding, NextView, Status};
use crate::error::Result;
use crate::report::document::{facts, fold, list, row, table};
use crate::report::numbers::{count, fixed, p_value, percent, significant};
use crate::terms::Statistic;

/// Smaller probabilities are nil.
const MIN_PROBABILITY: f64 = 0.0005;
/// Below this tilt a target counts as facing the sensor, rad: 3 degrees.
const FACING_RAD: f64 = 0.0524;

pub(super) fn findings(findings: &[Finding]) -> Result<Markup> {
    let main = findings.iter().filter(|f| !f.minor);
    let cards = main.enumerate().map(card).collect::<Result<Vec<Markup>>>()?;
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

/// Does either half of the views alone support it?
fn halves(replicated: Option<bool>) -> &'static str {
    match replicated {
        Some(true) => "Both show it alike",
        Some(false) => "They do not agree: either one lacks it, or their sizes differ",
        None => "Not tested",
    }
}

/// What is less than a hundredth of the mismatch: a line, and a table behind it.
pub(super) fn small_remains(findings: &[Finding]) -> Markup {
    let minor: Vec<&Finding> = findings.iter().filter(|f| f.minor).collect();
    let share = fixed(100.0 * minor.iter().map(|f| f.share).sum::<f64>(), 1);
    let columns = ["what", "what is off", "along", ">of the noise", ">share", "halves", ">chance"];
    let row = |f: &&Finding| {
        let p = html! { @if let Some(p) = f.p_adjusted { (p_value(p)) } @else { "–" } };
        let of_all = format!("{} %", fixed(100.0 * f.share, 2));
        let size = significant(f.size.sigma, 2);
        let (what, off) = (capital(&called(f)), capital(statistic(f.statistic)));
        row![what, off, axis(f.axis), size, of_all, halves(f.replicated), p]
    };
    html! { @if !minor.is_empty() { section {
        (fold(
            &format!("Small remains: {}, {share} % of the mismatch together", count(minor.len(), "finding")),
            false,
            &table(&columns, minor.iter().map(row)),
        ))
    } } }
}

/// Those that are known.
fn finding_facts(finding: &Finding) -> Vec<(&str, Markup)> {
    let place = interval(finding.axis, finding.interval, finding.unit);
    let mut facts = vec![
        ("What is off", html! { (capital(statistic(finding.statistic))) }),
        ("Where", html! { (capital(axis(finding.axis))) ": " b { (place) } }),
    ];
    let (size, p) = (finding.size, finding.p_adjusted);
    if size.mm.abs() > 0.0 || size.sigma.abs() > 0.0 {
        let bias = finding.statistic == Statistic::Bias;
        let noise = if bias { "of a single reading" } else { "in the model" };
        facts.push(("How large", html! {
            @if finding.statistic == Statistic::Dropout {
                b { (percent(size.sigma)) } " of the pixels are lost"
            } @else {
                b { (mm(size.mm)) } " rms, " b { (significant(size.sigma, 2)) " times" } " the noise " (noise)
            }
        }));
    }
    if finding.status != Status::NotIdentifiable {
        facts.push((
            "How sure",
            html! {
                (capital(&chance(p)))
                @if let Some(p) = p { " (" (p_value(p)) ")" }
            },
        ));
        facts.push(("Halves of the views", html! { (halves(finding.replicated)) }));
        if finding.share.is_finite() {
            let percent = fixed((100.0 * finding.share).clamp(0.0, 100.0), 0);
            facts.push((
                "Share",
                html! {
                    span.bar { span style={ "width:" (percent) "%" } {} }
                    " " b { (percent) " %" } " of all that was explained"
                },
            ));
        }
    }
    // `amplitude_px = 0.3 ± 0.1 px`, and what that is.
    facts.extend(finding.parameters.iter().map(|(name, value)| {
        let description = parameters::description(finding.effect, name);
        let value = html! {
            b { (parameters::value(finding.effect, name, value, 3)) }
            @if !description.is_empty() { ": " (description) }
        };
        (name.as_str(), value)
    }));
    facts
}

/// Every effect that it could be, best first.
fn alternatives(finding: &Finding) -> Markup {
    let weighed: Option<f64> = finding.alternatives.iter().map(|a| a.probability).sum();
    let none = weighed.map_or(0.0, |sum| 1.0 - sum);
    let effects = finding.alternatives.iter().map(|a| {
        html! {
            b { @if let Some(p) = a.probability { (percent(p)) " " } (title(a.effect)) }
            ": " (description(a.effect)) " " code { (a.effect) }
        }
    });
    let none = (none > MIN_PROBABILITY).then(|| html! { b { (percent(none)) " none of these" } });
    html! { @if !finding.alternatives.is_empty() {
        h3 { "What it could be" }
        (list(effects.chain(none)))
    } }
}

/// What to do next; nothing where nothing is asked of anybody.
fn advice(finding: &Finding) -> Option<Markup> {
    let view = finding.next_view.as_ref();
    let more = match finding.status {
        Status::Named => "",
        Status::OneOf if view.is_some() => {
            "Then diagnose again with this view added to the recording."
        }
        Status::OneOf => {
            "These views do not separate the alternatives. Add views at other distances and tilts, and diagnose again."
        }
        Status::Unexplained => {
            "The simulation can use the measured curve as it is. To find the cause, change one thing at a time \
             (distance, tilt, place in the picture, light, time since switching on) and see what the curve follows."
        }
        Status::Recalibrate => {
            "Run “kinoise calibrate” on this recording and diagnose again with the new model. No effect has to be \
             added to the simulation."
        }
        Status::NotIdentifiable if view.is_none() && finding.statistic == Statistic::Bias => {
            "A plane with this error still looks like a plane. Measure the distance from sensor to target with a tape \
             in a few views at different distances, write it into each view's view.json as “reference_distance_m”, \
             and diagnose again."
        }
        Status::NotIdentifiable => "Add views at other distances and tilts, and diagnose again.",
    };
    (view.is_some() || !more.is_empty())
        .then(|| html! { @if let Some(view) = view { (next_view(view)) } (more) })
}

/// An instruction to a person holding a target.
fn next_view(next: &NextView) -> Markup {
    let tilt = fixed(next.theta_rad.to_degrees(), 0);
    let far = far_side(next.azimuth_rad);
    let part = if far.contains(' ') { "corner" } else { "side" };
    html! {
        "Take one more view: hold the target " b { (fixed(next.z_m, 2)) " m" } " in front of the sensor, "
        @if next.theta_rad.abs() < FACING_RAD { b { "facing it" } ". " }
        @else { b { "tilted by " (tilt) "°" } ", its " b { (far) " " (part) } " farthest away as the sensor sees it. " }
        @if !next.why.is_empty() { (sentence(&next.why)) " " }
    }
}
