use rand_distr::{Distribution, Normal};

use super::*;
use crate::model::Covariance;
use crate::rng::Seed;
use crate::simulate::kinect_v1;
use crate::terms::Coordinate;

const PX_M: f64 = 43.5;

/// A bowl with an unknown constant, times this power of the disparity.
fn bowl(power: f64) -> Effect {
    let basis = Basis::powers(Coordinate::RadiusSquared, 1, Modulation::power(power));
    let term = Term::bias(basis, vec![0.8]);
    let covariance = Covariance { variances: vec![1e-6], ..Covariance::default() };
    Effect { shape: vec![term], covariance: Some(covariance), ..Effect::default() }
}

/// References whose distances are too short by a constant of the disparity, times this power of it.
fn references(
    count: usize,
    power: f64,
    shift_px: f64,
    error_m: f64,
    seed: u64,
) -> Vec<ReferencedView> {
    let mut rng = Seed(seed).stream("references");
    let noise = Normal::new(0.0, error_m).unwrap();
    let of = |k: usize| {
        let z = 0.8 + 2.7 * k as f64 / (count - 1) as f64;
        let px = shift_px * (PX_M / z / DISPARITY_UNIT_PX).powf(power);
        let seen = PX_M / (PX_M / z + px) + noise.sample(&mut rng);
        ReferencedView::ahead(seen, seen - z, PX_M)
    };
    (0..count).map(of).collect()
}

fn shift_of(effect: &Effect) -> [f64; 2] {
    let affine = effect.shape.last().unwrap();
    assert!(matches!(affine.basis, Basis::Affine { .. }), "{affine:?}");
    assert_eq!(affine.coefficients[1..], [0.0; 2]);
    [affine.coefficients[0], effect.covariance.as_ref().unwrap().variances[1].sqrt()]
}

/// The constant is recovered, for either power, within its stated error.
#[test]
fn references_tell_the_constant() {
    let camera = kinect_v1(4).camera;
    for power in [0.0, 2.0] {
        let mut inside = 0;
        for seed in 0..40 {
            let mut added = [bowl(power)];
            let checked = references(12, power, 0.2, 0.002, seed);
            anchor(&mut added, &checked, &[4e-6; 12], &camera);
            let [shift, error] = shift_of(&added[0]);
            assert!((shift - 0.2).abs() < 0.08, "{power}: {shift}");
            inside += usize::from((shift - 0.2).abs() < 1.645 * error);
        }
        assert!((31..=40).contains(&inside), "{power}: {inside} of 40");
    }
}

/// Without an image-fixed bias no constant is added.
#[test]
fn a_constant_alone_is_nothing() {
    let camera = kinect_v1(4).camera;
    let mut added = [Effect::default()];
    anchor(&mut added, &references(12, 0.0, 0.2, 0.002, 1), &[4e-6; 12], &camera);
    assert!(added[0].shape.is_empty());
}

/// References of large variance hardly move the constant.
#[test]
fn poor_references_move_little() {
    let camera = kinect_v1(4).camera;
    let mut added = [bowl(0.0)];
    anchor(&mut added, &references(6, 0.0, 0.2, 0.0, 1), &[1.0; 6], &camera);
    let [shift, error] = shift_of(&added[0]);
    assert!(shift.abs() < 0.01, "{shift}");
    assert!(error > 0.1, "{error}");
}

