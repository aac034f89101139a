//! Sub-pixel interpolation is biased towards whole pixels.

use std::f32::consts::TAU;

use super::{Bounds, Card, Draw, Effect, Estimate, Exposure, Fitted, Inverse, Parameter, Settings, Smallest, Stage, greatest};
use crate::camera::Camera;
use crate::sensors::SensorKind;
use crate::terms::{Basis, Coordinate, PixelContext, Term};

pub struct PixelLocking;

pub(super) static CARD: Card = Card {
    id: "pixel-locking",
    title: "pixel locking",
    stage: Stage::Disparity,
    summary: "interpolating the peak of the match leans toward whole pixels: an error periodic in disparity, one wave a pixel, seen as contour lines on tilted planes",
    parameters: &[Parameter {
        name: "amplitude_px",
        range: [0.0, 0.5],
        typical: 0.05,
        summary: "height of the wave",
    }],
    kinds: SensorKind::MATCHING,
    statistic: "bias",
    axis: "disparity-phase",
    confused_with: "disparity-quantisation, whose comb is finer (a fraction of a pixel) and keeps the mean; target-bow, which moves with the board",
    reference: "Shimizu and Okutomi 2001, sub-pixel estimation error cancellation: 0.04 to 0.06 px for a 9 x 9 window on random dots",
    is_symptom: true,
    formula_error: 0.1,
    // Shimizu and Okutomi 2001: 0.06 px; without a remedy twice that.
    usual: 0.1,
    ..Card::BASE
};

/// Relative error of the disparity scale, from baseline and focal length.
const SCALE_ERROR: f64 = 0.01;

impl Effect for PixelLocking {
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let amplitude = settings.at(0) as f32;
        for d in &mut exposure.disparity {
            // Between two whole pixels the disparity is pulled to the nearer one.
            *d -= amplitude * (TAU * d.fract()).sin();
        }
    }

    /// A period of one pixel, within the error of focal length and baseline.
    fn shapes(&self, bounds: &Bounds) -> Vec<Basis> {
        const OFF: f64 = 0.03;
        // Steps of a quarter of a cycle over the range of disparities.
        let step = 0.25 / (bounds.reach.disparity[1] - bounds.reach.disparity[0]).max(1.0);
        let half = ((OFF / step).ceil() as i64).clamp(1, 12);
        let period = |k: i64| 1.0 / (1.0 + OFF * k as f64 / half as f64);
        (-half..=half).map(|k| waves(period(k), 3)).collect()
    }

    fn estimates(&self, fit: &Fitted) -> Vec<Estimate> {
        let Basis::Waves { period: period_px, .. } = *fit.shape else { return Vec::new() };
        let at = |t: f64| PixelContext { disparity: t * period_px, ..PixelContext::default() };
        vec![
            fit.estimate("amplitude_px", &|b| greatest(|t| fit.value(b, at(t)))),
            Estimate::given("period_px", period_px, SCALE_ERROR * period_px),
        ]
    }

    fn term(&self, settings: &Settings, _: &Camera) -> Option<Term> {
        Some(Term::bias(waves(1.0, 1), vec![-settings.at(0), 0.0]))
    }

    fn inverse(&self, settings: &Settings, _: &Camera) -> Option<Inverse> {
        Some(Inverse::Locking { amplitude_px: settings.at(0) })
    }

    fn smallest(&self, _: &Bounds) -> Option<Smallest> {
        let (parameter, shape) = ("amplitude_px", waves(1.0, 1));
        Some(Smallest { parameter, shape, unit: vec![1.0, 0.0], of: |a| a })
    }
}

/// Waves in the phase of the disparity.
fn waves(period_px: f64, harmonics: usize) -> Basis {
    Basis::waves(Coordinate::Disparity, period_px, harmonics)
}
