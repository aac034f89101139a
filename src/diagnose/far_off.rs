//! A recording that is far from the model, though no search found what its views have in common.

use serde_json::Map;

use super::diagnosis::{Finding, Size, Status};
use super::field::CLIP_SIGMAS;
use super::heldout::rms_by_view;
use super::layers::Survey;
use super::other_findings::named;
use crate::stats::median;
use crate::terms::{Axis, Statistic};

/// Beyond the clip a residual is no noise; a mean of thousands of them over half of the views is no match,
/// whatever it is. A search needs views that agree, and three of them never do for sure.
pub fn far_off(survey: &Survey, sigma_mm: f64) -> Option<Finding> {
    let sigma_px = survey.views.iter().map(|view| {
        let pixels: f64 = view.tiles.iter().map(|t| t.pixels).sum();
        let square: f64 = view.tiles.iter().map(|t| t.pixels * t.variance).sum();
        (square / pixels.max(1.0)).sqrt()
    });
    let rms_px = rms_by_view(survey, &[]);
    let mut off: Vec<f64> = rms_px.iter().zip(sigma_px).map(|(rms, sigma)| rms / sigma).collect();
    let sigma = median(&mut off);
    (sigma > f64::from(CLIP_SIGMAS)).then(|| Finding {
        status: Status::Unexplained,
        effect: None,
        alternatives: Vec::new(),
        parameters: Map::new(),
        share: 1.0,
        size: Size { mm: sigma * sigma_mm, sigma },
        physics: format!(
            "The views' mean errors are {sigma:.0} times the noise of a pixel, and these views do not say by what: \
             the model may be another sensor's, or views from more distances and tilts may tell."
        ),
        ..named("radial-disparity-bias", Statistic::Bias, Axis::Pixel)
    })
}
