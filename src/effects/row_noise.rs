//! A row is shifted as one.

use super::{Card, Draw, Effect, Exposure, Parameter, Settings, Stage, Scope, normals};

pub struct RowNoise;

pub(super) static CARD: Card = Card {
    id: "row-noise",
    title: "row noise",
    stage: Stage::Disparity,
    summary: "a row of the picture is read as one and shifted as one, afresh in each frame",
    parameters: &[Parameter {
        name: "sigma_px",
        range: [0.0, 4.0],
        typical: 0.03,
        summary: "standard deviation of the shift",
    }],
    statistic: "correlation",
    axis: "row",
    confused_with: "spatial-correlation, which reaches as far along the columns as along the rows",
    reference: "row-wise read-out of image sensors (EMVA 1288, row noise)",
    ..Card::BASE
};

impl Effect for RowNoise {
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, draw: &Draw) {
        let (sigma, width) = (settings.at(0), exposure.seen.width);
        let rows = normals(exposure.seen.height, draw.stream(Scope::Frame, "rows"));
        exposure.shift_disparity(|i| sigma * f64::from(rows[i / width]));
    }
}
