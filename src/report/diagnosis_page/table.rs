//! A table of all findings, the largest first; minor ones are folded.

use maud::{Markup, html};

use super::sentences::{axis, called, capital, halves, interval, mm, statistic};
use crate::diagnose::{Finding, Status};
use crate::report::document::{fold, prose, row, section, slug, table};
use crate::report::numbers::{count, fixed, p_value, percent, significant};
use crate::terms::Statistic;

const COLUMNS: [&str; 8] =
    ["finding", ">size", ">times σ", ">name", ">chance", "what is off", "where", "~what to do"];

pub(super) fn findings(main: &[&Finding], minor: &[&Finding]) -> Markup {
    // Effects that cannot be identified have no size; their cards come after the others.
    let seen = main.iter().enumerate().filter(|(_, f)| f.status != Status::NotIdentifiable);
    let rows: Vec<Vec<Markup>> = seen.map(|(i, f)| line(i, f)).collect();
    if rows.is_empty() && minor.is_empty() {
        return html! {};
    }
    let content = html! {
        @if !rows.is_empty() {
            (table(&COLUMNS, rows))
            p.note {
                "Size: root mean square over the recording. Times σ: beside the noise of a single reading. Name: \
                 probability that the first name is right, beside the other names that would explain it. Chance: p of \
                 a difference this large if the model were right, corrected for the number of places searched."
            }
        }
        (small(minor))
    };
    section("What was found", &content)
}

/// Heading of a finding's card, to which its row links.
pub(super) fn title(i: usize, finding: &Finding) -> String {
    format!("{}. {}", i + 1, capital(&called(finding)))
}

fn line(i: usize, f: &Finding) -> Vec<Markup> {
    let name = capital(&called(f));
    let [size, sigmas] = sizes(f);
    let likely = f.alternatives.first().and_then(|a| a.probability);
    let place = interval(f.axis, f.interval, f.unit);
    row![
        html! { a href={ "#" (slug(&title(i, f))) } { (name) } },
        size,
        sigmas,
        html! { @if let Some(p) = likely { (percent(p)) } @else { "–" } },
        html! { @if let Some(p) = f.p_adjusted { (p_value(p)) } @else { "–" } },
        capital(statistic(f.statistic)),
        html! { (capital(axis(f.axis))) ": " (place) },
        prose(&advice(f)),
    ]
}

/// Size in mm and beside the noise; of lost pixels, their share.
fn sizes(f: &Finding) -> [Markup; 2] {
    let none = || html! { "–" };
    let sigmas = html! { (significant(f.size.sigma, 2)) };
    match f.statistic {
        Statistic::Dropout => [html! { (percent(f.size.sigma)) " of pixels" }, none()],
        _ if f.size.mm.abs() > 0.0 => [html! { (mm(f.size.mm)) }, sigmas],
        _ => [none(), sigmas],
    }
}

/// Whether the finding is an error of the target, which no correction removes.
fn is_of_target(f: &Finding) -> bool {
    !f.terms.is_empty() && f.terms.iter().all(|t| !t.belongs_to_sensor())
}

/// What to do about a finding.
pub(super) fn advice(f: &Finding) -> String {
    let words = match (f.status, &f.next_view) {
        (Status::OneOf | Status::Unexplained, Some(view)) => {
            let tilt = fixed(view.theta_rad.to_degrees(), 0);
            return format!("one more view: {} m, tilt {tilt}°", fixed(view.z_m, 2));
        }
        _ if f.contradicted.is_some() => {
            "run `kinoise calibrate` again: the model has what the recording does not show"
        }
        (Status::Named, _) if is_of_target(f) => "use a flatter target: the sensor is right",
        (Status::Named, _) if f.is_corrected() => "`kinoise correct` takes it out",
        (Status::Named, _) if f.effect == Some("target-motion") => "keep the target still",
        (Status::Named, _) if f.of_some.is_some() => {
            "find what these views have in common: the extended model, which is of all views, leaves it out"
        }
        (Status::Named, _) if f.terms.is_empty() && !f.has_strength() => {
            "nothing yet: its strength was not measured, and the extended model holds its name alone"
        }
        (Status::Named, _) => "nothing: the extended model has it",
        (Status::OneOf, None) if f.is_law() => "measure near and far in turn, from a cold start",
        (Status::Unexplained, None) => "vary one condition at a time to find its cause",
        (Status::Recalibrate, _) => "run `kinoise calibrate` again",
        (Status::NotIdentifiable, _) if f.statistic == Statistic::Bias => {
            "measure the distance from sensor to target with a tape in a few views at different distances, write it into \
             each view's view.json as “reference_distance_m”, and diagnose again"
        }
        (Status::OneOf | Status::NotIdentifiable, _) => "add views at other distances and tilts",
    };
    words.into()
}

/// Table of the findings below a hundredth of the mismatch.
fn small(minor: &[&Finding]) -> Markup {
    let share = fixed(100.0 * minor.iter().map(|f| f.share).sum::<f64>(), 1);
    let columns = [
        "what",
        ">size",
        ">times σ",
        ">share",
        ">chance",
        "what is off",
        "along",
        "halves of the views",
    ];
    let row = |f: &&Finding| {
        let p = html! { @if let Some(p) = f.p_adjusted { (p_value(p)) } @else { "–" } };
        let ([size, sigmas], share) = (sizes(f), format!("{} %", fixed(100.0 * f.share, 2)));
        let (what, off) = (capital(&called(f)), capital(statistic(f.statistic)));
        let (along, halves) = (axis(f.axis), halves(f.replicated));
        row![what, size, sigmas, share, p, off, along, halves]
    };
    html! { @if !minor.is_empty() {
        (fold(
            &format!("Small remains: {}, {share} % of the mismatch together", count(minor.len(), "finding")),
            false,
            &table(&columns, minor.iter().map(row)),
        ))
    } }
}
