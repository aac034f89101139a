//! The diagnosis page: the answer and its pictures on the first screen, the evidence below.

mod cards;
mod curve;
mod next;
mod parameters;
mod sections;
mod sentences;
mod story;
mod table;

use maud::{Markup, html};
pub use next::Step;
pub use sentences::{called, subject};
pub use story::story;

use super::axis::Axis;
use super::document::{Origin, document, section};
use super::numbers::degrees;
use super::residuals::{residual_image, scale};
use crate::diagnose::{Diagnosis, Finding, Reference, Status, ViewPictures};
use crate::error::Result;
use crate::units::counted;

/// Contents of the page.
#[derive(Debug, Clone, Copy)]
pub struct DiagnosisPage<'a> {
    /// Title of the page.
    pub title: &'a str,
    pub diagnosis: &'a Diagnosis,
    /// Views whose residuals are worth seeing; few, because they are large.
    pub pictures: &'a [ViewPictures],
    /// Recommended commands, the first to run first.
    pub steps: &'a [Step],
    pub origin: &'a Origin,
}

/// Renders the page as HTML text, one self-contained file.
pub fn diagnosis_page(page: &DiagnosisPage<'_>) -> Result<String> {
    let diagnosis = page.diagnosis;
    let (main, minor) = by_size(&diagnosis.findings);
    let body = html! {
        header {
            h1 { (page.title) }
            p.sub {
                "Recording " b { (diagnosis.recording) } ", compared with "
                @match diagnosis.reference {
                    Reference::Model => "the noise model calibrated for the sensor.",
                    Reference::SimulatedRecording => "a simulated recording of the same scene.",
                }
            }
        }
        (sections::verdict(diagnosis))
        (next::section_of(page))
        (pictures(page)?)
        (table::findings(&main, &minor))
        (cards::findings(&main)?)
        (sections::held_out(diagnosis))
        (sections::remaining(diagnosis))
        (sections::detectable(diagnosis))
        (sections::cannot_tell(&diagnosis.cannot_tell))
        (sections::map(&diagnosis.map))
        (sections::views(&diagnosis.views))
        (sections::remarks(&diagnosis.remarks))
        p.note {
            "diagnosis.json has the same as data. σ is the standard deviation of a single reading in the model; sizes \
             in mm are root mean squares over the recording. A p-value is the chance of a difference this large if \
             the model were right."
        }
    };
    Ok(document(page.title, page.origin, &[], &body).into_string())
}

/// The major and the minor findings, each sorted by size in mm, those that cannot be identified last.
fn by_size(findings: &[Finding]) -> (Vec<&Finding>, Vec<&Finding>) {
    let mut sorted: Vec<&Finding> = findings.iter().collect();
    let mm = |f: &Finding| if f.size.mm.is_finite() { f.size.mm.abs() } else { 0.0 };
    let unseen = |f: &Finding| f.status == Status::NotIdentifiable;
    sorted.sort_by(|a, b| unseen(a).cmp(&unseen(b)).then(mm(b).total_cmp(&mm(a))));
    sorted.into_iter().partition(|f| !f.minor)
}

fn pictures(page: &DiagnosisPage<'_>) -> Result<Markup> {
    let figure = |picture| before_after(picture, page.diagnosis);
    let figures = page.pictures.iter().map(figure).collect::<Result<Vec<Markup>>>()?;
    if figures.is_empty() {
        return Ok(html! {});
    }
    let twins = page.pictures.iter().any(|p| p.twin.is_some());
    let title = if twins { "Recorded, remaining, simulated" } else { "Recorded and remaining" };
    let content = html! {
        p {
            "Residuals of single views: mean depth minus the plane, along the optical axis, in mm. Blue is nearer, \
             red farther, white no error, grey not the target. Where everything is explained, the second \
             picture shows noise alone"
            @if twins { ", and the third, simulated with the extended model, looks like the first" }
            "."
        }
        @for figure in figures { (figure) }
    };
    Ok(section(title, &content))
}

fn before_after(picture: &ViewPictures, diagnosis: &Diagnosis) -> Result<Markup> {
    let view = &diagnosis.views[picture.view];
    let beyond = match diagnosis.reference {
        Reference::Model => "",
        Reference::SimulatedRecording => ", recorded minus simulated",
    };
    let (z, tilt, frames) = (view.z_m, degrees(view.theta_rad), counted(view.frames, "frame"));
    let of_view = format!("View {}{beyond}: {z:.2} m, tilt {tilt}°, mean of {frames}", view.name);
    let range = scale(&picture.before);
    let [before, after] = [&picture.before, &picture.after].map(|p| rms(p.iter().copied()));
    let twin = picture.twin.as_deref().map_or_else(String::new, |twin| {
        let apart = rms(picture.before.iter().zip(twin).map(|(r, t)| r - t));
        format!("; the simulation is {apart:.2} mm from the recording")
    });
    let caption = format!("{of_view}. Residual {before:.2} mm rms, remaining {after:.2} mm{twin}.");
    let simulated = picture.twin.as_ref().map(|twin| ("simulated", twin));
    let titled = [("recorded", &picture.before), ("remaining", &picture.after)];
    let panel = |(title, values): (&str, &Vec<f32>)| {
        let (size, alt) = ([picture.width, picture.height], format!("{title}: {caption}"));
        let image = residual_image(size, values, range, &alt)?;
        Ok(html! { div { p { (title) } (image) } })
    };
    let panels = titled.into_iter().chain(simulated).map(panel).collect::<Result<Vec<Markup>>>()?;
    let end = Axis::label(range);
    Ok(html! {
        figure {
            div.panels { @for panel in panels { (panel) } }
            div.scale { span { "−" (end) " mm, nearer" } span { "0" } span { "farther, +" (end) " mm" } }
            figcaption { (caption) }
        }
    })
}

/// Root mean square of the finite pixels.
fn rms(values: impl Iterator<Item = f32>) -> f64 {
    let finite = values.filter(|v| v.is_finite()).map(f64::from);
    let (square, n) = finite.fold((0.0, 0.0), |(sum, n), v| (sum + v * v, n + 1.0));
    (square / f64::max(n, 1.0)).sqrt()
}

#[cfg(test)]
mod tests;
