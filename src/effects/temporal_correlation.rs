//! The firmware filters over time.

use super::{Card, Draw, Effect, Exposure, Parameter, Settings, Stage};

pub struct TemporalCorrelation;

pub(super) static CARD: Card = Card {
    id: "temporal-correlation",
    title: "noise correlated between frames",
    stage: Stage::NoiseInTime,
    summary: "the firmware carries part of a frame over into the next: noise stays the same size and hangs together over frames",
    parameters: &[Parameter {
        name: "rho",
        range: [0.0, 0.999],
        typical: 0.5,
        summary: "correlation of a pixel's noise from one frame to the next",
    }],
    statistic: "correlation",
    axis: "frame",
    confused_with: "frozen-noise, which never decays while the scene stands still",
    reference: "librealsense, temporal filter: alpha 0.4, which is rho 0.6",
    ..Card::BASE
};

impl Effect for TemporalCorrelation {
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let rho = settings.at(0) as f32;
        let fresh = (1.0 - rho * rho).sqrt();
        if let Some(last) = exposure.memory.get(CARD.id) {
            // First-order autoregression; the fresh part keeps the variance at one.
            for (noise, last) in exposure.noise.iter_mut().zip(last) {
                *noise = rho * last + fresh * *noise;
            }
        }
        exposure.memory.insert(CARD.id, exposure.noise.clone());
    }
}
