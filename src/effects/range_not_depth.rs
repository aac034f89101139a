//! The file holds the ray length.

use super::{Card, Draw, Effect, Exposure, Parameter, Settings, Stage};

pub struct RangeNotDepth;

static CARD: Card = Card {
    id: "range-not-depth",
    title: "range stored as depth",
    stage: Stage::Driver,
    summary: "the file holds the length of the ray where depth along the axis is expected: a flat wall becomes a bowl",
    parameters: &[Parameter {
        name: "share",
        unit: "",
        range: [0.0, 1.0],
        typical: 1.0,
        summary: "how much of the ray length over the depth is in the file",
    }],
    identity: 0.0,
    statistic: "bias",
    axis: "radius",
    confused_with: "radial-disparity-bias, which grows with z^2 and has any size: this one grows with z and is z r^2 / (2 f^2), no more and no less",
    reference: "geometry: 1 / cos of the angle off the axis; 5.8 % at 200 px from the middle of a Kinect",
};

impl Effect for RangeNotDepth {
    fn card(&self) -> &'static Card {
        &CARD
    }

    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let share = settings.at(0);
        for i in 0..exposure.pixels() {
            let (x, y) = exposure.rays.at(i);
            let excess = (1.0 + x * x + y * y).sqrt() - 1.0;
            exposure.depth[i] *= (1.0 + share * excess) as f32;
        }
    }
}
