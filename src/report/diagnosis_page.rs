//! The page of a diagnosis: the answer on the first screen, the evidence below.

mod cards;
mod curve;
mod parameters;
mod sections;
mod sentences;
mod story;

use maud::{Markup, html};
pub use story::story;

use super::axis::Axis;
use super::document::{Kind, document};
use super::residuals::{residual_image, scale};
use crate::diagnose::{Diagnosis, Reference, Verdict, ViewPictures};
use crate::error::Result;

const KIND: Kind = Kind { class: "diagnosis", style: include_str!("diagnosis_page.css") };

/// What the page is about.
#[derive(Debug, Clone, Copy)]
pub struct DiagnosisPage<'a> {
    /// Of the page.
    pub title: &'a str,
    pub diagnosis: &'a Diagnosis,
    /// Views whose residuals are worth seeing; few, they are large.
    pub pictures: &'a [ViewPictures],
}

/// The page as text: one self-contained file, no scripts.
///
/// # Errors
/// When a picture cannot be drawn.
pub fn diagnosis_page(page: &DiagnosisPage<'_>) -> Result<String> {
    let diagnosis = page.diagnosis;
    let unsettled = diagnosis.verdict == Verdict::Inconclusive;
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
        @if unsettled { (sections::remarks(&diagnosis.remarks)) }
        (cards::findings(&diagnosis.findings)?)
        (cards::small_remains(&diagnosis.findings))
        section.outcome {
            (sections::held_out(diagnosis.heldout.as_ref()))
            (sections::remaining(diagnosis))
        }
        (sections::detectable(diagnosis))
        (sections::cannot_tell(&diagnosis.cannot_tell))
        (pictures(page)?)
        h1.evidence { "The evidence" }
        (sections::map(&diagnosis.map))
        (sections::views(&diagnosis.views))
        @if !unsettled { (sections::remarks(&diagnosis.remarks)) }
        p.note {
            "diagnosis.json has the same as data. σ is the standard deviation of a single reading in the model; sizes \
             in mm are root mean squares over the recording. A p-value is the chance of a difference this large if \
             the model were right."
        }
    };
    Ok(document(page.title, Some(KIND), &body).into_string())
}

fn pictures(page: &DiagnosisPage<'_>) -> Result<Markup> {
    let figure = |picture| before_after(picture, page.diagnosis);
    let figures = page.pictures.iter().map(figure).collect::<Result<Vec<Markup>>>()?;
    Ok(html! { @if !figures.is_empty() { section {
        h2 { "Residuals before and after" }
        p {
            "The residual of single views about their plane. White is no error, blue too near, red too far, grey no \
             data. Where everything is explained, the second picture shows noise alone."
            @if page.pictures.iter().any(|p| p.twin.is_some()) {
                " The twin is simulated with the extended model: it should look like the first picture."
            }
        }
        @for figure in figures { (figure) }
    } } })
}

fn before_after(picture: &ViewPictures, diagnosis: &Diagnosis) -> Result<Markup> {
    let view = &diagnosis.views[picture.view];
    let beyond = match diagnosis.reference {
        Reference::Model => "",
        Reference::SimulatedRecording => ", recorded minus simulated",
    };
    let (tilt, plural) = (view.theta_rad.to_degrees(), if view.frames == 1 { "" } else { "s" });
    let caption = format!(
        "View {}{beyond}: board at {:.2} m, tilted {tilt:.0}°; mean of {} frame{plural}",
        view.name, view.z_m, view.frames
    );
    let range = scale(&picture.before);
    let caption = picture.twin.as_deref().map_or(caption.clone(), |twin| {
        let apart = rms(picture.before.iter().zip(twin).map(|(r, t)| r - t));
        let [before, after] = [&picture.before, &picture.after].map(|p| rms(p.iter().copied()));
        format!(
            "{caption}. The twin is {apart:.3} px rms from the recording, whose residual is {before:.3} px, \
             and {after:.3} px with the extended model"
        )
    });
    let twin = picture.twin.as_ref().map(|twin| ("simulated twin", twin));
    let titled = [("as recorded", &picture.before), ("with the extended model", &picture.after)];
    let panel = |(title, values): (&str, &Vec<f32>)| {
        let (size, alt) = ([picture.width, picture.height], format!("{title}: {caption}"));
        // Of disparity: what is larger is nearer.
        let image = residual_image(size, values, -range, &alt)?;
        Ok(html! { div { p.panel-title { (title) } (image) } })
    };
    let panels = titled.into_iter().chain(twin).map(panel).collect::<Result<Vec<Markup>>>()?;
    let end = Axis::label(range);
    Ok(html! {
        figure.before-after {
            div.panels { @for panel in panels { (panel) } }
            div.scale.disparity {
                span { "−" (end) " px, too far" }
                span { "0" }
                span { "too near, +" (end) " px" }
            }
            figcaption { (caption) }
        }
    })
}

/// Root mean square of the pixels that there are.
fn rms(values: impl Iterator<Item = f32>) -> f64 {
    let finite = values.filter(|v| v.is_finite()).map(f64::from);
    let (square, n) = finite.fold((0.0, 0.0), |(sum, n), v| (sum + v * v, n + 1.0));
    (square / f64::max(n, 1.0)).sqrt()
}

#[cfg(test)]
mod tests;
