//! Vertical stripes.

use super::{Card, Draw, Effect, Exposure, Parameter, Settings, Stage};

pub struct ColumnBanding;

static CARD: Card = Card {
    id: "column-banding",
    title: "column banding",
    stage: Stage::Disparity,
    summary: "the firmware applies a correction that is linear in the column in whole steps: what is left is a saw-tooth over the columns, the same in every row",
    parameters: &[
        Parameter {
            name: "amplitude_px",
            unit: "px",
            range: [0.0, 1.0],
            typical: 0.0625,
            summary: "half the height of a tooth: half a step of the read-out",
        },
        Parameter {
            name: "period_px",
            unit: "px",
            range: [2.0, 640.0],
            typical: 80.0,
            summary: "columns from one step to the next",
        },
    ],
    identity: 0.0,
    statistic: "bias",
    axis: "column",
    confused_with: "target-bow, which moves and turns with the board; disparity-quantisation on a tilted plane, whose contours move with the distance",
    reference: "OpenNI property GmcMode: a correction in the read-out's steps of 1/8 px; 2 to 8 bands",
};

impl Effect for ColumnBanding {
    fn card(&self) -> &'static Card {
        &CARD
    }

    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let (amplitude, period) = (settings.at(0), settings.at(1));
        let (width, centre) = (exposure.seen.width, exposure.sensor.camera.cx);
        exposure.shift_disparity(|i| {
            let bands = ((i % width) as f64 - centre) / period;
            // What rounding to the nearest whole step leaves, from -1 to 1.
            2.0 * amplitude * (bands.round() - bands)
        });
    }
}
