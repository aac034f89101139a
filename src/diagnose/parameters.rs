//! From the coefficients of a family's free shape to the parameters that people know it by.

use nalgebra::DMatrix;
use serde_json::{Map, Value, json};

use super::reach::Reach;
use crate::terms::{Basis, DISPARITY_UNIT_PX, Place};

/// A parameter with its standard error.
pub fn estimate(value: f64, std_error: f64) -> Value {
    if std_error.is_finite() {
        json!({ "value": value, "std_error": std_error })
    } else {
        json!({ "value": value, "std_error": null })
    }
}

/// With the errors enlarged by what the family's formula is off: no sensor has that very one.
pub fn of_any_formula(basis: &Basis, mut parameters: Map<String, Value>) -> Map<String, Value> {
    let share = form(basis);
    for parameter in parameters.values_mut() {
        let number = |key: &str| parameter[key].as_f64();
        if let (Some(value), Some(error)) = (number("value"), number("std_error")) {
            *parameter = estimate(value, error.hypot(share * value));
        }
    }
    parameters
}

/// With another formula of the same physics a parameter comes out different by this share (measured
/// on ray-traced recordings).
fn form(basis: &Basis) -> f64 {
    match basis {
        Basis::Lens { .. } => 0.03,
        Basis::RangeNotDepth | Basis::SlopeNoise { .. } => 0.07,
        Basis::Bowl { .. } | Basis::Vignetting { .. } | Basis::Locking { .. } => 0.1,
        Basis::Bow { .. } | Basis::Banding { .. } | Basis::Ambient { .. } => 0.3,
        _ => 0.0,
    }
}

/// The parameters of effects.md for a fitted shape; errors by the delta method.
pub fn parameters(
    basis: &Basis,
    beta: &[f64],
    covariance: &DMatrix<f64>,
    reach: &Reach,
) -> Map<String, Value> {
    let mut map = Map::new();
    let mut add = |name: &str, of: &dyn Fn(&[f64]) -> f64| {
        map.insert(name.into(), estimate(of(beta), delta(of, beta, covariance)));
    };
    match *basis {
        Basis::Bowl { .. } => {
            add("k_px", &|b| slope_in_square(|r| value(basis, b, radius_place(r, reach)), 1.0));
        }
        Basis::Lens { .. } => add("k1", &|b| {
            // c1 r^2 + c2 r^4 .. of the ray, as k1 r^2.
            slope_in_square(|r| b.iter().rev().fold(0.0, |sum, c| (sum + c) * r * r), 0.6)
        }),
        Basis::RangeNotDepth => add("share", &|b| b[0]),
        Basis::Bow { .. } => add("sagitta_m", &|b| {
            let half = |[low, high]: [f64; 2]| 0.5 * (high - low);
            let (right, down) = (half(reach.right).powi(2), half(reach.down).powi(2));
            if (b[0] * right).abs() > (b[1] * down).abs() { -b[0] * right } else { -b[1] * down }
        }),
        Basis::Locking { period_px, .. } => {
            add("amplitude_px", &|b| {
                greatest(|t| {
                    let p = Place { disparity: t * period_px, ..Place::default() };
                    value(basis, b, p)
                })
            });
        }
        Basis::Banding { period_px, .. } => {
            add("amplitude_px", &|b| {
                greatest(|t| value(basis, b, Place { u: t * period_px, ..Place::default() }))
            });
        }
        Basis::EdgeMixing { .. } => add("amplitude_px", &|b| b[0]),
        Basis::RangeExponent { pivot_m, .. } => add("excess", &|b| {
            // Between the ends of what was seen.
            let at = |z: f64| value(basis, b, Place { z, ..Place::default() });
            let [near, far] = reach.z;
            let _ = pivot_m;
            0.5 * (at(far) - at(near)) / (far / near).ln().max(1e-3)
        }),
        Basis::Vignetting { .. } => {
            add("growth", &|b| (0.5 * b.iter().sum::<f64>()).exp() - 1.0);
        }
        Basis::SlopeNoise { lateral_px } => {
            add("sigma_lateral_px", &|b| lateral_px * b[0].max(0.0).sqrt());
        }
        Basis::TiltAxis { tilt_power } => {
            let at = std::f64::consts::FRAC_PI_3.sin().powi(tilt_power);
            add("ratio", &|b| (b[0] * at).exp());
        }
        Basis::Intensity { .. } => add("exponent", &|b| -0.5 * b[0]),
        Basis::Ambient { ratio } => add("ratio", &|b| ratio * b[0]),
        Basis::Level => add("sigma_factor", &|b| (0.5 * b[0]).exp()),
        _ => {}
    }
    match *basis {
        Basis::Bowl { disparity_power, .. } => {
            map.insert(
                "disparity_power".into(),
                json!({ "value": disparity_power, "std_error": 0.25 }),
            );
        }
        Basis::Banding { period_px, .. } => {
            map.insert(
                "period_px".into(),
                json!({ "value": period_px, "std_error": 0.02 * period_px }),
            );
        }
        Basis::Locking { period_px, .. } => {
            map.insert("period_px".into(), json!({ "value": period_px, "std_error": 0.003 }));
        }
        Basis::EdgeMixing { width_px } => {
            map.insert(
                "width_px".into(),
                json!({ "value": width_px, "std_error": 0.4 * width_px }),
            );
        }
        _ => {}
    }
    map
}

fn value(basis: &Basis, beta: &[f64], place: Place) -> f64 {
    basis.value(beta, &place, &mut Vec::new())
}

fn radius_place(radius: f64, reach: &Reach) -> Place {
    let middle = (reach.disparity[0] * reach.disparity[1]).sqrt();
    let disparity = if middle.is_finite() { middle } else { DISPARITY_UNIT_PX };
    Place { radius, disparity, ..Place::default() }
}

/// The k of k r^2 + constant that comes nearest to a curve over 0 to `far`.
fn slope_in_square(curve: impl Fn(f64) -> f64, far: f64) -> f64 {
    const NODES: usize = 41;
    let nodes = || (0..NODES).map(|n| far * n as f64 / (NODES - 1) as f64);
    // The area of a ring grows with its radius.
    let weight: f64 = nodes().sum();
    let mean = |of: &dyn Fn(f64) -> f64| nodes().map(|r| r * of(r)).sum::<f64>() / weight;
    let (square, level) = (mean(&|r| r * r), mean(&curve));
    let cross = mean(&|r| (r * r - square) * (curve(r) - level));
    cross / mean(&|r| (r * r - square).powi(2))
}

/// Half of the way from the least to the greatest over a period.
fn greatest(curve: impl Fn(f64) -> f64) -> f64 {
    let [low, high] = crate::stats::range((0..64).map(|k| curve(f64::from(k) / 64.0)));
    0.5 * (high - low)
}

fn delta(of: &dyn Fn(&[f64]) -> f64, beta: &[f64], covariance: &DMatrix<f64>) -> f64 {
    if covariance.nrows() != beta.len() {
        return f64::NAN;
    }
    let gradient: Vec<f64> = (0..beta.len())
        .map(|j| {
            let step = (1e-3 * covariance[(j, j)].max(0.0).sqrt()).max(1e-12);
            let mut moved = beta.to_vec();
            moved[j] += step;
            let up = of(&moved);
            moved[j] -= 2.0 * step;
            (up - of(&moved)) / (2.0 * step)
        })
        .collect();
    let g = nalgebra::DVector::from_vec(gradient);
    g.dot(&(covariance * &g)).max(0.0).sqrt()
}

#[cfg(test)]
#[path = "parameters_tests.rs"]
mod tests;
