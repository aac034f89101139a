//! Something moved during the view.

use super::{Card, Draw, Effect, Exposure, Parameter, Settings, Stage};

pub struct TargetMotion;

pub(super) static CARD: Card = Card {
    id: "target-motion",
    title: "motion during a view",
    stage: Stage::Surface,
    summary: "target or sensor moved along the optical axis while the view was taken: frames disagree, and their mean is off",
    parameters: &[Parameter {
        name: "velocity_mps",
        range: [-1.0, 1.0],
        typical: 0.005,
        summary: "of the target away from the sensor",
    }],
    statistic: "bias",
    axis: "frame",
    confused_with: "thermal-drift, which goes on from view to view; frame-jitter, which has no direction",
    reference: "kinematics: velocity times time",
    ..Card::BASE
};

impl Effect for TargetMotion {
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let gone = settings.at(0) * exposure.instant.view_s;
        for i in 0..exposure.pixels() {
            if exposure.seen.is_target(i) {
                // A shift along the axis lifts the plane by its component along the normal.
                let lift = f64::from(exposure.seen.normal[i][2]) * gone;
                exposure.depth[i] = exposure.meet(i, exposure.rays.at(i), lift) as f32;
            }
        }
    }
}
