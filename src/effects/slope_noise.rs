//! Lateral noise becomes depth noise on a slope.

use super::{Card, Draw, Effect, Exposure, Parameter, Settings, Stage};

pub struct SlopeNoise;

static CARD: Card = Card {
    id: "slope-noise",
    title: "extra noise on slopes",
    stage: Stage::Variance,
    summary: "a pixel does not know to a fraction where it looks: on a slope that is an error of depth, growing with z tan(theta)",
    parameters: &[Parameter {
        name: "sigma_lateral_px",
        unit: "px",
        range: [0.0, 10.0],
        typical: 0.8,
        summary: "standard deviation of the place a pixel looks at",
    }],
    identity: 0.0,
    statistic: "variance",
    axis: "theta",
    confused_with: "the tilt term of the form, which is near nothing below 70 degrees and grows with z^2; tilt-axis-anisotropy, which prefers a direction",
    reference: "Nguyen, Izadi and Lovell 2012: 0.8 px and more",
};

impl Effect for SlopeNoise {
    fn card(&self) -> &'static Card {
        &CARD
    }

    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let lateral = settings.at(0) / exposure.sensor.camera.fx;
        for i in 0..exposure.pixels() {
            let slope = f64::from(exposure.seen.depth[i]) * exposure.seen.theta(i).tan();
            exposure.sigma[i] = f64::from(exposure.sigma[i]).hypot(lateral * slope) as f32;
        }
    }
}
