//! A dark surface is noisier.

use super::{Bounds, Card, Draw, Effect, Estimate, Exposure, Fitted, Flat, Parameter, Settings, Stage};
use crate::camera::Camera;
use crate::scene::WHITE;
use crate::terms::{Basis, Coordinate, Modulation, Term};

pub struct IntensityDependentNoise;

pub(super) static CARD: Card = Card {
    id: "intensity-dependent-noise",
    title: "noise that depends on intensity",
    stage: Stage::Variance,
    summary: "a dark surface sends back less of the pattern, and the match is noisier: an infrared picture of a printed target shows it",
    parameters: &[Parameter {
        name: "exponent",
        range: [0.0, 4.0],
        typical: 0.5,
        summary: "sigma goes with the reflectance to minus this; nothing changes on white paper",
    }],
    statistic: "variance",
    axis: "intensity",
    confused_with: "vignetting, which stays in the picture and not on the print; ambient-light, which goes with the room",
    reference: "Mallick, Das and Majumdar 2014; shot noise: 0.5",
    is_symptom: true,
    ..Card::BASE
};

impl Effect for IntensityDependentNoise {
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let exponent = settings.at(0);
        for (sigma, albedo) in exposure.sigma.iter_mut().zip(&exposure.seen.albedo) {
            let grey = f64::from(*albedo).max(DARKEST) / WHITE;
            *sigma *= grey.powf(-exponent) as f32;
        }
    }

    /// None for a target of one grey.
    fn shapes(&self, bounds: &Bounds) -> Vec<Basis> {
        let kinds = [(1, false), (1, true), (2, true)].into_iter();
        let seen = kinds.filter(|_| bounds.reach.is_unevenly_lit());
        seen.map(|(orders, level)| dark(orders, level)).collect()
    }

    /// The noise falls with the light, from its median to twice that: the greys of a print reach as far. Where it
    /// rises, the room shines on the target.
    fn agrees_with(&self, _: Option<&Flat>, _: &Basis, coefficients: &[f64]) -> bool {
        let bend = coefficients.get(BEND).copied().unwrap_or(0.0);
        let slope = |light: f64| coefficients[0] + 2.0 * bend * light.ln();
        slope(1.0) < 0.0 && slope(2.0) < 0.0
    }

    /// Exponent of the power law; where the shape has a bend, of the fit without it.
    fn estimates(&self, fit: &Fitted) -> Vec<Estimate> {
        let plain = fit.without(BEND);
        let fit = plain.as_ref().map_or(*fit, |(coefficients, covariance)| Fitted {
            coefficients,
            covariance,
            ..*fit
        });
        vec![fit.estimate("exponent", &|b| -0.5 * b[0])]
    }

    fn term(&self, settings: &Settings, _: &Camera) -> Option<Term> {
        Some(Term::variance(dark(1, false), vec![-2.0 * settings.at(0)]))
    }
}

/// Index of the coefficient that bends the law, after its slope and the level.
const BEND: usize = 2;
/// Least reflectance: that of black velvet.
const DARKEST: f64 = 0.01;

/// Polynomial in log light, optionally with a level: what counts as light is arbitrary.
fn dark(orders: usize, level: bool) -> Basis {
    Basis::Powers { over: Coordinate::LogLight, orders, level, times: Modulation::One }
}
