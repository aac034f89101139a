//! Ambient light raises the background and the noise.

use super::{Bounds, Card, Draw, Effect, Estimate, Exposure, Fitted, Parameter, Settings, Stage};
use crate::camera::Camera;
use crate::terms::{Basis, Coordinate, PixelContext, ROOM_LUX, Term};

pub struct AmbientLight;

pub(super) static CARD: Card = Card {
    id: "ambient-light",
    title: "noise from ambient light",
    stage: Stage::Variance,
    summary: "light of the room adds to the pattern and brings its own shot noise: the farther the target, the fainter the pattern against it",
    parameters: &[Parameter {
        name: "ratio",
        range: [0.0, 100.0],
        typical: 0.05,
        summary: "light of a room of 500 lx over the pattern's, on a surface facing the sensor at 1 m",
    }],
    statistic: "variance",
    axis: "intensity",
    confused_with: "range-exponent, which does not go with the light of the room; intensity-dependent-noise: ambient light falls on the print as the pattern does, so that their ratio stays",
    reference: "Fankhauser et al. 2015",
    formula_error: 0.3,
    rests_on_a_measurement: true,
    ..Card::BASE
};

impl Effect for AmbientLight {
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let ratio = settings.at(0) * exposure.ambient_lux / ROOM_LUX;
        for i in 0..exposure.pixels() {
            // The ratio does not depend on the print; the pattern alone falls off with distance and angle.
            let facing = exposure.seen.cos_incidence(i, exposure.rays);
            let excess = ratio * exposure.point(i).norm_squared() / facing;
            if excess.is_finite() {
                // Shot noise of pattern and room together, relative to that of the pattern.
                exposure.sigma[i] *= (1.0 + excess).sqrt() as f32;
                exposure.light[i] *= (1.0 + excess) as f32;
            }
        }
    }

    /// Only where the ambient light was measured.
    fn shapes(&self, bounds: &Bounds) -> Vec<Basis> {
        let ratios = [0.003, 0.01, 0.03, 0.1, 0.3, 1.0].into_iter();
        let lit = ratios.filter(|_| bounds.reach.ambient[1] > 0.0);
        lit.map(room).collect()
    }

    fn estimates(&self, fit: &Fitted) -> Vec<Estimate> {
        let Basis::Log1p { over: Coordinate::Ambient(ratio) } = *fit.shape else {
            return Vec::new();
        };
        let ([_, z], [dim, bright]) = (fit.reach.z, fit.reach.ambient);
        let ambient = 0.5 * (dim + bright);
        let excess = ambient / ROOM_LUX * z * z;
        if excess <= 0.0 {
            return vec![fit.estimate("ratio", &|b| ratio * b[0])];
        }
        // Ratio that reproduces the noise at the far end: scaled shapes of other ratios agree there, but
        // not at zero distance.
        let far = PixelContext { z, rho: z, ambient, ..PixelContext::default() };
        vec![fit.estimate("ratio", &|b| fit.value(b, far).exp_m1() / excess)]
    }

    fn term(&self, settings: &Settings, _: &Camera) -> Option<Term> {
        Some(Term::variance(room(settings.at(0)), vec![1.0]))
    }
}

/// Ambient light relative to the pattern's.
fn room(ratio: f64) -> Basis {
    Basis::Log1p { over: Coordinate::Ambient(ratio) }
}
