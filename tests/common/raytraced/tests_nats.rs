//! Checks the worth of knowing in other ways: by hand, and by simulating the noise.

use nalgebra::{DMatrix, DVector};

use super::confine::Gate;
use super::nats::Ground;
use super::shoot::Still;
use super::tests::asked;
use super::weigh::strength_for;
use super::{CATALOGUE, Cell, OUTSIDE, Set, spread};
use kinoise::rng::Seed;

/// A set with white noise: no window that the model knows of.
fn white(cell: Cell, names: &[&str], nats: Option<f64>) -> Set {
    let sets = (0..50).map(|seed| Set::asked(&asked(cell, names, nats, seed), Some(8), Some(3)));
    sets.map(Result::unwrap).find(|set| set.known_causes == 0).unwrap()
}

#[test]
fn a_tenth_more_noise_is_worth_what_the_formula_says() {
    let set = white(Cell::Null, &[], None);
    let ground = Ground::of(&set);
    let hand = 3.0 * ground.views(|_| 1.0) * 0.5 * (1.21 - 1.0 - 1.21f64.ln());
    let got = ground.nats(&spread("by hand", "", "", &[], |_, _| 1.1)).unwrap();
    assert!((got / hand - 1.0).abs() < 1e-9, "{got} {hand}");
}

/// Views have nothing in common: a cause is worth in all of them what it is worth in some and in the rest.
/// A pixel's constant is one number in all views, so that these together say more of it than apart.
#[test]
fn some_views_and_the_others_are_worth_all() {
    let gates = [vec![1, 4], vec![0, 2, 3, 5, 6, 7]].map(Gate::Views);
    let alone = [
        "radial-disparity-bias",
        "target-bow",
        "target-motion",
        "vignetting",
        "slope-noise",
        "heavy-tails",
        "spatial-correlation",
        "temporal-correlation",
        "frozen-noise",
        "row-noise",
        "frame-jitter",
    ];
    for name in alone.into_iter().chain(["fixed-pattern-noise"]) {
        let set = white(Cell::Single, &[name], None);
        let ground = Ground::of(&set);
        let worth = |gate: Option<&Gate>| {
            let cause = set.at_strength(0, 1.0).unwrap();
            let cause = match gate {
                Some(gate) => gate.confine(cause).unwrap(),
                None => cause,
            };
            ground.nats(&cause).unwrap()
        };
        let [some, others] = [worth(Some(&gates[0])), worth(Some(&gates[1]))];
        let share = (some + others) / worth(None);
        assert!(some > 0.0 && others > 0.0, "{name}: {some} {others}");
        if name == "fixed-pattern-noise" {
            assert!(share < 0.95, "{name}: {share}");
        } else {
            assert!((share - 1.0).abs() < 1e-6, "{name}: {share}");
        }
    }
}

/// Log-likelihood gain of knowing the bias, for fresh noise and a plane fitted to each view. Its mean over
/// 40 draws is what the set says within four standard errors, which one set in 16,000 exceeds.
#[test]
fn fifty_nats_are_fifty_nats() {
    let mut set = white(Cell::Single, &["radial-disparity-bias"], Some(50.0));
    assert!((set.concealed[0].nats.unwrap() - 50.0).abs() < 1.1);
    let fb = set.unit.disparity_px_m();
    let concealed = set.causes.pop().unwrap();
    let views = 0..set.plans.len();
    let plain: Vec<Vec<_>> = views.clone().map(|view| Still::new(&set, view).pixels).collect();
    set.causes.push(concealed);
    let mut gains = Vec::new();
    for draw in 0..40 {
        set.seed = Seed(1000 + draw);
        let gain = |view: usize| {
            let (still, plan) = (Still::new(&set, view), &set.plans[view]);
            let frames: Vec<Vec<f32>> = (0..3).map(|k| still.depth(k)).collect();
            let (mut rows, mut known, mut seen) = (Vec::new(), Vec::new(), Vec::new());
            for (i, pixel) in plain[view].iter().enumerate().filter(|(_, p)| p.on_board) {
                let (u, v) = ((i % 160) as f64, (i / 160) as f64);
                if plan.notes.region.as_ref().is_some_and(|r| !r.contains(u, v)) {
                    continue;
                }
                let d = f64::from(pixel.disparity);
                let sigma = set.unit.sigma(fb / d, plan.stage.theta) * d * d / fb;
                let mean = frames.iter().map(|f| fb / f64::from(f[i])).sum::<f64>() / 3.0;
                rows.push([1.0 / sigma, u / sigma, v / sigma]);
                known.push((f64::from(still.pixels[i].disparity) - d) / sigma);
                seen.push((mean - d) / sigma);
            }
            let x = DMatrix::from_fn(rows.len(), 3, |i, j| rows[i][j]);
            let off = |y: Vec<f64>| {
                let y = DVector::from_vec(y);
                let b = (x.transpose() * &x).lu().solve(&(x.transpose() * &y)).unwrap();
                y - &x * b
            };
            let (known, seen) = (off(known), off(seen));
            1.5 * (seen.norm_squared() - (seen - known).norm_squared())
        };
        gains.push(views.clone().map(gain).sum::<f64>());
    }
    let mean = gains.iter().sum::<f64>() / 40.0;
    let error = (2.0 * 50.0f64 / 40.0).sqrt();
    assert!((mean - 50.0).abs() < 4.0 * error + 1.0, "{mean} +- {error}");
}

/// Every cause that has a strength reaches what is asked within a few per cent.
#[test]
fn what_is_asked_is_reached() {
    for (k, name) in CATALOGUE.iter().chain(&OUTSIDE).enumerate() {
        let cell = if OUTSIDE.contains(name) { Cell::Outside } else { Cell::Single };
        let set = Set::asked(&asked(cell, &[name], Some(150.0), k as u64), Some(8), None).unwrap();
        let Some(got) = set.concealed[0].nats else {
            assert!(["disparity-quantisation", "depth-rounding"].contains(name), "{name}");
            continue;
        };
        let strength = set.concealed[0].strength;
        let near = (got / 150.0 - 1.0).abs() < 0.05;
        assert!(near || strength >= 8.0, "{name}: {got} at {strength}");
    }
    // Worth nothing below a threshold and rising steeply above it; and never worth enough.
    let cliff = |s: f64| Ok(if s < 0.3 { 0.0 } else { 1e5 * (s - 0.3) });
    assert!((strength_for(50.0, cliff).unwrap().1 / 50.0 - 1.0).abs() < 0.02);
    assert_eq!(strength_for(50.0, |_| Ok(3.0)).unwrap(), (8.0, 3.0));
}
