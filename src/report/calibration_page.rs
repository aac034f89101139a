//! The calibration page.

mod tiles;
mod uncertainty;
mod views;
mod warnings;

use maud::{Markup, html};
use serde_json::{Map, Value};

use super::document::{
    Column, Origin, answer, document, facts, figure, heading, section, table, table_of,
};
use super::numbers::{ABSENT, MM, fixed, formula, millimetres, plain, range, significant};
use super::overlay::Overlay;
use super::sigma_map::sigma_map;
use super::slices::{against_distance, figure2, fit_residuals};
use crate::calibrate::{Calibration, Measurements};
use crate::error::Result;
use crate::model::{DISTANCE_RATIO, Direction, HeldOut, Parameter, Provenance, SigmaModel};
use crate::units::counted;
use crate::view::Sensor;

/// Contents of the page. A bare table has neither sensor nor measurements.
#[derive(Debug, Clone, Copy)]
pub struct CalibrationPage<'a> {
    /// Title of the page.
    pub title: &'a str,
    /// The sensor, if a recording was measured.
    pub sensor: Option<&'a Sensor>,
    /// The measured views, if a recording was measured.
    pub measurements: Option<&'a Measurements>,
    /// The model with its fit, table and warnings.
    pub calibration: &'a Calibration,
    /// Published surfaces drawn into Fig. 2.
    pub overlays: &'a [Overlay],
    pub origin: &'a Origin,
}

impl CalibrationPage<'_> {
    /// Names of the views, in order.
    pub fn names(&self) -> Vec<&str> {
        let views = self.measurements.map_or(&[][..], |m| &m.views);
        views.iter().map(|view| view.name.as_str()).collect()
    }
}

const DISTANCE: &str = "Each point is a measured σ with one standard error; colour and shape give \
    its tilt. Curves are the fit at the median tilt of each colour with its 95 % band, drawn only near \
    measured distances. Published curves are for the smallest tilt. A point is carried along the \
    fitted surface from its own tilt to its curve's, so that its height over the curve is its relative \
    residual; measurements.csv has it as measured.";
const MAP: &str = "Coverage: the fitted σ near the measured cells, which are the dots. Hatched: \
    nothing was measured within a step of the paper's grid (a factor of 1.5 in distance, 10° in tilt), \
    and the model there is a guess.";
const FIGURE2: &str = "The same against tilt, as in the paper's Fig. 2: colour and shape give the \
    distance, and curves are drawn only near measured tilts.";
const RESIDUALS: &str = "Measured σ minus the fit, in percent of the fit, with one standard error \
    from the number of independent samples. What bends here is not in the form.";

/// Renders the page as HTML text.
pub fn calibration_page(page: &CalibrationPage<'_>) -> Result<String> {
    let (calibration, names) = (page.calibration, page.names());
    let (measured, sigma) = (&calibration.table, &calibration.model.sigma);
    let excluded = page.measurements.map_or(&[][..], |m| &m.excluded);
    let warned = !calibration.warnings.is_empty() || !excluded.is_empty();
    let warnings = warnings::section(&calibration.warnings, excluded);
    let body = html! {
        (header(page))
        (verdict(page))
        (tiles::tiles(measured, sigma, page.measurements.map_or(&[], |m| &m.views)))
        (formula_to_copy(sigma))
        @if warned { (warnings) }
        (section("σ against distance", &html! {
            (figure(&against_distance(measured, sigma, &names), DISTANCE)?)
            (heading(3, "σ facing the target, in mm"))
            (published(sigma))
        }))
        (section("What was covered", &figure(&sigma_map(measured, sigma, &names), MAP)?))
        (section(
            "σ against tilt",
            &figure(&figure2(measured, sigma, page.overlays, &names), FIGURE2)?,
        ))
        (section("What the fit leaves", &figure(&fit_residuals(measured, sigma, &names), RESIDUALS)?))
        (model(page))
        @if let Some(uncertainty) = &calibration.model.uncertainty {
            (uncertainty::section_of(uncertainty))
        }
        @if let Some(measurements) = page.measurements {
            (views::section_of(&measurements.views))
            (views::gallery(&measurements.views)?)
        }
        @if !warned { (warnings) }
    };
    let made = made(&calibration.model.provenance);
    Ok(document(page.title, page.origin, &made, &body).into_string())
}

