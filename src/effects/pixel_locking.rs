//! Sub-pixel interpolation leans.

use std::f32::consts::TAU;

use super::{Card, Draw, Effect, Exposure, Parameter, Settings, Stage};

pub struct PixelLocking;

static CARD: Card = Card {
    id: "pixel-locking",
    title: "pixel locking",
    stage: Stage::Disparity,
    summary: "interpolating the peak of the match leans toward whole pixels: an error periodic in disparity, one wave a pixel, seen as contour lines on tilted planes",
    parameters: &[Parameter {
        name: "amplitude_px",
        unit: "px",
        range: [0.0, 0.5],
        typical: 0.05,
        summary: "height of the wave",
    }],
    identity: 0.0,
    statistic: "bias",
    axis: "disparity-phase",
    confused_with: "disparity-quantisation, whose comb is finer (a fraction of a pixel) and keeps the mean; target-bow, which moves with the board",
    reference: "Shimizu and Okutomi 2001, sub-pixel estimation error cancellation: 0.04 to 0.06 px for a 9 x 9 window on random dots",
};

impl Effect for PixelLocking {
    fn card(&self) -> &'static Card {
        &CARD
    }

    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let amplitude = settings.at(0) as f32;
        for d in &mut exposure.disparity {
            // Between two whole pixels the answer is drawn to the nearer one.
            *d -= amplitude * (TAU * d.fract()).sin();
        }
    }
}
