//! Oracles: geometry without noise, the size of the noise, and what each cause leaves alone.

use super::shoot::Still;
use super::{Act, CATALOGUE, Cell, OUTSIDE, Order, Set};

fn order(cell: Cell, effect: &str) -> Order {
    let effects = if effect.is_empty() { Vec::new() } else { vec![effect.into()] };
    Order { cell, effects, strength: 1.0, seed: 11, views: Some(6), frames: Some(4), small: true }
}

fn bare(effect: &str) -> Set {
    let cell = if OUTSIDE.contains(&effect) { Cell::Outside } else { Cell::Single };
    let mut set = Set::draw(order(cell, effect)).unwrap();
    // Only what is concealed.
    set.causes.drain(..set.known_causes);
    set.known_causes = 0;
    set
}

/// Of the numbers that are there.
fn moments(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (mut n, mut sum, mut squares) = (0.0, 0.0, 0.0);
    values.filter(|v| v.is_finite()).for_each(|v| {
        n += 1.0;
        sum += v;
        squares += v * v;
    });
    let mean: f64 = sum / n;
    (mean, (squares / n - mean * mean).sqrt())
}

#[test]
fn without_noise_a_board_is_a_plane_and_the_axis_meets_it_where_it_was_put() {
    let mut set = bare("vignetting");
    set.causes.clear();
    set.unit.sigma = [0.0, 0.0, 0.0, 0.0, 2.0, 1.39];
    let camera = set.unit.sensor.camera.clone();
    for (view, plan) in set.plans.iter().enumerate() {
        let depth = Still::new(&set, view).depth(0);
        let plane =
            kinoise::plane::Plane::from_normal(plan.stage.board.normal, plan.stage.board.reach);
        assert!((plane.theta() - plan.stage.theta).abs() < 1e-9);
        for (i, z) in depth.iter().enumerate().step_by(7) {
            let (x, y) = camera.ray((i % camera.width) as f64, (i / camera.width) as f64);
            let (board, z) = (plane.depth(x, y), f64::from(*z));
            let wall = plan.stage.wall.unwrap_or(f64::NAN);
            let off = (z - board).abs().min((z - wall).abs());
            assert!(z.is_nan() || off < 1e-5 * z, "view {view}, pixel {i}: {z} {board}");
        }
    }
}

#[test]
fn noise_is_as_large_as_the_unit_says() {
    let mut set = bare("vignetting");
    set.causes.clear();
    let mut still = set;
    let sigma = still.unit.sigma;
    for view in 0..3 {
        still.unit.sigma = sigma;
        let noisy = Still::new(&still, view).depth(0);
        still.unit.sigma = [0.0, 0.0, 0.0, 0.0, 2.0, 1.39];
        let exact = Still::new(&still, view).depth(0);
        still.unit.sigma = sigma;
        let theta = still.plans[view].stage.theta;
        let wall = still.plans[view].stage.wall;
        let scores = noisy.iter().zip(&exact).map(|(a, b)| {
            let z = f64::from(*b);
            let tilt = if wall.is_some_and(|w| (z - w).abs() < 1e-5) { 0.0 } else { theta };
            f64::from(a - b) / still.unit.sigma(z, tilt)
        });
        let (mean, sd) = moments(scores);
        assert!(mean.abs() < 0.02 && (sd - 1.0).abs() < 0.02, "view {view}: {mean} {sd}");
    }
}

/// What a still view holds, and its noise.
struct Held {
    disparity: Vec<f32>,
    sigma: Vec<f32>,
    noise: Vec<f32>,
    depth: Vec<f32>,
}

fn held(set: &Set, view: usize, frame: usize) -> Held {
    let still = Still::new(set, view);
    let (noise, depth) = (still.noise(frame), still.depth(frame));
    Held { disparity: still.disparity, sigma: still.sigma, noise, depth }
}

fn same(a: &[f32], b: &[f32]) -> bool {
    a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
}

#[test]
fn every_cause_changes_what_it_should_and_nothing_else() {
    for name in CATALOGUE.iter().chain(&OUTSIDE) {
        let mut set = bare(name);
        let label = set.causes[0].label.clone();
        assert_eq!(label.id, CATALOGUE.contains(name).then_some(*name));
        let frame = usize::from(*name != "first-frame");
        let with: Vec<Held> = (0..6).map(|v| held(&set, v, frame)).collect();
        let act = std::mem::take(&mut set.causes).remove(0).act;
        let without: Vec<Held> = (0..6).map(|v| held(&set, v, frame)).collect();
        let changed = |of: fn(&Held) -> &Vec<f32>| {
            with.iter().zip(&without).any(|(a, b)| !same(of(a), of(b)))
        };
        assert!(changed(|h| &h.depth), "{name} does nothing");
        let moves = changed(|h| &h.disparity);
        let spreads = changed(|h| &h.sigma);
        let shapes = changed(|h| &h.noise);
        match act {
            // A bent board or ray is met at another distance, where sigma is another.
            Act::Ray(_) | Act::Lift(_) => assert!(moves && !shapes, "{name}"),
            Act::Mismatch(_) => assert!(moves && !spreads && !shapes, "{name}"),
            Act::Spread(_) => assert!(!moves && spreads && !shapes, "{name}"),
            Act::Grain(..) => assert!(!moves && !spreads && shapes, "{name}"),
            _ => assert!(!moves && !spreads && !shapes, "{name}"),
        }
        let missing = |held: &Held| held.depth.iter().filter(|z| z.is_nan()).count();
        let loses = with.iter().zip(&without).any(|(a, b)| missing(a) != missing(b));
        assert_eq!(loses, label.statistic == "missing", "{name}");
    }
}

#[test]
fn shaped_noise_keeps_its_size() {
    for name in ["spatial-correlation", "temporal-correlation", "frozen-noise", "heavy-tails"] {
        let set = bare(name);
        if set.causes[0].label.form == "laplace mixture" {
            continue;
        }
        let fields = (0..6).flat_map(|v| Still::new(&set, v).noise(2));
        let (mean, sd) = moments(fields.map(f64::from));
        // 6 x 76,800 pixels, of which a window of 7 px leaves 9,400 independent: 0.010 and 0.005.
        assert!(mean.abs() < 0.04 && (sd - 1.0).abs() < 0.02, "{name}: {mean} {sd}");
    }
}

#[test]
fn sets_are_opaque_repeatable_and_apart() {
    let set = bare("seam");
    assert_eq!(set.name, Set::draw(order(Cell::Outside, "seam")).unwrap().name);
    assert_ne!(set.name, bare("blob").name);
    let words = |s: &Set| Still::new(s, 0).words(0);
    assert_eq!(words(&set), words(&bare("seam")));
    assert!(Set::draw(order(Cell::Single, "no such thing")).is_err());
}

/// Nulls that know their window, references for what only they show, none for the blind.
#[test]
fn sets_bring_what_their_question_needs() {
    for seed in 0..30 {
        let null = Set::draw(Order { seed, ..order(Cell::Null, "") }).unwrap();
        assert_eq!(null.causes.len(), null.known.len());
        let blind = Set::draw(Order { seed, ..order(Cell::Blind, "") }).unwrap();
        assert!(blind.plans.iter().all(|p| p.notes.reference_distance_m.is_none()));
        let scale = Set::draw(Order { seed, ..order(Cell::Single, "depth-scale") }).unwrap();
        assert!(scale.plans.iter().all(|p| p.notes.reference_distance_m.is_some()));
        let pair = Set::draw(Order { seed, ..order(Cell::Pair, "") }).unwrap();
        assert_eq!(pair.causes.len() - pair.known_causes, 2);
    }
}
