//! Sunlight lifts the background and the noise.

use super::{Card, Draw, Effect, Exposure, Parameter, Settings, Stage};

pub struct AmbientLight;

static CARD: Card = Card {
    id: "ambient-light",
    title: "noise from ambient light",
    stage: Stage::Variance,
    summary: "light of the room adds to the pattern and brings its own shot noise: the farther the target, the fainter the pattern against it",
    parameters: &[Parameter {
        name: "ratio",
        unit: "",
        range: [0.0, 100.0],
        typical: 0.05,
        summary: "light of a room of 500 lx over the pattern's, on a surface facing the sensor at 1 m",
    }],
    identity: 0.0,
    statistic: "variance",
    axis: "intensity",
    confused_with: "range-exponent, which does not go with the light of the room; intensity-dependent-noise: ambient light falls on the print as the pattern does, so that their ratio stays",
    reference: "Fankhauser et al. 2015",
};

impl Effect for AmbientLight {
    fn card(&self) -> &'static Card {
        &CARD
    }

    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let ratio = settings.at(0) * exposure.ambient_lux / ROOM_LUX;
        for i in 0..exposure.pixels() {
            // Neither depends on the print; the pattern alone on distance and angle.
            let facing = exposure.seen.cos_incidence(i, exposure.rays);
            let excess = ratio * exposure.point(i).norm_squared() / facing;
            if excess.is_finite() {
                // Shot noise of pattern and room together against that of the pattern.
                exposure.sigma[i] *= (1.0 + excess).sqrt() as f32;
                exposure.light[i] *= (1.0 + excess) as f32;
            }
        }
    }
}

/// Light on the desk of an office (EN 12464-1), lx.
pub const ROOM_LUX: f64 = 500.0;
