//! Far errors of known fraction and scale among Gaussian noise.

use rand::Rng;
use rand_distr::{Distribution, Exp1, StandardNormal};

use super::*;
use crate::rng::{Seed, Stream};

/// Number of readings.
const READINGS: usize = 400_000;

fn counted(rng: &mut Stream, fraction: f64, stray: impl Fn(&mut Stream) -> f64) -> TailCounts {
    let mut counts = TailCounts::default();
    for _ in 0..READINGS {
        let far = rng.random::<f64>() < fraction;
        let error: f64 = if far { stray(rng) } else { StandardNormal.sample(rng) };
        counts.count(error.abs() as f32);
    }
    counts
}

/// Number of 90 % intervals that hold the true fraction and scale.
fn held(name: &str, seeds: u64, stray: fn(&mut Stream, f64) -> f64) -> [usize; 2] {
    let mut held = [0; 2];
    for seed in 0..seeds {
        let mut rng = Seed(seed).stream("strays");
        let fraction = 10f64.powf(rng.random_range(-3.3..-1.7));
        let scale = rng.random_range(3.0..8.0);
        let counts = counted(&mut rng, fraction, |rng| stray(rng, scale));
        let outliers = outliers(&counts, 0.0).expect("strays");
        for (k, ([said, error], truth)) in
            [(outliers.fraction, fraction), (outliers.scale, scale)].into_iter().enumerate()
        {
            held[k] += usize::from((said - truth).abs() <= 1.645 * error);
        }
    }
    println!("{name}: {held:?} of {seeds}");
    held
}

fn gaussian(rng: &mut Stream, scale: f64) -> f64 {
    let normal: f64 = StandardNormal.sample(rng);
    scale * normal
}

fn laplace(rng: &mut Stream, scale: f64) -> f64 {
    let away: f64 = Exp1.sample(rng);
    scale * away / 2f64.sqrt()
}

fn uniform(rng: &mut Stream, scale: f64) -> f64 {
    scale * 3f64.sqrt() * rng.random_range(-1.0..1.0)
}

/// 90 % of 40 are 36; 31 or fewer have a chance of 3 %.
#[test]
fn intervals_hold_whatever_far_errors_are_drawn_from() {
    type Draw = fn(&mut Stream, f64) -> f64;
    let forms: [(&str, Draw); 3] =
        [("gaussian", gaussian), ("laplace", laplace), ("uniform", uniform)];
    for (name, stray) in forms {
        assert!(held(name, 40, stray).iter().all(|n| *n >= 32), "{name}");
    }
}

/// Where a tail of scale 2 ends, a single stray has almost no chance, and says nothing.
#[test]
fn one_stray_does_not_decide() {
    let mut rng = Seed(2).stream("strays/one");
    let mut counts = counted(&mut rng, 0.05, |rng| gaussian(rng, 2.0));
    let before = outliers(&counts, 0.0).expect("strays");
    counts.count(13.0);
    let after = outliers(&counts, 0.0).expect("strays");
    for (a, b) in [(after.fraction, before.fraction), (after.scale, before.scale)] {
        assert!((a[0] - b[0]).abs() < b[1], "{a:?} after {b:?}");
    }
}

#[test]
fn gross_errors_are_no_tail() {
    let mut rng = Seed(1).stream("strays/gross");
    let mut counts = counted(&mut rng, 0.003, |rng| laplace(rng, 5.0));
    let before = outliers(&counts, 0.0).expect("strays");
    (0..400).for_each(|_| counts.count(300.0));
    let after = outliers(&counts, 0.0).expect("strays");
    assert!((after.scale[0] / before.scale[0] - 1.0).abs() < 0.01);
    assert!(outliers(&TailCounts::default(), 0.0).is_none());
}
