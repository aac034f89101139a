//! Tilt along the baseline is noisier than tilt across it.

use super::{Card, Draw, Effect, Exposure, Parameter, Settings, Stage};

pub struct TiltAxisAnisotropy;

static CARD: Card = Card {
    id: "tilt-axis-anisotropy",
    title: "noise that depends on the tilt axis",
    stage: Stage::Variance,
    summary: "tilt along the baseline stretches the pattern in the matching window, tilt across it only shears it: the first is noisier",
    parameters: &[Parameter {
        name: "ratio",
        unit: "",
        range: [0.2, 5.0],
        typical: 1.5,
        summary: "sigma at 60 degrees of tilt along the baseline over across it",
    }],
    identity: 1.0,
    statistic: "variance",
    axis: "azimuth",
    confused_with: "slope-noise, which is the same in all directions",
    reference: "geometry: a disparity gradient of b tan(theta) / z, along the window or across it",
};

impl Effect for TiltAxisAnisotropy {
    fn card(&self) -> &'static Card {
        &CARD
    }

    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let ratio = settings.at(0);
        for i in 0..exposure.pixels() {
            let (theta, azimuth) = (exposure.seen.theta(i), exposure.seen.azimuth(i));
            // Half of it up along the baseline, half of it down across: the mean over azimuths stays.
            let tilt = (theta.sin() / REFERENCE_TILT_RAD.sin()).powi(2);
            exposure.sigma[i] *= ratio.powf(0.5 * tilt * (2.0 * azimuth).cos()) as f32;
        }
    }
}

/// Where `ratio` is counted; a frontal plane has no direction of tilt.
const REFERENCE_TILT_RAD: f64 = std::f64::consts::FRAC_PI_3;