fn header(page: &CalibrationPage<'_>) -> Markup {
    html! {
        header {
            h1 { (page.title) }
            p.sub { @match page.sensor {
                Some(sensor) => {
                    (sensor.name)
                    @if let Some(serial) = &sensor.serial { ", serial " (serial) }
                    @if let Some(mode) = &sensor.mode { ", " (mode) " mode" }
                    ", " (sensor.camera.width) " × " (sensor.camera.height) " px"
                },
                None => "fitted to a table of sigmas; the recording is not part of this page",
            } }
        }
    }
}

/// States whether the surface describes what was measured.
fn verdict(page: &CalibrationPage<'_>) -> Markup {
    let calibration = page.calibration;
    let quality = &calibration.fit.quality;
    let (share, r2) = (fixed(100.0 * quality.rmse_relative, 1), fixed(quality.r2, 3));
    let heldout = calibration.model.fit.heldout;
    let unseen = heldout.map_or_else(String::new, |e| {
        format!(", and distances left out of the fit to {} %", fixed(100.0 * e, 1))
    });
    let warnings = calibration.warnings.len();
    let more = html! { @if warnings > 0 {
        p { a href="#warnings" { @if warnings == 1 { "One warning" } @else { (warnings) " warnings" } }
            " to read before using it." }
    } };
    if quality.is_poor() {
        let sentence = format!(
            "The fit does not describe this sensor: measured σ lie {share} % off it (rms, r² = {r2})."
        );
        return answer("bad", "A poor fit", &sentence, &more);
    }
    let sentence = format!("The model gives the measured σ to {share} % (rms, r² = {r2}){unseen}.");
    answer(if warnings == 0 { "good" } else { "unsure" }, "Calibrated", &sentence, &more)
}

/// The form with its parameters inserted, typeset and as a line of code to copy.
fn formula_to_copy(model: &SigmaModel) -> Markup {
    let card = model.form.card();
    let (equation, units) = card.formula.split_once(" (m").unwrap_or((card.formula, ""));
    let units = units.trim_start_matches(';').trim_start_matches(" ");
    let units = units.split(')').next().unwrap_or_default();
    let value = |name: &str| {
        let at = card.parameters.iter().position(|(n, _)| *n == name)?;
        model.parameters.get(at).copied()
    };
    html! { div.formula {
        p { (formula(equation, &value)) " " span.units { "in m; " (units.replace("theta", "θ")) } }
        code #formula { (plain(equation, &value)) }
        button.copy type="button" data-of="formula" { "copy" }
    } }
}

fn result(page: &CalibrationPage<'_>) -> Markup {
    let calibration = page.calibration;
    let (fit, sigma) = (&calibration.model.fit, &calibration.model.sigma);
    let used = match page.measurements {
        Some(m) => format!("{} used, {} excluded", m.views.len(), m.excluded.len()),
        None => format!("{} of a table", counted(calibration.table.rows.len(), "row")),
    };
    let direction = match sigma.direction {
        Direction::Axial => "along the optical axis",
        Direction::Perpendicular => "normal to the plane",
    };
    let tilts = sigma.domain.theta_rad.map(f64::to_degrees);
    let heldout = fit.heldout.map(|e| format!("{} % rms", fixed(100.0 * e, 1)));
    let heldout = heldout.as_deref().unwrap_or("not known: too few distances");
    let error = html! { (fixed(MM * fit.rmse_m, 2)) " mm rms, r² = " (fixed(fit.r2, 3)) };
    facts([
        ("views", html! { (used) }),
        ("distance z", html! { (range(sigma.domain.z_m, 2)) " m" }),
        ("tilt θ", html! { (range(tilts, 1)) "°" }),
        ("σ is", html! { "measured " (direction) ", " (fit.samples) " cells" }),
        ("error of the fit", error),
        ("error at distances left out", html! { (heldout) }),
    ])
}

/// Distances at which sensors are compared, m.
const COMPARED_AT_M: [f64; 3] = [1.0, 2.0, 3.0];
const LEVEL: f64 = 0.95;

