//! Parameters of exact family shapes, and their errors against Monte Carlo.

use std::f64::consts::FRAC_1_PI;

use nalgebra::{DMatrix, DVector};
use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::diagnose::diagnosis::Finding;
use crate::diagnose::finding::other_findings::named;
use crate::effects::Active;
use crate::rng::Seed;
use crate::terms::{Axis, Coordinate, Extent, Modulation, Statistic};

fn reach() -> Extent {
    Extent {
        disparity: [10.0, 40.0],
        z: [0.8, 3.2],
        theta: [0.0, 1.0],
        right: [-0.6, 0.6],
        down: [-0.4, 0.4],
        session: [0.0, 1000.0],
        light: [1.0, 1.0],
        ambient: [0.0, 1000.0],
        edge: 100.0,
        ..Extent::default()
    }
}

type Case = (&'static str, Basis, Vec<f64>, &'static str, f64);

/// 64 places over a period miss a sine's top by up to 1 - cos(pi / 64) = 0.12 %.
fn tolerance(basis: &Basis) -> f64 {
    if basis.period().is_some() { 1.3e-3 } else { 1e-12 }
}

fn told(
    family: &str,
    shape: &Basis,
    coefficients: &[f64],
    covariance: &DMatrix<f64>,
) -> Map<String, Value> {
    parameters(Some(family), 0.0, &Fitted { shape, coefficients, covariance, reach: &reach() })
}

fn of(
    family: &str,
    basis: &Basis,
    beta: &[f64],
    covariance: &DMatrix<f64>,
    name: &str,
) -> (f64, f64) {
    let map = told(family, basis, beta, covariance);
    let number = |key| map[name][key].as_f64().expect("a number");
    (number("value"), number("std_error"))
}

/// Effect, basis, its coefficients, the parameter and its value.
fn exact() -> Vec<Case> {
    let phase = 0.7f64;
    // At 20 px, the middle of 10 to 40, a bowl that grows with d has half its depth at 40 px.
    let half = 0.5;
    let powers = |over, orders| Basis::powers(over, orders, Modulation::One);
    let radius = Coordinate::RadiusSquared;
    let bowl = |disparity_power| Basis::powers(radius, 1, Modulation::power(disparity_power));
    let radial = Modulation::RadialSlope { fx: 580.0, fy: 580.0 };
    let lens = |orders| Basis::powers(Coordinate::RaySquared, orders, radial);
    let ray_for_depth = Basis::powers(Coordinate::Foreshortening, 1, Modulation::Disparity);
    let near_edge = Basis::Decay { over: Coordinate::Edge, width: 3.0 };
    let log1p = |over| Basis::Log1p { over };
    let (over, times) = (Coordinate::LogLight, Modulation::One);
    let leveled = Basis::Powers { over, orders: 1, level: true, times };
    let locking = Basis::waves(Coordinate::Disparity, 1.0, 2);
    let saw_tooth = Basis::waves(Coordinate::Column, 37.0, 2);
    let (bent, dome) = (Basis::relief(2), Basis::dome(2));
    let wave = vec![0.1 * phase.cos(), 0.1 * phase.sin(), 0.0, 0.0];
    vec![
        ("radial-disparity-bias", bowl(0.0), vec![0.8], "k_px", 0.8),
        ("radial-disparity-bias", powers(radius, 2), vec![-0.8, 0.0], "k_px", -0.8),
        ("radial-disparity-bias", bowl(1.0), vec![0.8], "k_px", 0.8 * half),
        ("lens-distortion", lens(1), vec![-0.05], "k1", -0.05),
        ("lens-distortion", lens(2), vec![-0.05, 0.0], "k1", -0.05),
        ("range-not-depth", ray_for_depth, vec![0.9], "share", 0.9),
        // z = -sagitta (x / half)^2: the middle of the board stands out by it.
        ("target-bow", bent.clone(), vec![-0.02 / 0.36, 0.0, 0.0], "sagitta_m", 0.02),
        ("target-bow", bent, vec![0.0, 0.02 / 0.16, 0.0], "sagitta_m", -0.02),
        // Half by the square of the radius and half by its fourth power.
        ("target-bow", dome, vec![-0.01 / 0.36, -0.01 / 0.36f64.powi(2)], "sagitta_m", 0.02),
        ("pixel-locking", locking, wave, "amplitude_px", 0.1),
        // A saw-tooth of 0.1 px, in fifths of a px over the order.
        ("column-banding", saw_tooth, vec![FRAC_1_PI, 0.0, FRAC_1_PI, 0.0], "amplitude_px", 0.1),
        ("edge-mixing", near_edge, vec![-1.5], "amplitude_px", -1.5),
        // sigma grows with z^0.5 more: the logarithm of the variance with 2 * 0.5.
        ("range-exponent", powers(Coordinate::LogRatio(2.0), 1), vec![1.0], "excess", 0.5),
        // sigma is 1.4 times as large at the corner.
        ("vignetting", powers(radius, 1), vec![2.0 * 1.4f64.ln()], "growth", 0.4),
        ("vignetting", powers(radius, 2), vec![1.4f64.ln(); 2], "growth", 0.4),
        ("slope-noise", log1p(Coordinate::Blur(0.6)), vec![1.0], "sigma_lateral_px", 0.6),
        ("intensity-dependent-noise", powers(over, 1), vec![-1.6], "exponent", 0.8),
        ("intensity-dependent-noise", leveled, vec![-1.6, 0.3], "exponent", 0.8),
        ("ambient-light", log1p(Coordinate::Ambient(0.5)), vec![1.0], "ratio", 0.5),
        ("recalibrate", Basis::Level, vec![2.0 * 1.3f64.ln()], "sigma_factor", 1.3),
    ]
}

