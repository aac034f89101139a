//! Gross mismatches.

use super::{Card, Draw, Effect, Exposure, Parameter, Settings, Stage, Scope, chance, normals};

pub struct HeavyTails;

pub(super) static CARD: Card = Card {
    id: "heavy-tails",
    title: "heavy-tailed noise",
    stage: Stage::NoiseTails,
    summary: "now and then the match locks to a wrong place: errors come from a mixture with a wide part, not from one Gaussian",
    parameters: &[
        Parameter {
            name: "fraction",
            range: [0.0, 1.0],
            typical: 0.02,
            summary: "of the pixels, afresh in every frame",
        },
        Parameter {
            name: "scale",
            range: [1.0, 100.0],
            typical: 5.0,
            summary: "how many times wider their errors are",
        },
    ],
    statistic: "distribution",
    axis: "residual",
    confused_with: "vignetting, slope-noise and other uneven noise, which looks heavy-tailed when pooled: divide by the local sigma first",
    reference: "Mallick, Das and Majumdar 2014, review; 0.1 to 5 % of the pixels",
    is_symptom: true,
    ..Card::BASE
};

impl Effect for HeavyTails {
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, draw: &Draw) {
        let (fraction, scale) = (settings.at(0), settings.at(1) as f32);
        let mut which = draw.stream(Scope::Frame, "which");
        let wide = normals(exposure.pixels(), draw.stream(Scope::Frame, "errors"));
        for (noise, wide) in exposure.noise.iter_mut().zip(wide) {
            if chance(fraction, &mut which) {
                *noise = scale * wide;
            }
        }
    }
}
