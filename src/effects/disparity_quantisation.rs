//! The matcher returns disparity in steps.

use super::{Card, Draw, Effect, Exposure, Parameter, Settings, Stage};
use crate::sensors::SensorKind;

pub struct DisparityQuantisation;

pub(super) static CARD: Card = Card {
    id: "disparity-quantisation",
    title: "disparity quantisation",
    stage: Stage::Quantiser,
    summary: "the matcher answers in steps of a fraction of a pixel: only some depths occur, their gaps growing with z^2",
    parameters: &[Parameter {
        name: "step_px",
        range: [0.0, 4.0],
        typical: 0.125,
        summary: "one step of the disparity",
    }],
    kinds: SensorKind::MATCHING,
    statistic: "distribution",
    axis: "disparity-phase",
    confused_with: "depth-rounding, whose gaps do not grow with z; pixel-locking, which shifts the mean and leaves no comb",
    reference: "Konolige and Mihelich, ROS kinect_calibration/technical: 1/8 px",
    ..Card::BASE
};

impl Effect for DisparityQuantisation {
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let step = settings.at(0) as f32;
        exposure.disparity.iter_mut().for_each(|d| *d = (*d / step).round() * step);
    }
}
