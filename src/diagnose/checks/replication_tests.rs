use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::rng::Seed;

#[test]
fn halves_are_alike_in_distance_and_tilt() {
    let poses: Vec<(f64, f64)> =
        (0..24).map(|i| (1.0 + 0.5 * f64::from(i / 4), 0.3 * f64::from(i % 4))).collect();
    let second = halves(&poses);
    for which in [false, true] {
        let mine: Vec<&(f64, f64)> =
            poses.iter().zip(&second).filter(|(_, s)| **s == which).map(|(p, _)| p).collect();
        let mean = |of: fn(&(f64, f64)) -> f64| mine.iter().map(|p| of(p)).sum::<f64>() / 12.0;
        assert_eq!(mine.len(), 12);
        approx::assert_abs_diff_eq!(mean(|p| p.0), 2.25, epsilon = 1e-12);
        approx::assert_abs_diff_eq!(mean(|p| p.1), 0.45, epsilon = 1e-12);
    }
    // The order of the views does not matter.
    let turned: Vec<(f64, f64)> = poses.iter().rev().copied().collect();
    assert!(halves(&turned).iter().rev().eq(&second));
}

/// Views that each determine `k` coefficients to a standard error of one; `truth` gives a view's own value.
fn views(
    k: usize,
    truth: impl Fn(usize) -> f64,
    rng: &mut crate::rng::Stream,
) -> (Vec<Evidence>, Vec<bool>) {
    let all = (0..20).map(|v| {
        let b = DVector::from_fn(k, |_, _| {
            let noise: f64 = StandardNormal.sample(rng);
            truth(v) + noise
        });
        Evidence { a: DMatrix::identity(k, k), b }
    });
    (all.collect(), (0..20).map(|v| v % 2 == 1).collect())
}

fn share(k: usize, truth: impl Fn(usize) -> f64) -> f64 {
    let mut rng = Seed(7).stream("replication");
    let replicates = || {
        let (views, second) = views(k, &truth, &mut rng);
        Halves::of(&views, &second, 1e-6, &[k]).unwrap().replicate(&[0], 0.0).unwrap()
    };
    std::iter::repeat_with(replicates).take(400).filter(|r| *r).count() as f64 / 400.0
}

/// For one coefficient, and for as many as a map has: noise replicates at most one time in ten, a common
/// cause always but for the interval's twentieth, and what only one half has never.
#[test]
fn noise_does_not_replicate_and_a_common_cause_does() {
    for k in [1, 40] {
        let (noise, cause) = (share(k, |_| 0.0), share(k, |_| 1.5));
        let half = share(k, |v| if v % 2 == 0 { 3.0 } else { 0.0 });
        assert!(noise < 0.1, "{k} columns: {noise} of noise");
        assert!(cause > 0.9, "{k} columns: {cause} of a cause");
        assert!(half < 0.05, "{k} columns: {half} of what one half has");
    }
}

/// A common effect is never contradicted, though its sizes differ by chance in a twentieth of cases, or truly
/// do; noise mostly is.
#[test]
fn halves_of_other_sizes_do_not_contradict_each_other() {
    let contradicted = |truth: &dyn Fn(usize) -> f64| {
        let mut rng = Seed(9).stream("replication");
        let one = || {
            let (views, second) = views(12, truth, &mut rng);
            Halves::of(&views, &second, 1e-6, &[12]).unwrap().contradict(&[0])
        };
        std::iter::repeat_with(one).take(400).filter(|c| *c).count()
    };
    assert_eq!(contradicted(&|_| 2.0), 0);
    assert_eq!(contradicted(&|v| if v % 2 == 0 { 2.0 } else { 4.0 }), 0);
    assert!(contradicted(&|_| 0.0) > 320, "{}", contradicted(&|_| 0.0));
}

/// Draws views from normal numbers, with the columns of each term.
type Draw<'a> = &'a dyn Fn(&mut dyn FnMut() -> f64) -> (Vec<Evidence>, Vec<usize>);

/// Views of two terms that differ by a thousandth, where a half gives to one what it takes from the other.
/// And views of twelve columns, of which those of either half see eight, four of them alone.
#[test]
fn halves_that_share_out_or_see_parts_do_not_contradict_each_other() {
    let mut rng = Seed(11).stream("replication/parts");
    let mut noise = move || -> f64 { StandardNormal.sample(&mut rng) };
    let second: Vec<bool> = (0..20).map(|v| v % 2 == 1).collect();
    let mut contradicted = |halves: Draw<'_>| {
        let one = || {
            let (views, counts) = halves(&mut noise);
            let halves = Halves::of(&views, &second, 1e-6, &counts).unwrap();
            (0..counts.len()).any(|term| halves.contradict(&[term]))
        };
        std::iter::repeat_with(one).take(200).filter(|c| *c).count()
    };
    let alike = |noise: &mut dyn FnMut() -> f64| {
        let rows = DMatrix::from_row_slice(2, 2, &[1.0, 1.0, 0.0, 1e-3]);
        let view = |_| {
            let y = DVector::from_fn(2, |i, _| rows.row(i).sum() * 2.0 + noise());
            Evidence { a: rows.transpose() * &rows, b: rows.transpose() * y }
        };
        ((0..20).map(view).collect(), vec![1, 1])
    };
    assert_eq!(contradicted(&alike), 0);
    let parts = |noise: &mut dyn FnMut() -> f64| {
        let view = |v: usize| {
            let sees = |k: usize| if v.is_multiple_of(2) { k < 8 } else { k >= 4 };
            let known = DVector::from_fn(12, |k, _| if sees(k) { 1.0 } else { 1e-3 });
            let b = known.map(|w: f64| w * 2.0 + w.sqrt() * noise());
            Evidence { a: DMatrix::from_diagonal(&known), b }
        };
        ((0..20).map(view).collect(), vec![12])
    };
    assert_eq!(contradicted(&parts), 0);
}

#[test]
fn sizes_that_differ_do_not_agree() {
    let size = |value, std_error| Some(ViewMean::new(value, std_error, 8.0));
    assert_eq!(agree([size(1.0, 0.1), size(1.2, 0.1)]), Some(true));
    assert_eq!(agree([size(1.0, 0.1), size(1.6, 0.1)]), Some(false));
    assert_eq!(agree([size(0.1, 0.1), size(0.1, 0.1)]), Some(false), "no half sees it");
    assert_eq!(agree([size(1.0, 0.1), size(-1.0, 0.9)]), Some(false), "other sign");
    assert_eq!(agree([size(1.0, 0.1), None]), None);
}
