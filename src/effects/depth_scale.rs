//! Depth is off by a factor.

use super::{Card, Draw, Effect, Exposure, Inverse, Parameter, Settings, Stage};
use crate::camera::Camera;

pub struct DepthScale;

pub(super) static CARD: Card = Card {
    id: "depth-scale",
    title: "a wrong depth scale",
    stage: Stage::Driver,
    summary: "focal length or baseline are wrong: every depth is off by the same factor; only reference distances show it",
    parameters: &[Parameter {
        name: "scale",
        range: [0.5, 2.0],
        typical: 1.035,
        summary: "stored depth over true depth",
    }],
    identity: 1.0,
    statistic: "bias",
    axis: "z",
    confused_with: "disparity-offset, whose error grows with z^2; thermal-drift, which changes during the session",
    reference: "TUM RGB-D benchmark: 1.035 for freiburg1",
    ..Card::BASE
};

impl Effect for DepthScale {
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let scale = settings.at(0) as f32;
        exposure.depth.iter_mut().for_each(|z| *z *= scale);
    }

    fn inverse(&self, settings: &Settings, _: &Camera) -> Option<Inverse> {
        Some(Inverse::Scale(settings.at(0)))
    }
}
