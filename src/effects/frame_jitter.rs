//! The whole frame is shifted as one.

use super::{Card, Draw, Effect, Exposure, Parameter, Settings, Stage, Scope, normals};

pub struct FrameJitter;

pub(super) static CARD: Card = Card {
    id: "frame-jitter",
    title: "frame jitter",
    stage: Stage::Disparity,
    summary: "the whole frame is shifted as one, afresh in each frame: vibration, or a reference that trembles",
    parameters: &[Parameter {
        name: "sigma_px",
        range: [0.0, 4.0],
        typical: 0.03,
        summary: "standard deviation of the shift",
    }],
    statistic: "correlation",
    axis: "frame",
    confused_with: "target-motion, which has a direction; temporal-correlation, which is each pixel's own",
    reference: "vibration of the mount or of the reference",
    ..Card::BASE
};

impl Effect for FrameJitter {
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, draw: &Draw) {
        let shift = normals(1, draw.stream(Scope::Frame, "frame"))[0];
        let shift = settings.at(0) * f64::from(shift);
        exposure.shift_disparity(|_| shift);
    }
}