/// The reported lens moves no plane as a whole, and bends every one as before.
#[test]
fn a_lens_without_references_moves_no_plane() {
    let camera = kinect_v1(4).camera;
    let basis = Basis::Lens { fx: camera.fx, fy: camera.fy, reference_px: 26.0, orders: 2 };
    let lens = Term::bias(basis, vec![0.02, -0.03]);
    let factor = vec![0.004, -0.005];
    let covariance = Covariance { factors: vec![factor], ..Covariance::default() };
    let mut added =
        [Effect { shape: vec![lens], covariance: Some(covariance), ..Effect::default() }];
    let_planes_be(&mut added, &camera);
    let rays = camera.rays();
    let pixels = Pixels::new(&camera, &rays, PX_M);
    let shape = &added[0].shape;
    assert_eq!(shape.len(), 3);
    // What is subtracted has the lens's error: the factor changes as the coefficients do.
    let factor = &added[0].covariance.as_ref().unwrap().factors[0];
    let coefficients: Vec<f64> = shape.iter().flat_map(|t| t.coefficients.clone()).collect();
    assert_eq!([factor.len(), coefficients.len()], [8, 8]);
    for of in [factor, &coefficients] {
        assert!(of[2] != 0.0 && (of[2] + of[5] / 26.0).abs() < 1e-12, "{of:?}");
    }
    let (mut told, mut alone) = (0.0, 0.0);
    for (k, place) in pixels.sampled().enumerate() {
        // A tilted plane, and a frontal one far from the reference.
        let tilted = 34.0 + 40.0 * place.x - 20.0 * place.y;
        for disparity in [tilted, 60.0] {
            let at = PixelContext { disparity, slope: [0.0; 2], ..place };
            let [px, lens] = [&shape[..], &shape[..1]].map(|s| Term::sum(s, &at));
            // For any plane it is a multiple of its own disparity and a constant.
            let taken = (disparity - 26.0) * -coefficients[2];
            assert!((lens - px - taken).abs() < 1e-12, "{k}: {lens} {px} {taken}");
        }
        let at = PixelContext { disparity: 60.0, slope: [0.0; 2], ..place };
        told += Term::sum(shape, &at);
        alone += Term::sum(&shape[..1], &at);
    }
    assert!(told.abs() < 0.01 * alone.abs(), "{told} of {alone}");
}

/// A ripple of the distance that was learnt with a constant and a share of the disparity, which no plane shows:
/// what is left is the ripple less its own line, and its error has no line either.
#[test]
fn a_curve_over_the_distance_moves_the_views_the_least() {
    let (low, high, nodes) = (10.0, 50.0, 41);
    let over = Coordinate::Disparity;
    let basis = Basis::Curve { over, low, high, nodes, times: Modulation::One };
    let node =
        |f: &dyn Fn(f64) -> f64| -> Vec<f64> { (0..nodes).map(|k| f(low + k as f64)).collect() };
    let ripple = |d: f64| 0.02 * (0.9 * d).sin();
    let learnt = Term::bias(basis, node(&|d| ripple(d) + 1.7 - 0.08 * d));
    let factor = node(&|d| 0.3 - 0.01 * d);
    let covariance = Covariance { factors: vec![factor], ..Covariance::default() };
    // The size of the noise may have such a curve too, and keeps it.
    let noise = Effect {
        shape: vec![Term::variance(learnt.basis.clone(), node(&|d| 0.1 - 0.01 * d))],
        ..Effect::default()
    };
    let mut added =
        [Effect { shape: vec![learnt], covariance: Some(covariance), ..Effect::default() }, noise];
    // Near views weigh more.
    let view = |d: &f64| {
        let place =
            |k: i32| PixelContext { disparity: d + 0.05 * f64::from(k), ..PixelContext::default() };
        let places: Vec<PixelContext> = (-20..=20).map(place).collect();
        let n = places.len();
        let (response, weight) = (vec![0.0; n], vec![d * d; n]);
        ViewData {
            places: places.into(),
            response,
            weight,
            nuisance: Vec::new(),
            precision: Vec::new(),
            gathered: Vec::new(),
        }
    };
    let views: Vec<ViewData> = [12.0, 15.0, 17.0, 20.0, 23.0, 27.0, 31.0, 35.0, 38.0, 43.0, 47.0]
        .iter()
        .map(view)
        .collect();
    let_distances_be(&mut added, &views);
    let [effect, noise] = &added;
    assert_eq!(noise.shape.len(), 1, "a term of the noise shifts no distance");
    let errors = &effect.covariance.as_ref().unwrap().factors[0];
    let mut first = 0;
    let error = |t: &Term| {
        let span = first..first + t.coefficients.len();
        first = span.end;
        Term { coefficients: errors[span].to_vec(), ..t.clone() }
    };
    let errors: Vec<Term> = effect.shape.iter().map(error).collect();
    let (mut sums, mut all, mut moved, mut size) = ([0.0; 2], 0.0, 0.0, 0.0);
    for (place, w) in views.iter().flat_map(|v| v.places.iter().zip(&v.weight)) {
        let left = Term::sum(&effect.shape, place);
        sums = [sums[0] + w * left, sums[1] + w * left * place.disparity];
        all += w * left.abs();
        (moved, size) = (moved + w * left * left, size + w * ripple(place.disparity).powi(2));
        assert!(Term::sum(&errors, place).abs() < 1e-9);
    }
    assert!(sums.iter().all(|s| s.abs() < 1e-9 * all), "{sums:?} of {all}");
    assert!(moved <= size && moved > 0.5 * size, "{moved} of {size}");
}
