//! Simulated views of planes: injected biases are recovered, and nothing else.

use std::sync::Arc;

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::diagnose::finding::pixels::terms_of;
use crate::rng::{Seed, Stream};
use crate::simulate::kinect_v1;
use crate::terms::{Basis, Coordinate, Modulation, PixelContext, Statistic, Term, corner_radius};

const SCALE_PX_M: f64 = 43.5;
pub(super) const NOISE_PX: f64 = 0.05;

/// Views of planes at these distances, m, with a bias, px.
pub(super) fn session(
    z_m: [f64; 2],
    rng: &mut Stream,
    bias: impl Fn(&PixelContext) -> f64,
) -> Vec<ViewData> {
    let camera = kinect_v1(4).camera;
    let corner = corner_radius(&camera);
    (0..12)
        .map(|_| {
            let d = SCALE_PX_M / rng.random_range(z_m[0]..z_m[1]);
            let slope = [rng.random_range(-0.5..0.5) * d, rng.random_range(-0.5..0.5) * d];
            let mut view = ViewData { precision: vec![0.0; 3], ..ViewData::default() };
            for v in (2..camera.height).step_by(4) {
                for u in (2..camera.width).step_by(4) {
                    let (u, v) = (u as f64, v as f64);
                    let (x, y) = camera.ray(u, v);
                    let disparity = d + slope[0] * x + slope[1] * y;
                    let radius = f64::hypot(u - camera.cx, v - camera.cy) / corner;
                    let z = SCALE_PX_M / disparity;
                    let rho = z;
                    let place = PixelContext {
                        u,
                        v,
                        x,
                        y,
                        disparity,
                        z,
                        radius,
                        rho,
                        ..Default::default()
                    };
                    let noise: f64 = StandardNormal.sample(rng);
                    view.response.push(bias(&place) + NOISE_PX * noise);
                    view.weight.push(NOISE_PX.powi(-2));
                    view.nuisance.extend([1.0, x, y]);
                    Arc::make_mut(&mut view.places).push(place);
                }
            }
            view
        })
        .collect()
}

pub(super) fn term(family: Option<&'static str>, basis: Basis) -> Chosen {
    let candidate = Candidate { family, basis, flat: None };
    Chosen { rms: 0.1, adequacy: 0.6, gain: 1.0, best_curve: 1.0, p: 0.0, ..Chosen::of(candidate) }
}

pub(super) fn fitted(data: &[ViewData], chosen: Vec<Chosen>) -> Outcome {
    let found = Outcome { chosen, ..Outcome::default() };
    let second: Vec<bool> = (0..data.len()).map(|v| v % 4 == 1 || v % 4 == 2).collect();
    refit(data, &vec![1.0; data.len()], &second, &kinect_v1(4).camera, found)
}

/// Root mean square of the bias about each view's plane, before and after subtracting the sensor's
/// terms, px.
pub(super) fn left(data: &[ViewData], outcome: &Outcome) -> [f64; 2] {
    let (mut squares, mut n) = ([0.0; 2], 0.0);
    let terms = terms_of(outcome, Statistic::Bias);
    for view in data {
        let x = DMatrix::from_row_slice(view.places.len(), 3, &view.nuisance);
        let solver = x.clone().svd(true, true);
        let mut y = DVector::from_vec(view.response.clone());
        for square in &mut squares {
            *square += (&y - &x * solver.solve(&y, 1e-12).unwrap()).norm_squared();
            for term in terms.iter().filter(|t| t.is_sensor_bias()) {
                let values = view.places.iter().map(|p| term.value(p));
                y -= DVector::from_iterator(view.places.len(), values);
            }
        }
        n += view.places.len() as f64;
    }
    squares.map(|s| (s / n).sqrt())
}

pub(super) fn bowl() -> Chosen {
    let basis = Basis::powers(Coordinate::RadiusSquared, 1, Modulation::power(0.0));
    term(Some("radial-disparity-bias"), basis)
}

pub(super) fn map() -> Chosen {
    let (width, height) = (160.0, 120.0);
    let basis = Basis::Map { width, height, across: 4, down: 3, times: Modulation::One };
    term(None, basis)
}

pub(super) fn smooth(p: &PixelContext) -> f64 {
    0.15 * (p.u / 25.0).sin() * (p.v / 20.0).cos()
}

/// No fit to planes determines it, so it is zero.
#[test]
fn what_planes_absorb_comes_out_as_nothing() {
    let rng = &mut Seed(5).stream("joint/affine");
    let data = session([0.8, 3.0], rng, |p| 0.7 - 0.4 * p.x + 0.3 * p.y);
    let outcome = fitted(&data, vec![bowl(), map()]);
    let terms = terms_of(&outcome, Statistic::Bias);
    let sizes = data.iter().flat_map(|v| v.places.iter()).map(|p| Term::sum(&terms, p).abs());
    let most = sizes.fold(0.0, f64::max);
    assert!(most < 0.05, "{most}");
}

