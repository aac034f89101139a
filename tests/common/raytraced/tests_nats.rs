//! What knowing is worth, by other ways: by hand, and by drawing the noise and counting.

use nalgebra::{DMatrix, DVector};

use super::ground::Ground;
use super::question::{Asked, World};
use super::shoot::Still;
use super::weigh::Concealed;
use super::{Act, Cause, Cell, Label, Set};
use kinoise::rng::Seed;

pub(super) fn asked(cell: Cell, names: &[&str], nats: Option<f64>, seed: u64) -> Asked {
    let names = names.iter().map(ToString::to_string).collect();
    Asked { world: World::Rays, cell, names, nats, seed, small: true }
}

/// With white noise: no window that the model knows of.
fn white(cell: Cell, names: &[&str], nats: Option<f64>) -> Set {
    let sets = (0..50).map(|seed| Set::sealed(&asked(cell, names, nats, seed), Some(8), Some(3)));
    sets.map(Result::unwrap).find(|set| set.known_causes == 0).unwrap()
}

fn cause(act: Act) -> Cause {
    Cause::new(Label::new(None, "by hand", ["", ""], &[]), act)
}

#[test]
fn a_tenth_more_noise_is_worth_what_the_formula_says() {
    let set = white(Cell::Null, &[], None);
    let ground = Ground::of(&set);
    let pixels: f64 =
        ground.views.iter().map(|look| look.sum(|_| 1.0)).sum::<f64>() * ground.weight;
    let hand = 3.0 * pixels * 0.5 * (1.21 - 1.0 - 1.21f64.ln());
    let got = ground.nats(&cause(Act::spread(|_, _| 1.1))).unwrap();
    assert!((got / hand - 1.0).abs() < 1e-9, "{got} {hand}");
}

