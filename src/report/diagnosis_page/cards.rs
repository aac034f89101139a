//! A card for each finding: what, where, how large, how certain, and what to do next.

use maud::{Markup, html};

use super::sentences::{
    axis, badge, called, capital, chance, description, halves, interval, mm, sentence, statistic,
    title,
};
use super::{curve, parameters, table};
use crate::capture::far_side;
use crate::diagnose::{Finding, NextView, Status};
use crate::error::Result;
use crate::report::document::{drawing, facts, fold, heading, list, prose, section};
use crate::report::numbers::{count, fixed, p_value, percent, significant};
use crate::terms::Statistic;

/// Probability below which "none of these" is not shown.
const MIN_PROBABILITY: f64 = 0.0005;
/// Tilt below which a target counts as facing the sensor, rad: 3 degrees.
const FACING_RAD: f64 = 0.0524;

pub(super) fn findings(findings: &[&Finding]) -> Result<Markup> {
    let blind = |f: &&&Finding| f.status == Status::NotIdentifiable;
    let unseen = findings.iter().filter(blind).count();
    let cards = findings.iter().enumerate().map(card).collect::<Result<Vec<Markup>>>()?;
    // `by_size` puts the effects that cannot be identified last.
    let (seen, hidden) = cards.split_at(cards.len() - unseen);
    let title = format!("{} that these views cannot show", capital(&count(unseen, "effect")));
    Ok(html! { @if !cards.is_empty() {
        (section("The findings one by one", &html! {
            @for card in seen { (card) }
            @if unseen > 0 { (fold(&title, seen.is_empty(), &html! { @for card in hidden { (card) } })) }
        }))
    } })
}

fn card((i, finding): (usize, &&Finding)) -> Result<Markup> {
    let what = format!(
        "curve of {}: measured points with standard errors, and the model's line",
        called(finding)
    );
    let chart = finding.curve.as_ref().and_then(curve::chart);
    let picture = chart.map(|chart| drawing(&chart, &what)).transpose()?;
    let (class, badge) = badge(finding);
    Ok(html! {
        article.card {
            header {
                (heading(3, &table::title(i, finding)))
                span class={ "badge " (class) } { (badge) }
            }
            p { (prose(&sentence(&finding.physics))) }
            div.halves {
                (facts(finding_facts(finding)))
                @if let Some(drawing) = picture { figure {
                    (drawing)
                    figcaption {
                        "Points: measured ± standard error. Line: "
                        @if finding.status == Status::Unexplained { "the curve given to the simulation." }
                        @else { "the simulation with it added." }
                    }
                } }
            }
            (alternatives(finding))
            div.todo { p {
                b { "What to do. " }
                @match &finding.next_view {
                    Some(view) => (next_view(view)),
                    None => (prose(&sentence(&table::advice(finding)))),
                }
            } }
        }
    })
}

/// The known facts of a finding.
fn finding_facts(finding: &Finding) -> Vec<(String, Markup)> {
    let place = interval(finding.axis, finding.interval, finding.unit);
    let mut facts = vec![
        ("What is off".into(), html! { (capital(statistic(finding.statistic))) }),
        ("Where".into(), html! { (capital(axis(finding.axis))) ": " b { (place) } }),
    ];
    let (size, p) = (finding.size, finding.p_adjusted);
    if size.mm.abs() > 0.0 || size.sigma.abs() > 0.0 {
        let bias = finding.statistic == Statistic::Bias;
        let noise = if bias { "of a single reading" } else { "in the model" };
        facts.push(("How large".into(), html! {
            @if finding.statistic == Statistic::Dropout {
                b { (percent(size.sigma)) } " of the pixels are lost"
            } @else {
                b { (mm(size.mm)) } " rms, " b { (significant(size.sigma, 2)) " times" } " the noise " (noise)
            }
        }));
    }
    if finding.status != Status::NotIdentifiable {
        let sure = html! { (capital(&chance(p))) @if let Some(p) = p { " (" (p_value(p)) ")" } };
        facts.push(("How sure".into(), sure));
        facts.push(("Halves of the views".into(), html! { (halves(finding.replicated)) }));
        if finding.share.is_finite() {
            let percent = fixed((100.0 * finding.share).clamp(0.0, 100.0), 0);
            let share = html! {
                span.bar { span style={ "width:" (percent) "%" } {} }
                " " b { (percent) " %" } " of all that was explained"
            };
            facts.push(("Share".into(), share));
        }
    }
    // `amplitude_px = 0.3 ± 0.1 px` and its description.
    facts.extend(finding.parameters.iter().map(|(name, value)| {
        let description = parameters::description(finding.effect, name);
        let value = html! {
            b { (parameters::value(finding.effect, name, value, 3)) }
            @if !description.is_empty() { ": " (description) }
        };
        (parameters::title(name), value)
    }));
    facts
}

/// The effects that it could be, best first.
fn alternatives(finding: &Finding) -> Markup {
    let weighed: Option<f64> = finding.alternatives.iter().map(|a| a.probability).sum();
    let none = weighed.map_or(0.0, |sum| 1.0 - sum);
    let effects = finding.alternatives.iter().map(|a| {
        html! {
            b { @if let Some(p) = a.probability { (percent(p)) " " } (title(a.effect)) }
            ": " (prose(description(a.effect))) " " code { (a.effect) }
        }
    });
    let none = (none > MIN_PROBABILITY).then(|| html! { b { (percent(none)) " none of these" } });
    html! { @if !finding.alternatives.is_empty() {
        p { b { "What it could be" } }
        (list(effects.chain(none)))
    } }
}

/// An instruction to the person holding the target.
pub(super) fn next_view(next: &NextView) -> Markup {
    let tilt = fixed(next.theta_rad.to_degrees(), 0);
    let far = far_side(next.azimuth_rad);
    let part = if far.contains(' ') { "corner" } else { "side" };
    html! {
        "Take one more view: hold the target " b { (fixed(next.z_m, 2)) " m" } " in front of the sensor, "
        @if next.theta_rad.abs() < FACING_RAD { b { "facing it" } ". " }
        @else { b { "tilted by " (tilt) "°" } ", its " b { (far) " " (part) } " farthest away as the sensor sees it. " }
        @if !next.why.is_empty() { (prose(&sentence(&next.why))) " " }
        "Then add it to the recording and diagnose again."
    }
}
