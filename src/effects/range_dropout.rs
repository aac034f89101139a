//! No depth far away, or too near.

use super::{Card, Draw, Effect, Exposure, Parameter, Settings, Stage, Scope, chance, logistic};

pub struct RangeDropout;

pub(super) static CARD: Card = Card {
    id: "range-dropout",
    title: "dropout out of range",
    stage: Stage::Dropout,
    summary: "too far away the pattern is too faint, too near it is too bright: the match finds nothing",
    parameters: &[
        Parameter {
            name: "share",
            range: [0.0, 1.0],
            typical: 1.0,
            summary: "of the pixels well beyond the distance that are lost",
        },
        Parameter {
            name: "z50_m",
            range: [0.0, 20.0],
            typical: 4.0,
            summary: "depth at which half of that share is lost",
        },
        Parameter {
            name: "width_m",
            range: [-2.0, 2.0],
            typical: 0.1,
            summary: "how gradual: from a quarter to three quarters over 2.2 times this; negative loses what is nearer",
        },
    ],
    statistic: "missing",
    axis: "z",
    confused_with: "grazing-dropout, which goes with the tilt; ambient-light, which adds noise before it loses",
    reference: "Microsoft SDK: 0.8 to 4 m, near mode 0.4 to 3 m",
    is_symptom: true,
    ..Card::BASE
};

impl Effect for RangeDropout {
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, draw: &Draw) {
        let (share, half, width) = (settings.at(0), settings.at(1), settings.at(2));
        let mut rng = draw.stream(Scope::Frame, "lost");
        for i in 0..exposure.pixels() {
            let beyond = f64::from(exposure.seen.depth[i]) - half;
            if chance(share * logistic(beyond, width), &mut rng) {
                exposure.disparity[i] = f32::NAN;
            }
        }
    }
}