/// Table of the sensor beside the published surfaces, at the ends of its range and the usual distances.
fn published(model: &SigmaModel) -> Markup {
    let mut distances: Vec<f64> = COMPARED_AT_M.into_iter().chain(model.domain.z_m).collect();
    distances.sort_by(f64::total_cmp);
    distances.dedup_by(|b, a| *b <= *a * DISTANCE_RATIO);
    let theta = model.domain.theta_rad[0];
    let titles = distances.iter().map(|z| format!(">{} m", fixed(*z, 2)));
    let columns: Vec<String> = ["at distance".into()].into_iter().chain(titles).collect();
    let row = |name: Markup, model: &SigmaModel, own: bool| {
        let cells = distances.iter().map(|z| sigma_at(model, *z, theta, own));
        std::iter::once(name).chain(cells).collect()
    };
    let mut rows = vec![row(html! { b { "this sensor" } }, model, true)];
    rows.extend(Overlay::ALL.map(|o| row(html! { (o.label) }, &(o.model)(), false)));
    html! {
        (table(&columns, rows))
        p.note {
            "At θ = " (fixed(theta.to_degrees(), 1)) "°, the smallest tilt measured. In brackets: the 95 % interval. "
            (ABSENT) ": the source measured no such distance or tilt."
        }
    }
}

/// Sigma with its interval, if there is one; a dash where the source measured no such view.
fn sigma_at(model: &SigmaModel, z: f64, theta: f64, own: bool) -> Markup {
    let ([near, far], [low, high]) = (model.domain.z_m, model.domain.theta_rad);
    if z * DISTANCE_RATIO < near || z > far * DISTANCE_RATIO || theta < low || theta > high {
        return html! { (ABSENT) };
    }
    let sigma = millimetres(model.sigma(z, theta));
    html! {
        @if own { b { (sigma) } } @else { (sigma) }
        @if model.covariance.iter().any(|c| *c != 0.0) {
            @let [low, high] = model.interval(z, theta, LEVEL).map(millimetres);
            " " span.units { "(" (low) " – " (high) ")" }
        }
    }
}

fn model(page: &CalibrationPage<'_>) -> Markup {
    let calibration = page.calibration;
    let fit = &calibration.fit;
    let parameters: [Column<'_, Parameter>; 4] = [
        ("parameter", &|p| html! { i { (p.name) } }),
        (">value", &|p| significant(p.value, 4)),
        (">standard error", &|p| p.std_error.map_or(html! { "held" }, |e| significant(e, 2))),
        ("~remark", &|p| html! { (p.remark.as_deref().unwrap_or("")) }),
    ];
    let used = |h: &HeldOut| h.form == fit.form;
    let forms: [Column<'_, HeldOut>; 5] = [
        ("form", &|h| html! { @if used(h) { b { (h.form.id()) } } @else { (h.form.id()) } }),
        (">log score, nats a view", &|h| html! { (fixed(h.log_score, 2)) }),
        (">rms error", &|h| html! { (fixed(100.0 * h.rmse_relative, 1)) " %" }),
        (">distances left out", &|h| html! { (h.folds) }),
        ("~from", &|h| html! { (h.form.card().reference) }),
    ];
    let content = html! {
        p {
            "Form " b { (fit.form.id()) } ": " (fit.form.card().formula) ". "
            span.units { (fit.form.card().reference) }
        }
        (result(page))
        (table_of(&parameters, &fit.parameters))
        (heading(3, "How the forms predict distances they have not seen"))
        @if calibration.comparison.is_empty() {
            p { "Not known: too few distances to leave one out." }
        } @else {
            (table_of(&forms, &calibration.comparison))
            p.note { "Each group of distances is left out of the fit in turn and then predicted; a greater \
                log score is better. The form used is in bold." }
        }
    };
    section("Model", &content)
}

/// What is needed to make the model again, beside the page's origin.
fn made(made: &Provenance) -> Vec<(String, Markup)> {
    let text = |value: &Value| match value {
        Value::Null => "automatic".into(),
        Value::String(text) => text.clone(),
        other => other.to_string(),
    };
    let entries = |before: &'static str, map: &Map<String, Value>| {
        let entry = |(name, value): (&String, &Value)| {
            (format!("{before}{}", name.replace('_', " ")), html! { (text(value)) })
        };
        map.iter().map(entry).collect::<Vec<_>>()
    };
    let mut all = entries("", &made.options);
    all.retain(|(name, _)| name != "seed");
    all.extend(entries("SHA-256 of ", &made.sha256));
    all
}

#[cfg(test)]
mod tests;
