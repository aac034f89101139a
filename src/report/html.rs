//! The page of a calibration: one self-contained file, no scripts.

mod gallery;
mod model;
mod provenance;
mod summary;
mod views;
mod warnings;

use maud::{Markup, PreEscaped, html};

use super::document::document;
use super::figure2::{Figure2, Overlay};
use super::sigma_map::SigmaMap;
use crate::calibrate::{Calibration, Measurements};
use crate::error::Result;
use crate::view::Sensor;

/// What the page is about; a bare table has neither sensor nor measurements.
#[derive(Debug, Clone, Copy)]
pub struct CalibrationPage<'a> {
    /// Of the page.
    pub title: &'a str,
    /// The unit, when a recording was measured.
    pub sensor: Option<&'a Sensor>,
    /// Its views.
    pub measurements: Option<&'a Measurements>,
    /// The model with all that belongs to it.
    pub calibration: &'a Calibration,
    /// Drawn into Fig. 2.
    pub overlays: &'a [Overlay],
}

/// The page as text.
///
/// # Errors
/// When a picture cannot be drawn.
pub fn calibration_page(input: &CalibrationPage<'_>) -> Result<String> {
    let calibration = input.calibration;
    let figure2 = Figure2::of(&calibration.table, &calibration.model.sigma, input.overlays);
    let map = SigmaMap::of(&calibration.table, &calibration.model.sigma);
    let body = html! {
        (heading(input))
        (summary::section(input))
        (figure(&figure2.svg()?, "Noise against tilt. Each point is a measured σ, its bar one standard error; \
            colour and shape tell the distance. Curves are the fit at the median distance of each colour, \
            drawn only over the tilts that were measured. A point is carried along the fitted surface from its \
            own distance to its curve's, so that its height over the curve is its relative residual; \
            measurements.csv has it as measured."))
        (figure(&map.svg()?, "The fitted σ where it is valid. Dots are the measured cells: far from them \
            the colour is interpolation."))
        (model::section(calibration))
        (warnings::section(input))
        @if let Some(measurements) = input.measurements {
            (views::section(&measurements.views))
            (gallery::section(&measurements.views)?)
        }
        (provenance::section(&calibration.model.provenance))
    };
    Ok(document(input.title, None, &body).into_string())
}

fn heading(input: &CalibrationPage<'_>) -> Markup {
    html! {
        header {
            h1 { (input.title) }
            @match input.sensor {
                Some(sensor) => p.sub {
                    (sensor.name)
                    @if let Some(serial) = &sensor.serial { ", serial " (serial) }
                    @if let Some(mode) = &sensor.mode { ", " (mode) " mode" }
                    ", " (sensor.camera.width) " × " (sensor.camera.height) " px"
                },
                None => p.sub { "fitted to a table of sigmas; the recording is not part of this page" },
            }
        }
    }
}

fn figure(svg: &str, caption: &str) -> Markup {
    html! {
        figure {
            div.wide role="img" aria-label=(caption) { (PreEscaped(svg)) }
            figcaption { (caption) }
        }
    }
}

#[cfg(test)]
mod tests;