/// A slope that grows with the disparity's square bends tilted planes. It is not reported, and nothing
/// else is reported in its place.
#[test]
fn a_slope_of_the_disparity_squared_is_left_out_and_bends_no_map() {
    let far = |p: &PixelContext| (p.disparity / 40.0).powi(2);
    let wide = |p: &PixelContext| 0.15 * (p.u / 40.0).sin() * (p.v / 35.0).cos();
    let slope = |p: &PixelContext| (0.4 * p.x - 0.3 * p.y) * far(p);
    let rng = &mut Seed(7).stream("joint/slope");
    let data = session([0.8, 3.0], rng, |p| wide(p) * far(p) + slope(p));
    let outcome = fitted(&data, vec![bowl(), map()]);
    let terms = terms_of(&outcome, Statistic::Bias);
    // A frontal plane at 0.9 m.
    let disparity = SCALE_PX_M / 0.9;
    let places: Vec<PixelContext> =
        data[0].places.iter().map(|p| PixelContext { disparity, z: 0.9, rho: 0.9, ..*p }).collect();
    let x = DMatrix::from_fn(places.len(), 3, |i, k| [1.0, places[i].x, places[i].y][k]);
    let solver = x.clone().svd(true, true);
    let told = places.iter().map(|p| Term::sum(&terms, p));
    let told = DVector::from_iterator(places.len(), told);
    let affine = solver.solve(&told, 1e-12).unwrap();
    assert!(affine.amax() < 0.02, "{affine}");
    let truth = DVector::from_iterator(places.len(), places.iter().map(|p| wide(p) * far(p)));
    let around = |y: &DVector<f64>| y - &x * solver.solve(y, 1e-12).unwrap();
    let [missed, size] = [&around(&(told - &truth)), &around(&truth)]
        .map(|y| (y.norm_squared() / places.len() as f64).sqrt());
    assert!(missed < 0.1 * size, "{missed} of {size}");
}

/// Near views say nothing of what grows far away; their correction must not do harm there.
#[test]
fn a_correction_from_one_distance_does_no_harm_at_another() {
    for seed in 0..3 {
        let rng = &mut Seed(seed).stream("joint/distance");
        let bias = |p: &PixelContext| 0.2 * p.radius.powi(2) * (p.disparity / 40.0) + smooth(p);
        let near = session([0.7, 0.9], rng, bias);
        let far = session([2.0, 3.5], rng, bias);
        for (taught, judged) in [(&near, &far), (&far, &near)] {
            let [before, after] = left(judged, &fitted(taught, vec![bowl(), map()]));
            assert!(after < before, "seed {seed}: {before} {after}");
        }
    }
}

/// The stated error of the sum against the true one, over seeds and places: the squared ratio is one on
/// average, give or take the few degrees of freedom of a fit, and nine tenths lie within 1.645.
#[test]
fn the_stated_error_is_the_true_one() {
    // Smooth enough for the maps: finer shapes are no part of a stated error.
    let wide = |p: &PixelContext| 0.15 * (p.u / 70.0).sin() * (p.v / 60.0).cos();
    let bias = |p: &PixelContext| 0.3 * p.radius.powi(2) + wide(p);
    let (mut squares, mut inside, mut n) = (0.0, 0.0, 0.0);
    for seed in 0..6 {
        let rng = &mut Seed(seed).stream("joint/error");
        let data = session([0.8, 3.0], rng, bias);
        let outcome = fitted(&data, vec![bowl(), map()]);
        let sum = |numbers: &dyn Fn(usize) -> f64, p: &PixelContext, power: i32| -> f64 {
            let mut total = 0.0;
            for (k, c) in outcome.chosen.iter().enumerate() {
                let first = outcome.span(k).start;
                let add = |j: usize, g: f64| total += g.powi(power) * numbers(first + j);
                c.candidate.basis.visit(p, add);
            }
            total
        };
        let beta = outcome.fit.as_ref().expect("a fit").beta.clone();
        // A frontal plane at 1.2 m, with what planes absorb subtracted from the error.
        let view = &data[0];
        let places: Vec<PixelContext> = view
            .places
            .iter()
            .map(|p| PixelContext { disparity: SCALE_PX_M / 1.2, z: 1.2, ..*p })
            .collect();
        let x = DMatrix::from_fn(places.len(), 3, |i, k| [1.0, places[i].x, places[i].y][k]);
        let solver = x.clone().svd(true, true);
        let plane_out = |y: DVector<f64>| &y - &x * solver.solve(&y, 1e-12).unwrap();
        let off = |p: &PixelContext| sum(&|j| beta[j], p, 1) - bias(p);
        let error = plane_out(DVector::from_iterator(places.len(), places.iter().map(off)));
        let mut variance = DVector::zeros(places.len());
        for factor in &outcome.covariance.factors {
            let of = |p: &PixelContext| sum(&|j| factor[j], p, 1);
            let part = plane_out(DVector::from_iterator(places.len(), places.iter().map(of)));
            variance += part.component_mul(&part);
        }
        for (i, p) in places.iter().enumerate() {
            variance[i] += sum(&|j| outcome.covariance.variances[j], p, 2);
            let square = error[i].powi(2) / variance[i];
            squares += square;
            inside += f64::from(square < 1.645f64.powi(2));
            n += 1.0;
        }
    }
    assert!((0.4..2.0).contains(&(squares / n)), "{}", squares / n);
    assert!((0.75..=0.99).contains(&(inside / n)), "{}", inside / n);
}

