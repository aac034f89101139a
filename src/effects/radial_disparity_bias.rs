//! A bowl in disparity.

use super::{Card, Draw, Effect, Exposure, Parameter, Settings, Stage};

pub struct RadialDisparityBias;

static CARD: Card = Card {
    id: "radial-disparity-bias",
    title: "radial disparity bias",
    stage: Stage::Disparity,
    summary: "lens or projector off their calibration by a smooth bowl of disparity about the principal point: in depth it grows with z^2",
    parameters: &[Parameter {
        name: "k_px",
        unit: "px",
        range: [-4.0, 4.0],
        typical: 0.5,
        summary: "disparity too large by this at the corner radius",
    }],
    identity: 0.0,
    statistic: "bias",
    axis: "radius",
    confused_with: "target-bow, which stays with the board and does not grow with z; lens-distortion, which a frontal plane does not show; range-not-depth, whose bowl grows with z and has no free size",
    reference: "Herrera, Kannala and Heikkila 2012: D(u,v) of the disparity; Teichman et al. 2013 (CLAMS)",
};

impl Effect for RadialDisparityBias {
    fn card(&self) -> &'static Card {
        &CARD
    }

    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let k = settings.at(0);
        let radius = exposure.radius();
        exposure.shift_disparity(|i| k * radius(i).powi(2));
    }
}
