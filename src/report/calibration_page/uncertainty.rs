//! The uncertainty budgets, laid out as in a calibration certificate.

use maud::{Markup, html};

use crate::model::{Conditions, Uncertainty, ViewUncertainty};
use crate::report::document::{Column, facts, heading, list, prose, section, table, table_of};
use crate::report::numbers::{ABSENT, MM, fixed, millimetres, range, significant};
use crate::stats::{Budget, Component, Evaluation};
use crate::units::counted;

pub(super) fn section_of(uncertainty: &Uncertainty) -> Markup {
    let errors: Vec<(&str, &Budget)> = of_views(uncertainty, |v| v.distance_error.as_ref());
    let sigmas: Vec<(&str, &Budget)> = of_views(uncertainty, |v| Some(&v.sigma));
    let content = html! {
        p { "This is " (uncertainty.statement) "." }
        (heading(3, "Error of indication"))
        p.note { "Depth of the fitted plane on the optical axis minus the reference distance. It is not taken off \
            anything by this page." }
        @if errors.is_empty() {
            p { (prose("Not known: it takes `reference_distance_m` and `reference_uncertainty_m` in view.json.")) }
        } @else {
            (summary(&errors))
            (worst(&errors))
        }
        (heading(3, "Standard deviation σ of the noise"))
        (summary(&sigmas))
        (worst(&sigmas))
        (heading(3, "Conditions"))
        (conditions(&uncertainty.conditions))
        @if !uncertainty.not_stated.is_empty() {
            p { "Without rows for what the recording does not state, in all views or some:" }
            (list(uncertainty.not_stated.iter().map(|key| html! { code { (key) } })))
        }
        p.note {
            "u: combined standard uncertainty of independent inputs (GUM 5.1.2). ν: effective degrees of freedom \
             (Welch and Satterthwaite, GUM G.4.1), ∞ where all that counts is Type B. U = k u with k = 2; in \
             brackets the probability of that interval by Student's t. What one tape or one board is off by is common \
             to its views and does not average out over them."
        }
    };
    section("Uncertainty", &content)
}

fn of_views<'a>(
    uncertainty: &'a Uncertainty,
    budget: impl Fn(&'a ViewUncertainty) -> Option<&'a Budget>,
) -> Vec<(&'a str, &'a Budget)> {
    uncertainty.views.iter().filter_map(|v| Some((v.view.as_str(), budget(v)?))).collect()
}

/// A table of contributions in mm, with a row per view and a column per source.
fn summary(budgets: &[(&str, &Budget)]) -> Markup {
    let mut sources: Vec<&Component> = Vec::new();
    for component in budgets.iter().flat_map(|(_, b)| &b.components) {
        if sources.iter().all(|s| s.quantity != component.quantity) {
            sources.push(component);
        }
    }
    let title = |c: &&Component| format!(">{} ({})", c.quantity, kind(c));
    let mut columns: Vec<String> = vec!["view".into(), ">value mm".into()];
    columns.extend(sources.iter().map(title));
    columns.extend([">u mm", ">ν", ">U mm (k = 2)"].map(String::from));
    let row = |(view, budget): &(&str, &Budget)| {
        let part = |source: &&Component| {
            let own = budget.components.iter().find(|c| c.quantity == source.quantity);
            own.map_or(ABSENT.into(), |c| fine(c.contribution_m))
        };
        let mut cells = vec![html! { (view) }, html! { (fixed(MM * budget.value_m, 2)) }];
        cells.extend(sources.iter().map(|s| html! { (part(s)) }));
        cells.push(html! { (fine(budget.combined_m)) });
        cells.push(html! { (freedom(budget.degrees_of_freedom)) });
        cells.push(
            html! { b { (fine(budget.expanded_m)) } " (" (fixed(1e2 * budget.coverage, 1)) " %)" },
        );
        cells
    };
    table(&columns, budgets.iter().map(row))
}

/// The largest budget by U, with a row per source.
fn worst(budgets: &[(&str, &Budget)]) -> Markup {
    let largest = budgets.iter().max_by(|a, b| a.1.expanded_m.total_cmp(&b.1.expanded_m));
    let columns: [Column<'_, Component>; 7] = [
        ("source", &|c| html! { (c.quantity) }),
        ("type", &|c| html! { (kind(c)) }),
        ("distribution", &|c| html! { (c.distribution.description()) }),
        (">u(x)", &|c| html! { (significant(c.standard_uncertainty, 3)) " " (c.unit) }),
        (">sensitivity", &|c| html! { (significant(c.sensitivity, 3)) " m/" (c.unit) }),
        (">contribution mm", &|c| html! { (fine(c.contribution_m)) }),
        (">ν", &|c| html! { (freedom(c.degrees_of_freedom)) }),
    ];
    html! { @if let Some((view, budget)) = largest {
        p { "The largest U row by row, view " b { (view) } ":" }
        (table_of(&columns, &budget.components))
    } }
}

fn kind(component: &Component) -> &'static str {
    match component.evaluation {
        Evaluation::A => "A",
        Evaluation::B => "B",
    }
}

/// A length in mm, to a micrometre below a tenth of a millimetre.
fn fine(metres: f64) -> String {
    if metres.abs() < 1e-4 { fixed(MM * metres, 3) } else { millimetres(metres) }
}

/// Degrees of freedom; above a thousand Student's t equals a Gaussian to a thousandth.
fn freedom(degrees_of_freedom: Option<f64>) -> String {
    match degrees_of_freedom {
        None => "∞".into(),
        Some(n) if n > 1e3 => "> 1000".into(),
        Some(n) => fixed(n, 1),
    }
}

fn conditions(c: &Conditions) -> Markup {
    let stated = |values: Option<[f64; 2]>, decimals: usize, unit: &str| {
        values.map_or_else(|| "not stated".into(), |v| format!("{} {unit}", range(v, decimals)))
    };
    let frames = range(c.frames.map(|n| n as f64), 0);
    facts([
        ("views", html! { (counted(c.views, "view")) " of " (frames) " frames" }),
        ("distance", html! { (range(c.distance_m, 3)) " m" }),
        ("tilt", html! { (range(c.tilt_rad.map(f64::to_degrees), 1)) "°" }),
        ("duration", html! { (fixed(c.duration_s, 0)) " s" }),
        ("temperature", html! { (stated(c.temperature_c, 1, "°C")) }),
        ("ambient light", html! { (stated(c.ambient_lux, 0, "lx")) }),
    ])
}