/// The score left in a view by one pass over its samples is that of its normal equations.
#[test]
fn what_is_left_of_a_view_is_its_score_less_what_the_fit_takes() {
    let mut rng = Seed(5).stream("joint/left");
    let mut data = session([0.8, 3.0], &mut rng, |p| 0.02 * p.radius * p.radius);
    let bowl = Basis::powers(Coordinate::RadiusSquared, 2, Modulation::One);
    let curve = |times| {
        let (over, low, high) = (Coordinate::Radius, 0.0, 1.0);
        Basis::Curve { over, low, high, nodes: 5, times }
    };
    let [inverse, square] = [-1.0, 2.0].map(|power| curve(Modulation::still(power)));
    let chosen = [bowl, square.clone(), inverse, square].map(|basis| term(None, basis));
    let columns = Columns::of(&chosen, &kinect_v1(4).camera, 1.0);
    // What planes absorb is subtracted from the sums, or from every row.
    let fill = |i: usize, row: &mut [f64]| columns.fill(&data[5].places[i], row);
    let rows = data[5].rows(&data[5].response).unwrap();
    let gauged = rows.reduce(columns.terms + columns.nodes, fill);
    let [plain, other, both] =
        [&[5][..], &[7], &[5, 7]].map(|of| columns.evidence(of.iter().map(|&v| &data[v])));
    assert!((&plain.a - &gauged.a).norm() < 1e-9 * gauged.a.norm());
    assert!((&plain.b - &gauged.b).norm() < 1e-9 * gauged.b.norm());
    assert!((&both.a - (plain.a + other.a)).norm() < 1e-9 * both.a.norm());
    for view in &mut data {
        view.precision = vec![0.0, 0.0, 3.0];
        view.weight.iter_mut().step_by(3).for_each(|w| *w = 0.0);
    }
    let joint = Joint::of(&columns, &data, &vec![false; data.len()]);
    let n = joint.all.b.len();
    let beta = DVector::from_fn(n, |_, _| 0.01 * rng.sample::<f64, _>(StandardNormal));
    let all = joint.left(&[0, 5, 7], &beta);
    assert_eq!(all.len(), 3);
    for (left, v) in all.iter().zip([0, 5, 7]) {
        let whole = columns.evidence([&data[v]].into_iter());
        let expected = &whole.b - &whole.a * &beta;
        assert!((left - &expected).norm() < 1e-9 * expected.norm(), "view {v}");
    }
}

/// A curve with a node to every other column can express all that bands can: it completes them, and
/// takes neither their size nor their name.
#[test]
fn a_curve_beside_bands_is_their_rest() {
    const PERIOD_PX: f64 = 23.0;
    let bands = |p: &PixelContext| {
        let share = p.u / PERIOD_PX;
        0.08 * (share.round() - share)
    };
    let data = session([0.8, 3.0], &mut Seed(9).stream("joint/bands"), bands);
    let over = Coordinate::Column;
    let curve = Basis::Curve { over, low: 0.0, high: 160.0, nodes: 72, times: Modulation::One };
    let waves = Basis::waves(over, PERIOD_PX, 2);
    let named = Chosen { gain: 1500.0, ..term(Some("column-banding"), waves) };
    let outcome = fitted(&data, vec![named, Chosen { gain: 100.0, ..term(None, curve) }]);
    assert_eq!(outcome.chosen[0].candidate.family, Some("column-banding"));
    let told = terms_of(&outcome, Statistic::Bias);
    let at = |u: f64| told[0].value(&PixelContext { u, ..Default::default() });
    let height = (0..160).map(|u| at(f64::from(u)).abs()).fold(0.0, f64::max);
    assert!((0.03..0.05).contains(&height), "{height}");
}
