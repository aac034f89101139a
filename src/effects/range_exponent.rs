//! Noise grows with another power of z.

use super::{Bounds, Card, Draw, Effect, Estimate, Exposure, Fitted, Known, Parameter, Settings, Smallest, Stage};
use crate::camera::Camera;
use crate::terms::{Basis, Coordinate, Modulation, PixelContext, Term};

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
    statistic: "variance",
    axis: "z",
    confused_with: "ambient-light, which also grows with z but goes with the light of the room; disparity-quantisation, which adds noise as z^2",
    reference: "Khoshelham and Elberink 2012: z^2; time of flight: other powers",
    is_symptom: true,
    ..Card::BASE
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

    fn shapes(&self, _: &Bounds) -> Vec<Basis> {
        [1, 2, 4].map(power_law).into()
    }

    fn plain(&self, _: Basis) -> Basis {
        power_law(1)
    }

    /// Between the ends of what was seen.
    fn estimates(&self, fit: &Fitted) -> Vec<Estimate> {
        let [near, far] = fit.reach.z;
        let at = |z: f64| PixelContext { z, ..PixelContext::default() };
        vec![fit.estimate("excess", &|b| {
            0.5 * (fit.value(b, at(far)) - fit.value(b, at(near))) / (far / near).ln().max(1e-3)
        })]
    }

    fn term(&self, known: Known, _: &Camera) -> Option<Term> {
        Some(Term::variance(power_law(1), vec![2.0 * known("excess")?]))
    }

    fn smallest(&self, _: &Bounds) -> Option<Smallest> {
        let (parameter, shape) = ("excess", power_law(1));
        Some(Smallest { parameter, shape, unit: vec![1.0], of: |a| 0.5 * a })
    }
}

/// Where the noise is the form's: the middle (in ratio) of a Kinect's 1 to 4 m.
const PIVOT_M: f64 = 2.0;

/// Of ln z.
fn power_law(orders: usize) -> Basis {
    Basis::powers(Coordinate::LogRatio(PIVOT_M), orders, Modulation::One)
}
