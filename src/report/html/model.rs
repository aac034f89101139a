//! The model's parameters, and how the forms compare.

use maud::{Markup, html};

use crate::calibrate::Calibration;
use crate::model::{HeldOut, Parameter};
use crate::report::numbers::{ABSENT, fixed, significant};

const DIGITS: usize = 4;
const ERROR_DIGITS: usize = 2;

pub(super) fn section(calibration: &Calibration) -> Markup {
    let fit = &calibration.fit;
    html! {
        section {
            h2 { "Model" }
            p {
                "Form " b { (fit.form.id()) } ": " (fit.form.spec().formula()) ". "
                span.units { (fit.form.spec().reference()) }
            }
            (parameters(&fit.parameters))
            h3 { "How the forms predict distances they have not seen" }
            @if calibration.comparison.is_empty() {
                p { "Not known: too few distances to leave one out." }
            } @else {
                (comparison(calibration))
            }
        }
    }
}

fn parameters(parameters: &[Parameter]) -> Markup {
    html! {
        div.wide { table {
            thead { tr { th { "parameter" } th.n { "value" } th.n { "standard error" } th { "remark" } } }
            tbody { @for p in parameters { tr {
                th { i { (p.name) } }
                td.n { (significant(p.value, DIGITS)) }
                td.n { @match p.std_error { Some(e) => (significant(e, ERROR_DIGITS)), None => "held" } }
                td.words { (p.remark.as_deref().unwrap_or("")) }
            } } }
        } }
    }
}

fn comparison(calibration: &Calibration) -> Markup {
    html! {
        div.wide { table {
            thead { tr {
                th { "form" } th.n { "log score, nats a view" } th.n { "rms error" }
                th.n { "distances left out" } th { "from" }
            } }
            tbody { @for h in &calibration.comparison { (compared(h, calibration)) } }
        } }
        p.note { "Each group of distances is left out of the fit in turn and then predicted; a greater \
            log score is better. The form used is in bold." }
    }
}

fn compared(h: &HeldOut, calibration: &Calibration) -> Markup {
    html! {
        tr.ours[h.form == calibration.fit.form] {
            th { (h.form.id()) }
            td.n { (if h.log_score.is_finite() { fixed(h.log_score, 2) } else { ABSENT.into() }) }
            td.n { (fixed(100.0 * h.rmse_relative, 1)) " %" }
            td.n { (h.folds) }
            td.words { (h.form.spec().reference()) }
        }
    }
}
