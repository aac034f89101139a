//! The board is not flat.

use super::{Card, Draw, Effect, Exposure, Parameter, Settings, Stage};

pub struct TargetBow;

static CARD: Card = Card {
    id: "target-bow",
    title: "a bent target",
    stage: Stage::Surface,
    summary: "the board is bent: its middle stands out towards the sensor, a parabola along its right, fixed on the board and not in the picture",
    parameters: &[
        Parameter {
            name: "sagitta_m",
            unit: "m",
            range: [-0.1, 0.1],
            typical: 0.004,
            summary: "rise of the middle over the ends, towards the sensor",
        },
        Parameter {
            name: "span_m",
            unit: "m",
            range: [0.05, 20.0],
            typical: 1.0,
            summary: "width of the board over which it is counted",
        },
    ],
    identity: 0.0,
    statistic: "bias",
    axis: "target-position",
    confused_with: "radial-disparity-bias and lens-distortion, which stay in the picture when the board moves; turn the board by 180 degrees, or move it aside",
    reference: "geometry of a bent plate: millimetres, whatever the distance",
};

impl Effect for TargetBow {
    fn card(&self) -> &'static Card {
        &CARD
    }

    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let Some(target) = exposure.seen.target else { return };
        let (sagitta, half_span) = (settings.at(0), 0.5 * settings.at(1));
        for i in 0..exposure.pixels() {
            if exposure.seen.is_target(i) {
                let (right, _) = target.place(&exposure.point(i));
                let lift = -sagitta * (right / half_span).powi(2);
                // The ends stay where the flat board had them.
                exposure.depth[i] = exposure.meet(i, exposure.rays.at(i), sagitta + lift) as f32;
            }
        }
    }
}
