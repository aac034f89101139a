//! Warm-up.

use super::{Card, Draw, Effect, Exposure, Inverse, Parameter, Settings, Stage};
use crate::camera::Camera;

pub struct ThermalDrift;

pub(super) static CARD: Card = Card {
    id: "thermal-drift",
    title: "thermal drift",
    stage: Stage::Driver,
    summary: "the sensor warms itself: its geometry drifts towards a limit in the course of the session",
    parameters: &[
        Parameter {
            name: "relative",
            range: [-0.2, 0.2],
            typical: 0.005,
            summary: "change of depth in the end, as a share of it",
        },
        Parameter {
            name: "time_constant_s",
            range: [1.0, 100000.0],
            typical: 900.0,
            summary: "time after which 63 % of it has come",
        },
    ],
    statistic: "bias",
    axis: "session-time",
    confused_with: "depth-scale, where distances were taken in the order of time; target-motion, which is within a view",
    reference: "Tolgyessy et al. 2021: 20 min and more; Fiedler and Mueller 2012",
    ..Card::BASE
};

impl Effect for ThermalDrift {
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let (relative, constant) = (settings.at(0), settings.at(1));
        // First-order heating: 1 - exp(-t / tau), from cold at the session's begin.
        let warmth = -(-exposure.instant.session_s / constant).exp_m1();
        let scale = (1.0 + relative * warmth) as f32;
        exposure.depth.iter_mut().for_each(|z| *z *= scale);
    }

    fn inverse(&self, settings: &Settings, _: &Camera) -> Option<Inverse> {
        Some(Inverse::Drift { relative: settings.at(0), time_constant_s: settings.at(1) })
    }
}
