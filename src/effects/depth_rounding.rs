//! The driver rounds the depth to a constant step.

use super::{Card, Draw, Effect, Exposure, Parameter, Settings, Stage};

pub struct DepthRounding;

pub(super) static CARD: Card = Card {
    id: "depth-rounding",
    title: "depth rounding",
    stage: Stage::Word,
    summary: "the driver stores depth in whole steps of a constant size: the same gaps at every distance",
    parameters: &[Parameter {
        name: "step_m",
        range: [0.0, 0.1],
        typical: 0.001,
        summary: "one step of the stored depth",
    }],
    statistic: "distribution",
    axis: "z",
    confused_with: "disparity-quantisation, whose gaps grow with z^2",
    reference: "OpenNI and the Microsoft SDK: whole millimetres; the TUM layout: 0.2 mm",
    ..Card::BASE
};

impl Effect for DepthRounding {
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let step = settings.at(0) as f32;
        exposure.depth.iter_mut().for_each(|z| *z = (*z / step).round() * step);
    }
}
