//! The reference disparity is wrong.

use super::{Card, Draw, Effect, Exposure, Inverse, Parameter, Settings, Stage};
use crate::camera::Camera;
use crate::sensors::SensorKind;
use crate::terms::{Basis, Term};

pub struct DisparityOffset;

pub(super) static CARD: Card = Card {
    id: "disparity-offset",
    title: "a constant disparity offset",
    stage: Stage::Quantiser,
    summary: "the stored reference pattern stands at another distance than the firmware believes: every disparity is shifted by a constant, and depth errs with z^2; only reference distances show it",
    parameters: &[Parameter {
        name: "offset_px",
        range: [-4.0, 4.0],
        typical: 0.1,
        summary: "added to every disparity: positive brings things nearer",
    }],
    kinds: SensorKind::MATCHING,
    statistic: "bias",
    axis: "z",
    confused_with: "depth-scale, whose error grows with z; take at least five distances",
    reference: "Khoshelham and Elberink 2012, calibration parameters; Herrera et al. 2012",
    ..Card::BASE
};

impl Effect for DisparityOffset {
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let offset = settings.at(0);
        exposure.shift_disparity(|_| offset);
    }

    fn inverse(&self, settings: &Settings, _: &Camera) -> Option<Inverse> {
        Some(Inverse::Term(Term::bias(Basis::Level, vec![settings.at(0)])))
    }
}
