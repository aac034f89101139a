//! Less light at the corners.

use super::{Bounds, Card, Draw, Effect, Estimate, Exposure, Fitted, Parameter, Settings, Smallest, Stage};
use crate::camera::Camera;
use crate::terms::{Basis, Coordinate, Modulation, Term};

pub struct Vignetting;

pub(super) static CARD: Card = Card {
    id: "vignetting",
    title: "vignetting",
    stage: Stage::Variance,
    summary: "less light reaches the corners of the picture, and less light is more noise",
    parameters: &[Parameter {
        name: "growth",
        range: [0.0, 10.0],
        typical: 0.5,
        summary: "by how much sigma is larger at the corner radius, as a share",
    }],
    statistic: "variance",
    axis: "radius",
    confused_with: "slope-noise: even a frontal target is met at an angle off the axis, but that grows with the tilt",
    reference: "Choo et al. 2014: radial factors beside depth; cos^4 law",
    is_symptom: true,
    // Lenses that shade as cos^4 or at the rim alone: 0.21 rms over twelve sets, seed 7000.
    formula_error: 0.2,
    ..Card::BASE
};

impl Effect for Vignetting {
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let growth = settings.at(0);
        let radius = exposure.radius();
        for i in 0..exposure.pixels() {
            let factor = 1.0 + growth * radius(i).powi(2);
            exposure.sigma[i] *= factor as f32;
            // Shot noise: the standard deviation goes with the inverse square root of the light.
            exposure.light[i] /= (factor * factor) as f32;
        }
    }

    fn shapes(&self, _: &Bounds) -> Vec<Basis> {
        [1, 2].map(darker).into()
    }

    fn estimates(&self, fit: &Fitted) -> Vec<Estimate> {
        vec![fit.estimate("growth", &|b| (0.5 * b.iter().sum::<f64>()).exp() - 1.0)]
    }

    fn term(&self, settings: &Settings, _: &Camera) -> Option<Term> {
        let growth = settings.at(0);
        let nodes = 33;
        let values = (0..nodes)
            .map(|k| 2.0 * (growth * (k as f64 / (nodes - 1) as f64).powi(2)).ln_1p())
            .collect();
        let (over, times) = (Coordinate::Radius, Modulation::One);
        Some(Term::variance(Basis::Curve { over, low: 0.0, high: 1.0, nodes, times }, values))
    }

    fn smallest(&self, _: &Bounds) -> Option<Smallest> {
        let (parameter, shape) = ("growth", darker(1));
        Some(Smallest { parameter, shape, unit: vec![1.0], of: |a| (0.5 * a).exp() - 1.0 })
    }
}

/// Growth towards the corners.
fn darker(orders: usize) -> Basis {
    Basis::powers(Coordinate::RadiusSquared, orders, Modulation::One)
}
