//! Noise grows with another power of z.

use super::{Bounds, Card, Draw, Effect, Estimate, Exposure, Fitted, Parameter, Settings, Smallest, Stage};
use crate::camera::Camera;
use crate::terms::{Basis, Coordinate, Modulation, PixelContext, Term};

pub struct RangeExponent;

pub(super) static CARD: Card = Card {
    id: "range-exponent",
    title: "noise with another power of distance",
    stage: Stage::Variance,
    summary: "noise grows with another power of the distance than the form allows",
    parameters: &[Parameter {
        name: "excess",
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
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let excess = settings.at(0);
        for (sigma, z) in exposure.sigma.iter_mut().zip(&exposure.seen.depth) {
            *sigma *= (f64::from(*z) / PIVOT_M).powf(excess) as f32;
        }
    }

    fn shapes(&self, _: &Bounds) -> Vec<Basis> {
        power_laws()
    }

    /// Mean exponent between the ends of the depth range.
    fn estimates(&self, fit: &Fitted) -> Vec<Estimate> {
        let [near, far] = fit.reach.z;
        let at = |z: f64| PixelContext { z, ..PixelContext::default() };
        vec![fit.estimate("excess", &|b| {
            0.5 * (fit.value(b, at(far)) - fit.value(b, at(near))) / (far / near).ln().max(1e-3)
        })]
    }

    fn term(&self, settings: &Settings, _: &Camera) -> Option<Term> {
        Some(Term::variance(power_law(), vec![2.0 * settings.at(0)]))
    }

    fn smallest(&self, _: &Bounds) -> Option<Smallest> {
        let (parameter, shape) = ("excess", power_law());
        Some(Smallest { parameter, shape, unit: vec![1.0], of: |a| 0.5 * a })
    }
}

/// Depth at which nothing changes, m: the geometric mean of a Kinect's 1 to 4 m.
const PIVOT_M: f64 = 2.0;

/// Candidate laws, one column each.
fn power_laws() -> Vec<Basis> {
    let powers = [3.0, 4.0, 6.0];
    let growths = powers.into_iter().flat_map(|power| [2.0, 4.0, 8.0].map(|unit| growth(unit, power)));
    std::iter::once(power_law()).chain(growths).collect()
}

/// Another power over the whole range.
fn power_law() -> Basis {
    Basis::powers(Coordinate::LogRatio(PIVOT_M), 1, Modulation::One)
}

/// Noise of another power added in quadrature to that of the form; negligible at short range.
///
/// With these units and powers one column reproduces, from 0.8 to 4 m, z^4 in quadrature, a kink rounded
/// over half a metre, and linear or quadratic growth from 1 to 1.5 m on, to 0.3 % of its square.
fn growth(unit_m: f64, power: f64) -> Basis {
    Basis::Log1p { over: Coordinate::DepthPower { unit_m, power } }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Share of the square of a change of log variance from 0.8 to 4 m that the best of `shapes` leaves.
    fn left(shapes: &[Basis], change: impl Fn(f64) -> f64) -> f64 {
        let depths = || (0..=64).map(|n| 0.8 + 0.05 * f64::from(n));
        let of = |shape: &Basis| {
            let (mut fitted, mut square, mut own) = (0.0, 0.0, 0.0);
            for z in depths() {
                let at = PixelContext { z, ..PixelContext::default() };
                let (x, y) = (shape.value(&[1.0], &at), change(z));
                (fitted, square, own) = (fitted + x * y, square + y * y, own + x * x);
            }
            1.0 - fitted * fitted / (own * square)
        };
        shapes.iter().map(of).fold(1.0, f64::min)
    }

    /// Noise that grows by other formulas than ours, small and large, keeps the name; noise that grows and
    /// falls again does not.
    #[test]
    fn one_column_follows_other_growths() {
        let shapes = power_laws();
        for size in [0.03, 0.1, 0.3] {
            let quartic = |z: f64| (size * (z / 2.5).powi(4)).ln_1p();
            let kink = |z: f64| 2.0 * (size * ((z - 1.8) / 0.5).exp().ln_1p()).ln_1p();
            let line = |z: f64| 2.0 * (size * (z - 1.0).max(0.0)).ln_1p();
            let power = |z: f64| 2.0 * size * (z / 2.0).ln();
            let worst = [left(&shapes, quartic), left(&shapes, kink), left(&shapes, line)];
            assert!(worst.iter().all(|&w| w < 0.01), "{size}: {worst:?}");
            assert!(left(&shapes, power) < 1e-12);
            let hill = |z: f64| size * (-(z - 2.0).powi(2)).exp();
            assert!(left(&shapes, hill) > 0.2);
        }
    }
}
