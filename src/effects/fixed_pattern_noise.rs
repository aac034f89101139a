//! Each pixel has its own constant error.

use super::{Card, Draw, Effect, Exposure, Parameter, Scope, Settings, Stage, normals};

pub struct FixedPatternNoise;

pub(super) static CARD: Card = Card {
    id: "fixed-pattern-noise",
    title: "fixed-pattern noise",
    stage: Stage::Disparity,
    summary: "each pixel has a constant error of disparity of its own, the same in every view of this unit",
    parameters: &[Parameter {
        name: "sigma_px",
        range: [0.0, 4.0],
        typical: 0.05,
        summary: "standard deviation over the pixels",
    }],
    statistic: "bias",
    axis: "pixel",
    confused_with: "frozen-noise, which changes with the view; spatial-correlation, which is afresh in every frame",
    reference: "matching a 9 x 9 window of random dots: 0.05 to 0.1 px",
    ..Card::BASE
};

impl Effect for FixedPatternNoise {
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, draw: &Draw) {
        let sigma = settings.at(0);
        let pattern = |e: &Exposure| normals(e.pixels(), draw.stream(Scope::Sensor, "pixels"));
        exposure.with_kept(CARD.id, pattern, |e, own| {
            e.shift_disparity(|i| sigma * f64::from(own[i]));
        });
    }
}
