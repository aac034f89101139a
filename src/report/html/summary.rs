//! The answer first: how noisy the sensor is.

use maud::{Markup, html};

use super::CalibrationPage;
use crate::calibrate::Calibration;
use crate::model::{DISTANCE_RATIO, Direction, SigmaModel};
use crate::report::figure2::Overlay;
use crate::report::numbers::{ABSENT, MM, fixed, formula, millimetres, range};

/// Where sensors are compared, m.
const COMPARED_AT_M: [f64; 3] = [1.0, 2.0, 3.0];
const LEVEL: f64 = 0.95;

pub(super) fn section(input: &CalibrationPage<'_>) -> Markup {
    let calibration = input.calibration;
    html! {
        section {
            h2 { "Result" }
            p.formula { (with_numbers(calibration)) }
            (facts(input))
            h3 { "σ facing the target, in mm" }
            (comparison(&calibration.model.sigma))
        }
    }
}

fn with_numbers(calibration: &Calibration) -> Markup {
    let model = &calibration.model.sigma;
    let spec = model.form.spec();
    let (equation, units) = spec.formula().split_once(" (m").unwrap_or((spec.formula(), ""));
    let units = units.trim_start_matches(';').trim_end_matches(')').replace("theta", "θ");
    let value = |name: &str| {
        let at = spec.parameters().iter().position(|(n, _)| *n == name)?;
        model.parameters.get(at).copied()
    };
    html! {
        (formula(equation, &value))
        " " span.units { "in m; " (units) }
    }
}

fn facts(input: &CalibrationPage<'_>) -> Markup {
    let calibration = input.calibration;
    let summary = &calibration.model.fit;
    let domain = calibration.model.sigma.domain;
    let used = match input.measurements {
        Some(m) => format!("{} used, {} excluded", m.views.len(), m.excluded.len()),
        None => format!("{} rows of a table", calibration.table.rows.len()),
    };
    let rows = [
        ("views", used),
        ("distance z", format!("{} m", range(domain.z_m, 2))),
        ("tilt θ", format!("{}°", range(domain.theta_rad.map(f64::to_degrees), 1))),
        (
            "sigma is",
            format!("{}, {} cells", axis_words(calibration.model.sigma.direction), summary.samples),
        ),
        (
            "fit error",
            format!(
                "{} mm rms, r² = {}{}",
                fixed(MM * summary.rmse_m, 2),
                fixed(summary.r2, 3),
                if calibration.fit.poor { ": a poor fit, see the warnings" } else { "" }
            ),
        ),
        (
            "error at distances left out",
            summary.heldout.map_or("not known: too few distances".into(), |e| {
                format!("{} % rms", fixed(100.0 * e, 1))
            }),
        ),
    ];
    html! {
        dl { @for (name, value) in rows { div { dt { (name) } dd { (value) } } } }
    }
}

fn axis_words(direction: Direction) -> &'static str {
    match direction {
        Direction::Axial => "measured along the optical axis",
        Direction::Perpendicular => "measured across the plane",
    }
}

fn comparison(model: &SigmaModel) -> Markup {
    let distances = distances(model);
    let theta = model.domain.theta_rad[0];
    html! {
        div.wide { table {
            thead { tr {
                th { "at distance" }
                @for z in &distances { th.n { (fixed(*z, 2)) " m" } }
            } }
            tbody {
                tr.ours {
                    th { "this sensor" }
                    @for z in &distances { td.n { (ours(model, *z, theta)) } }
                }
                @for overlay in Overlay::ALL {
                    tr {
                        th { (overlay.label()) }
                        @for z in &distances { td.n { (theirs(&overlay.model(), *z, theta)) } }
                    }
                }
            }
        } }
        p.note {
            "At θ = " (fixed(theta.to_degrees(), 1)) "°, the least tilt measured; in brackets the 95 % interval. "
            (ABSENT) " where the source has measured no such distance or tilt."
        }
    }
}

/// The ends of the sensor's range, and the usual places.
fn distances(model: &SigmaModel) -> Vec<f64> {
    let mut all: Vec<f64> = COMPARED_AT_M.into_iter().chain(model.domain.z_m).collect();
    all.sort_by(f64::total_cmp);
    all.dedup_by(|b, a| *b <= *a * DISTANCE_RATIO);
    all
}

fn measured(model: &SigmaModel, z: f64) -> bool {
    let [near, far] = model.domain.z_m;
    z * DISTANCE_RATIO >= near && z <= far * DISTANCE_RATIO
}

fn ours(model: &SigmaModel, z: f64, theta: f64) -> Markup {
    if !measured(model, z) {
        return html! { (ABSENT) };
    }
    if model.covariance.iter().all(|c| *c == 0.0) {
        return html! { b { (millimetres(model.sigma(z, theta))) } };
    }
    let [low, high] = model.interval(z, theta, LEVEL).map(millimetres);
    html! { b { (millimetres(model.sigma(z, theta))) } " " span.units { "(" (low) " – " (high) ")" } }
}

fn theirs(model: &SigmaModel, z: f64, theta: f64) -> String {
    let [squarest, steepest] = model.domain.theta_rad;
    let tilted = (squarest..=steepest).contains(&theta);
    if tilted && measured(model, z) { millimetres(model.sigma(z, theta)) } else { ABSENT.into() }
}
