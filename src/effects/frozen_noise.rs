//! Laser speckle is static.

use super::{Card, Draw, Effect, Exposure, Parameter, Scope, Settings, Stage, normals};

pub struct FrozenNoise;

pub(super) static CARD: Card = Card {
    id: "frozen-noise",
    title: "frozen noise",
    stage: Stage::NoiseAtRest,
    summary: "the grain of laser light stands still while the scene does: part of the noise is the same in every frame of a view and another in the next view",
    parameters: &[Parameter {
        name: "fraction",
        range: [0.0, 1.0],
        typical: 0.8,
        summary: "of the variance that stands still",
    }],
    statistic: "correlation",
    axis: "frame",
    confused_with: "fixed-pattern-noise, which is the same in every view; temporal-correlation, which dies out over frames",
    reference: "Landau, Choo and Beling 2015: dot energy Gamma(4.54, 0.196)",
    ..Card::BASE
};

impl Effect for FrozenNoise {
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, draw: &Draw) {
        let fraction = settings.at(0);
        let (at_rest, alive) = (fraction.sqrt() as f32, (1.0 - fraction).sqrt() as f32);
        let grain = |e: &Exposure| normals(e.pixels(), draw.stream(Scope::View, "grain"));
        exposure.with_kept(CARD.id, grain, |e, grain| {
            for (noise, grain) in e.noise.iter_mut().zip(grain) {
                *noise = at_rest * grain + alive * *noise;
            }
        });
    }
}
