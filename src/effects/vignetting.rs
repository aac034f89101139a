//! Less light at the corners.

use super::{Card, Draw, Effect, Exposure, Parameter, Settings, Stage};

pub struct Vignetting;

static CARD: Card = Card {
    id: "vignetting",
    title: "vignetting",
    stage: Stage::Variance,
    summary: "less light reaches the corners of the picture, and less light is more noise",
    parameters: &[Parameter {
        name: "growth",
        unit: "",
        range: [0.0, 10.0],
        typical: 0.5,
        summary: "by how much sigma is larger at the corner radius, as a share",
    }],
    identity: 0.0,
    statistic: "variance",
    axis: "radius",
    confused_with: "slope-noise: even a frontal target is met at an angle off the axis, but that grows with the tilt",
    reference: "Choo et al. 2014: radial factors beside depth; cos^4 law",
};

impl Effect for Vignetting {
    fn card(&self) -> &'static Card {
        &CARD
    }

    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let growth = settings.at(0);
        let radius = exposure.radius();
        for i in 0..exposure.pixels() {
            let factor = 1.0 + growth * radius(i).powi(2);
            exposure.sigma[i] *= factor as f32;
            // Shot noise: the standard deviation goes with one over the root of the light.
            exposure.light[i] /= (factor * factor) as f32;
        }
    }
}