/// The bump's own squares at every pixel, less what a plane takes, by dense algebra.
#[test]
fn a_bump_is_worth_its_squares_less_a_plane() {
    let set = white(Cell::Null, &[], None);
    let ground = Ground::of(&set);
    let bump = |u: f64, v: f64| 0.02 * (-((u - 70.0).powi(2) + (v - 50.0).powi(2)) / 800.0).exp();
    let got = ground.nats(&cause(Act::mismatch(move |s, _| bump(s.u, s.v)))).unwrap();
    let mut hand = 0.0;
    let mut plain = 0.0;
    let unit = &set.unit;
    for (view, plan) in set.plans.iter().enumerate() {
        let still = Still::new(&set, view);
        let pixels: Vec<(f64, f64, f64)> = (0..still.disparity.len())
            .map(|i| (i, (i % 160) as f64, (i / 160) as f64))
            .filter(|(i, u, v)| {
                let z = unit.disparity_px_m() / f64::from(still.disparity[*i]);
                let told = plan.notes.region.as_ref().is_none_or(|r| r.contains(*u, *v));
                let camera = &unit.sensor.camera;
                let board = plan
                    .stage
                    .board
                    .depth((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy);
                told && (z - board).abs() < 1e-3
            })
            .map(|(i, u, v)| {
                let z = unit.disparity_px_m() / f64::from(still.disparity[i]);
                let sigma = unit.sigma(z, plan.stage.theta);
                (u, v, sigma * unit.disparity_px_m() / (z * z))
            })
            .collect();
        let x = DMatrix::from_fn(pixels.len(), 3, |i, j| {
            let (u, v, s) = pixels[i];
            [1.0, u, v][j] / s
        });
        let y =
            DVector::from_iterator(pixels.len(), pixels.iter().map(|(u, v, s)| bump(*u, *v) / s));
        let b = (x.transpose() * &x).lu().solve(&(x.transpose() * &y)).unwrap();
        hand += 1.5 * (&y - x * b).norm_squared();
        plain += 1.5 * y.norm_squared();
    }
    assert!((got / hand - 1.0).abs() < 0.03, "{got} {hand}");
    assert!(hand < 0.9 * plain, "a plane takes some: {hand} {plain}");
}

/// Log-likelihood of who knows the bias over who does not, for noise drawn afresh: its mean is what
/// the set says within four standard errors of 40 draws, which one in 16,000 sets is not.
#[test]
fn fifty_nats_are_fifty_nats() {
    let mut set = white(Cell::Single, &["radial-disparity-bias"], Some(50.0));
    assert!((set.concealed[0].nats.unwrap() - 50.0).abs() < 1.1);
    let fb = set.unit.disparity_px_m();
    let concealed = set.causes.pop().unwrap();
    let plain: Vec<Vec<f32>> =
        (0..set.plans.len()).map(|view| Still::new(&set, view).disparity).collect();
    set.causes.push(concealed);
    let mut gains = Vec::new();
    for draw in 0..40 {
        set.seed = Seed(1000 + draw);
        let gain = |view: usize| {
            let still = Still::new(&set, view);
            let (ground, truth) = (&plain[view], &still.disparity);
            let plan = &set.plans[view];
            let target = |i: usize| {
                let (u, v) = ((i % 160) as f64, (i / 160) as f64);
                let told = plan.notes.region.as_ref().is_none_or(|r| r.contains(u, v));
                let c = &set.unit.sensor.camera;
                let board = plan.stage.board.depth((u - c.cx) / c.fx, (v - c.cy) / c.fy);
                told && (fb / f64::from(ground[i]) / board - 1.0).abs() < 1e-4
            };
            let on: Vec<usize> = (0..ground.len()).filter(|i| target(*i)).collect();
            let frames: Vec<Vec<f32>> = (0..3).map(|k| still.depth(k)).collect();
            let (mut rows, mut told, mut seen) = (Vec::new(), Vec::new(), Vec::new());
            for &i in &on {
                let z = fb / f64::from(ground[i]);
                let sigma = set.unit.sigma(z, plan.stage.theta) * fb / (z * z);
                let mean = frames.iter().map(|f| fb / f64::from(f[i])).sum::<f64>() / 3.0;
                let (u, v) = ((i % 160) as f64, (i / 160) as f64);
                rows.push([1.0 / sigma, u / sigma, v / sigma]);
                told.push(f64::from(truth[i] - ground[i]) / sigma);
                seen.push((mean - f64::from(ground[i])) / sigma);
            }
            let off = |y: &[f64]| {
                let x = DMatrix::from_fn(rows.len(), 3, |i, j| rows[i][j]);
                let y = DVector::from_row_slice(y);
                let b = (x.transpose() * &x).lu().solve(&(x.transpose() * &y)).unwrap();
                y - x * b
            };
            let (told, seen) = (off(&told), off(&seen));
            1.5 * (seen.norm_squared() - (seen - told).norm_squared())
        };
        gains.push((0..set.plans.len()).map(gain).sum::<f64>());
    }
    let mean = gains.iter().sum::<f64>() / 40.0;
    let error = (2.0 * 50.0f64 / 40.0).sqrt();
    assert!((mean - 50.0).abs() < 4.0 * error + 1.0, "{mean} +- {error}");
}

/// Every cause that has a strength reaches what is asked within a few per cent.
#[test]
fn what_is_asked_is_reached() {
    for (k, name) in super::CATALOGUE.iter().chain(&super::OUTSIDE).enumerate() {
        let cell = if super::OUTSIDE.contains(name) { Cell::Outside } else { Cell::Single };
        for nats in [5.0, 150.0] {
            let set = Set::sealed(&asked(cell, &[name], Some(nats), k as u64), Some(8), None);
            let set = set.unwrap();
            let Concealed { strength, nats: got, .. } = set.concealed[0];
            let Some(got) = got else {
                assert!(["disparity-quantisation", "depth-rounding"].contains(name), "{name}");
                continue;
            };
            let near = (got / nats - 1.0).abs() < 0.05;
            assert!(near || strength >= 8.0, "{name}: {got} at {strength} for {nats}");
        }
    }
}

#[test]
fn strengths_are_found_where_they_are_hidden() {
    use super::weigh::strength_for;
    let square = |s: f64| Ok::<_, ()>(700.0 * s * s);
    let (s, got) = strength_for(50.0, square).unwrap();
    assert!((got / 50.0 - 1.0).abs() < 0.02 && (s - (50.0f64 / 700.0).sqrt()).abs() < 0.01);
    // Nothing at all below a threshold, then steeply.
    let cliff = |s: f64| Ok::<_, ()>(if s < 0.3 { 0.0 } else { 1e5 * (s - 0.3) });
    assert!((strength_for(50.0, cliff).unwrap().1 / 50.0 - 1.0).abs() < 0.02);
    let flat = |_: f64| Ok::<_, ()>(3.0);
    assert_eq!(strength_for(50.0, flat).unwrap(), (8.0, 3.0));
}
