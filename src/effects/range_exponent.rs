//! Noise grows with another power of z.

use super::{Card, Draw, Effect, Exposure, Parameter, Settings, Stage};

pub struct RangeExponent;

static CARD: Card = Card {
    id: "range-exponent",
    title: "noise with another power of distance",
    stage: Stage::Variance,
    summary: "noise grows with another power of the distance than the form allows",
    parameters: &[Parameter {
        name: "excess",
        unit: "",
        range: [-4.0, 4.0],
        typical: 0.5,
        summary: "added to the exponent of z; nothing changes at 2 m",
    }],
    identity: 0.0,
    statistic: "variance",
    axis: "z",
    confused_with: "ambient-light, which also grows with z but goes with the light of the room; disparity-quantisation, which adds noise as z^2",
    reference: "Khoshelham and Elberink 2012: z^2; time of flight: other powers",
};

impl Effect for RangeExponent {
    fn card(&self) -> &'static Card {
        &CARD
    }

    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let excess = settings.at(0);
        for (sigma, z) in exposure.sigma.iter_mut().zip(&exposure.seen.depth) {
            *sigma *= (f64::from(*z) / PIVOT_M).powf(excess) as f32;
        }
    }
}

/// Where the noise is the form's: the middle (in ratio) of a Kinect's 1 to 4 m.
const PIVOT_M: f64 = 2.0;
