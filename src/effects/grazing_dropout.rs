//! No depth at grazing angles.

use super::{Card, Draw, Effect, Exposure, Parameter, Settings, Stage, Scope, chance, logistic};

pub struct GrazingDropout;

pub(super) static CARD: Card = Card {
    id: "grazing-dropout",
    title: "dropout at grazing tilts",
    stage: Stage::Dropout,
    summary: "at grazing angles the pattern smears and the match finds nothing",
    parameters: &[
        Parameter {
            name: "share",
            range: [0.0, 1.0],
            typical: 1.0,
            summary: "of the pixels well beyond the angle that are lost",
        },
        Parameter {
            name: "theta50_deg",
            range: [0.0, 90.0],
            typical: 75.0,
            summary: "tilt at which half of that share is lost",
        },
        Parameter {
            name: "width_deg",
            range: [0.0, 45.0],
            typical: 2.0,
            summary: "how gradual: from a quarter to three quarters over 2.2 times this",
        },
    ],
    statistic: "missing",
    axis: "theta",
    confused_with: "range-dropout, which does not go with the tilt; intensity-dependent-noise, since grazing surfaces are darker",
    reference: "Nguyen, Izadi and Lovell 2012: nothing beyond 80 degrees",
    ..Card::BASE
};

impl Effect for GrazingDropout {
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, draw: &Draw) {
        let (share, half, width) = (settings.at(0), settings.at(1), settings.at(2));
        let mut rng = draw.stream(Scope::Frame, "lost");
        for i in 0..exposure.pixels() {
            let beyond = exposure.seen.theta(i).to_degrees() - half;
            if chance(share * logistic(beyond, width), &mut rng) {
                exposure.disparity[i] = f32::NAN;
            }
        }
    }
}
