//! Tilt along the baseline is noisier than tilt across it.

use super::{Bounds, Card, Draw, Effect, Estimate, Exposure, Fitted, Known, Parameter, Settings, Smallest, Stage};
use crate::camera::Camera;
use crate::terms::{Basis, Coordinate, Modulation, Term};

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

    fn shapes(&self, _: &Bounds) -> Vec<Basis> {
        [1, 2].map(along_baseline).into()
    }

    fn plain(&self, _: Basis) -> Basis {
        along_baseline(1)
    }

    fn estimates(&self, fit: &Fitted) -> Vec<Estimate> {
        let Basis::Powers { times: Modulation::TiltPower(power), .. } = *fit.shape else {
            return Vec::new();
        };
        let at = REFERENCE_TILT_RAD.sin().powi(power);
        vec![fit.estimate("ratio", &|b| (b[0] * at).exp())]
    }

    fn term(&self, known: Known, _: &Camera) -> Option<Term> {
        Some(Term::variance(along_baseline(2), vec![known("ratio")?.ln() / 0.75]))
    }

    fn smallest(&self, _: &Bounds) -> Option<Smallest> {
        let (parameter, shape) = ("ratio", along_baseline(2));
        Some(Smallest { parameter, shape, unit: vec![1.0], of: |a| (0.75 * a).exp() })
    }
}

/// Where `ratio` is counted; a frontal plane has no direction of tilt.
const REFERENCE_TILT_RAD: f64 = std::f64::consts::FRAC_PI_3;

/// Along the baseline against across it, fading as the tilt does.
fn along_baseline(tilt_power: i32) -> Basis {
    Basis::powers(Coordinate::Alignment, 1, Modulation::TiltPower(tilt_power))
}
