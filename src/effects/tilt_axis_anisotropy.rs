//! Tilt along the baseline is noisier than tilt across it.

use super::{Bounds, Card, Draw, Effect, Estimate, Exposure, Fitted, Parameter, Settings, Smallest, Stage};
use crate::camera::Camera;
use crate::terms::{Basis, Coordinate, Modulation, PixelContext, Term};

pub struct TiltAxisAnisotropy;

pub(super) static CARD: Card = Card {
    id: "tilt-axis-anisotropy",
    title: "noise that depends on the tilt axis",
    stage: Stage::Variance,
    summary: "tilt along the baseline stretches the pattern in the matching window, tilt across it only shears it: the first is noisier",
    parameters: &[Parameter {
        name: "ratio",
        range: [0.2, 5.0],
        typical: 1.5,
        summary: "sigma at 60 degrees of tilt along the baseline over across it",
    }],
    identity: 1.0,
    statistic: "variance",
    axis: "azimuth",
    confused_with: "slope-noise, which is the same in all directions",
    reference: "geometry: a disparity gradient of b tan(theta) / z, along the window or across it",
    ..Card::BASE
};

impl Effect for TiltAxisAnisotropy {
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let ratio = settings.at(0);
        for i in 0..exposure.pixels() {
            let (theta, azimuth) = (exposure.seen.theta(i), exposure.seen.azimuth(i));
            // Half of it raises sigma along the baseline, half lowers it across: the mean over azimuths
            // stays.
            let tilt = (theta.sin() / REFERENCE_TILT_RAD.sin()).powi(2);
            exposure.sigma[i] *= ratio.powf(0.5 * tilt * (2.0 * azimuth).cos()) as f32;
        }
    }

    fn shapes(&self, _: &Bounds) -> Vec<Basis> {
        // Raised along the baseline and lowered across it, or raised along it alone.
        let both = [Coordinate::Alignment, Coordinate::AlongBaseline];
        both.iter().flat_map(|over| LAWS.map(|law| Basis::powers(*over, 1, law))).collect()
    }

    fn estimates(&self, fit: &Fitted) -> Vec<Estimate> {
        let steep = |azimuth| PixelContext {
            theta: REFERENCE_TILT_RAD,
            azimuth,
            ..Default::default()
        };
        let [along, across] = [0.0, std::f64::consts::FRAC_PI_2].map(steep);
        let ratio = |b: &[f64]| (0.5 * (fit.value(b, along) - fit.value(b, across))).exp();
        let mut told = fit.estimate("ratio", &ratio);
        let by_law = told.value * told.value.ln() * between_laws(fit.reach.theta[1]);
        told.std_error = told.std_error.hypot(by_law);
        vec![told]
    }

    fn term(&self, settings: &Settings, _: &Camera) -> Option<Term> {
        Some(Term::variance(along_baseline(FORWARD), vec![settings.at(0).ln() / 0.75]))
    }

    fn smallest(&self, _: &Bounds) -> Option<Smallest> {
        let (parameter, shape) = ("ratio", along_baseline(FORWARD));
        Some(Smallest { parameter, shape, unit: vec![1.0], of: |a| (0.75 * a).exp() })
    }
}

/// Tilt at which `ratio` is defined; a frontal plane has no direction of tilt.
const REFERENCE_TILT_RAD: f64 = std::f64::consts::FRAC_PI_3;

/// The law of the card's own formula.
const FORWARD: Modulation = Modulation::TiltPower(2);

/// Growth with the tilt: as foreshortening, or as the disparity gradient.
const LAWS: [Modulation; 3] =
    [Modulation::TiltPower(1), Modulation::TiltPower(2), Modulation::SlopeSquared];

/// Uncertainty of the law, as a share of the log ratio: half the difference between sin^2 and tan^2 at the
/// reference, where both fit the recording; a strongly stretched window lies between them. With tilts
/// spread evenly up to `steepest` and a signal that grows with their square, the effective tilt is 5/6 of
/// it.
fn between_laws(steepest: f64) -> f64 {
    let decides = (5.0 / 6.0 * steepest).cos() / REFERENCE_TILT_RAD.cos();
    0.5 * (decides * decides - 1.0).abs()
}

/// Contrast of tilts along and across the baseline, vanishing with the tilt.
fn along_baseline(law: Modulation) -> Basis {
    Basis::powers(Coordinate::Alignment, 1, law)
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;
    use crate::terms::Extent;

    fn told(shape: Basis, coefficient: f64, steepest: f64) -> Estimate {
        let mut reach = Extent::of(std::iter::empty());
        reach.theta = [0.0, steepest];
        let covariance = DMatrix::zeros(1, 1);
        let coefficients = &[coefficient];
        let fit = Fitted { shape: &shape, coefficients, covariance: &covariance, reach: &reach };
        TiltAxisAnisotropy.estimates(&fit)[0]
    }

    /// Raised along the baseline and lowered across it by as much, or raised along it alone by twice that:
    /// the same ratio.
    #[test]
    fn the_ratio_is_between_the_two_directions() {
        let of = |over, coefficient| told(Basis::powers(over, 1, FORWARD), coefficient, 1.0).value;
        let both = 1.5f64.ln() / 0.75;
        let ratios = [of(Coordinate::Alignment, both), of(Coordinate::AlongBaseline, 2.0 * both)];
        assert!(ratios.iter().all(|ratio| (ratio - 1.5).abs() < 1e-9), "{ratios:?}");
    }

    /// All laws agree at the reference tilt; a recording whose tilts end far below it determines less than
    /// one that goes beyond.
    #[test]
    fn the_ratio_is_counted_at_sixty_degrees() {
        for (law, at_reference) in LAWS.into_iter().zip([0.75f64.sqrt(), 0.75, 3.0]) {
            let [near, past] =
                [0.8, 1.2].map(|steepest| told(along_baseline(law), 1.5f64.ln() / at_reference, steepest));
            assert!((near.value - 1.5).abs() < 1e-9, "{law:?}: {near:?}");
            assert!(near.std_error > 4.0 * past.std_error, "{law:?}: {near:?}, {past:?}");
        }
    }
}
