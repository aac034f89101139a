//! Residuals of single views side by side: recorded, with the extended model, and its twin.

use maud::{Markup, html};

use crate::error::Result;
use crate::report::axis::Axis;
use crate::report::base64;
use crate::report::residual_picture::disparity_png;

/// The residual of one view before and after, row by row; NaN where there is no data.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Under the pictures.
    pub caption: String,
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// As recorded, against the model that was given.
    pub before: Vec<f32>,
    /// As recorded, against the extended model.
    pub after: Vec<f32>,
    /// The extended model simulated again, against the model that was given.
    pub simulated: Option<Vec<f32>>,
    /// Of disparity: what is larger is nearer.
    pub unit: &'static str,
    /// Where the colours end.
    pub range: f32,
}

pub(super) fn section(pictures: &[Picture]) -> Result<Markup> {
    let figures = pictures.iter().map(figure).collect::<Result<Vec<Markup>>>()?;
    Ok(html! {
        @if !figures.is_empty() {
            section {
                h2 { "Before and after, as pictures" }
                p {
                    "What is left of single views when their flat board is taken out. White is no error, blue too near, \
                     red too far, grey no data. When all is explained, the second picture shows noise alone"
                    @if pictures.iter().any(|p| p.simulated.is_some()) {
                        ", and the twin, which is nothing but simulation, looks like the first"
                    }
                    "."
                }
                @for figure in figures { (figure) }
            }
        }
    })
}

fn figure(picture: &Picture) -> Result<Markup> {
    let panels = [
        ("recorded residual", Some(&picture.before)),
        ("after the extended model", Some(&picture.after)),
        ("twin: the extended model re-simulated", picture.simulated.as_ref()),
    ];
    let panels = panels
        .into_iter()
        .filter_map(|(title, values)| Some((title, values?)))
        .map(|(title, values)| panel(title, values, picture))
        .collect::<Result<Vec<Markup>>>()?;
    // An f32's decimals end after the seventh digit.
    let end = Axis::label((f64::from(picture.range) * 1e6).round() / 1e6);
    Ok(html! {
        figure.before-after {
            div.panels { @for panel in panels { (panel) } }
            div.scale.disparity {
                span { "−" (end) " " (picture.unit) ", too far" }
                span { "0" }
                span { "too near, +" (end) " " (picture.unit) }
            }
            figcaption { (picture.caption) }
        }
    })
}

fn panel(title: &str, values: &[f32], picture: &Picture) -> Result<Markup> {
    let size = [picture.width, picture.height];
    let png = base64::encode(&disparity_png(size, values, f64::from(picture.range))?);
    Ok(html! {
        div {
            p.panel-title { (title) }
            img alt={ (title) ": " (picture.caption) } width=(picture.width) height=(picture.height)
                src={ "data:image/png;base64," (png) };
        }
    })
}
