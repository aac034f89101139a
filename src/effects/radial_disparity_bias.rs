//! A bowl in disparity.

use super::{Bounds, Card, Draw, Effect, Estimate, Exposure, Fitted, Parameter, Settings, Smallest, Stage, slope_in_square};
use crate::camera::Camera;
use crate::sensors::SensorKind;
use crate::terms::{Basis, Coordinate, DISPARITY_UNIT_PX, Modulation, PixelContext, Term};

pub struct RadialDisparityBias;

pub(super) static CARD: Card = Card {
    id: "radial-disparity-bias",
    title: "radial disparity bias",
    stage: Stage::Disparity,
    summary: "lens or projector off their calibration by a smooth bowl of disparity about the principal point: in depth it grows with z^2",
    parameters: &[Parameter {
        name: "k_px",
        range: [-4.0, 4.0],
        typical: 0.5,
        summary: "disparity too large by this at the corner radius",
    }],
    kinds: SensorKind::MATCHING,
    statistic: "bias",
    axis: "radius",
    confused_with: "target-bow, which stays with the board and does not grow with z; lens-distortion, which a frontal plane does not show; range-not-depth, whose bowl grows with z and has no free size",
    reference: "Herrera, Kannala and Heikkila 2012: D(u,v) of the disparity; Teichman et al. 2013 (CLAMS)",
    formula_error: 0.1,
    // Herrera, Kannala and Heikkila 2012, fig. 6: up to 4 of a Kinect's steps of 1/8 px towards the corners.
    usual: 0.5,
    ..Card::BASE
};

impl Effect for RadialDisparityBias {
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let k = settings.at(0);
        let radius = exposure.radius();
        exposure.shift_disparity(|i| k * radius(i).powi(2));
    }

    /// Two orders for what is nearly a parabola, four for a wavy one. A bowl that grows faster than the
    /// disparity grows with z less than in proportion: with the square of the disparity its depth is the
    /// same at every distance, which is the target's shape and not the sensor's.
    fn shapes(&self, _: &Bounds) -> Vec<Basis> {
        const POWERS: [f64; 5] = [-1.0, -0.5, 0.0, 0.5, 1.0];
        let of = |orders: usize| POWERS.map(|power| bowl(power, orders));
        [of(2), of(4)].concat()
    }

    /// Nearest parabola at the geometric mean of the disparities.
    fn estimates(&self, fit: &Fitted) -> Vec<Estimate> {
        let Basis::Powers { times, .. } = *fit.shape else { return Vec::new() };
        let disparity_power = times.power_of_disparity().unwrap_or(0.0);
        let [low, high] = fit.reach.disparity;
        let middle = (low * high).sqrt();
        let disparity = if middle.is_finite() { middle } else { DISPARITY_UNIT_PX };
        let at = |radius: f64| PixelContext { radius, disparity, ..PixelContext::default() };
        vec![
            fit.estimate("k_px", &|b| slope_in_square(|r| fit.value(b, at(r)), 1.0)),
            Estimate::given("disparity_power", disparity_power, 0.25),
        ]
    }

    fn term(&self, settings: &Settings, _: &Camera) -> Option<Term> {
        Some(Term::bias(bowl(0.0, 1), vec![settings.at(0)]))
    }

    fn smallest(&self, _: &Bounds) -> Option<Smallest> {
        Some(Smallest { parameter: "k_px", shape: bowl(0.0, 1), unit: vec![1.0], of: |a| a })
    }
}

/// A bowl that scales with a power of the disparity.
fn bowl(disparity_power: f64, orders: usize) -> Basis {
    Basis::powers(Coordinate::RadiusSquared, orders, Modulation::power(disparity_power))
}