#[test]
fn an_exact_shape_gives_its_parameters() {
    for (family, basis, beta, name, expected) in exact() {
        let none = DMatrix::zeros(beta.len(), beta.len());
        let (value, error) = of(family, &basis, &beta, &none, name);
        assert!((value / expected - 1.0).abs() <= tolerance(&basis), "{basis:?}: {name} = {value}");
        assert!(error == 0.0, "{basis:?}: nothing is uncertain, +- {error}");
    }
}

/// The printed form of a finding simulates it: it parses, to the same four digits.
#[test]
fn a_finding_is_an_effect_that_the_simulator_takes() {
    for (family, basis, beta, name, expected) in exact() {
        let Some(effect) = effects::find(family) else { continue };
        let none = DMatrix::zeros(beta.len(), beta.len());
        let parameters = told(family, &basis, &beta, &none);
        let id = effect.card().id;
        let finding = Finding { parameters, ..named(id, Statistic::Bias, Axis::Z) };
        let active = finding.as_effect();
        let Some(strength) = effect.card().parameters.iter().find(|p| p.name == name) else {
            // Mixing is found by its height, and simulated by its width.
            assert_eq!((family, active.map(|a| a.settings.at(0))), ("edge-mixing", Some(3.0)));
            continue;
        };
        let active = active.unwrap_or_else(|| panic!("{family}: {:?}", strength.range));
        let read = Active::parse(&active.argument()).expect("it parses");
        let value = read.parameters()[name].as_f64().expect("a number");
        assert!(
            (value / expected - 1.0).abs() < tolerance(&basis) + 1e-3,
            "{family}: {name} = {value}"
        );
        assert_eq!(read.argument(), active.argument());
    }
    let bow = told("target-bow", &Basis::relief(2), &[0.1, 0.0, 0.0], &DMatrix::zeros(3, 3));
    assert_eq!(bow["span_m"]["value"].as_f64(), Some(1.2));
}

/// Standard errors by the delta method against 20,000 draws. A standard deviation is then known
/// to 0.5 %; nonlinearity over 1 % of the coefficients adds less than another 1 %.
#[test]
fn errors_are_what_scattered_coefficients_give() {
    let mut rng = Seed(3).stream("parameters/delta");
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    for (family, basis, beta, name, expected) in exact() {
        let k = beta.len();
        let top = beta.iter().map(|b| b.abs()).fold(0.0, f64::max);
        // Correlated coefficients.
        let root = DMatrix::from_fn(k, k, |i, j| match i.cmp(&j) {
            std::cmp::Ordering::Less => 0.0,
            std::cmp::Ordering::Equal => 0.01 * top,
            std::cmp::Ordering::Greater => 0.004 * top,
        });
        let covariance = &root * root.transpose();
        let (_, error) = of(family, &basis, &beta, &covariance, name);
        let none = DMatrix::zeros(k, k);
        let (mut sum, mut squares) = (0.0, 0.0);
        const DRAWS: usize = 20_000;
        for _ in 0..DRAWS {
            let moved =
                DVector::from_vec(beta.clone()) + &root * DVector::from_fn(k, |_, _| normal());
            let value = of(family, &basis, moved.as_slice(), &none, name).0 - expected;
            sum += value;
            squares += value * value;
        }
        let n = DRAWS as f64;
        let scatter = (squares / n - (sum / n).powi(2)).sqrt();
        let off = error / scatter - 1.0;
        println!("{name}: {error:.3e} by delta, {scatter:.3e} by draws, {basis:?}");
        assert!(off.abs() < 0.04, "{basis:?}: {name} +- {error}, scatters by {scatter}");
    }
}

/// A covariance of the wrong size counts as none: the error is unknown, not zero.
#[test]
fn without_a_covariance_the_error_is_null() {
    let map = told("recalibrate", &Basis::Level, &[0.1], &DMatrix::zeros(0, 0));
    assert!(map["sigma_factor"]["std_error"].is_null());
    assert!(map["sigma_factor"]["value"].is_number());
}
