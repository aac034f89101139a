//! Causes of a few views, among simulated views.

use super::*;
use crate::terms::{Coordinate, Modulation};

fn views(name: &str, size: f64, of: usize) -> Vec<Evidence> {
    let mut rng = Seed(7).stream(name);
    let one = |v: usize| {
        let (a, noise): (f64, f64) = (100.0, StandardNormal.sample(&mut rng));
        let beta = if v < of { size } else { 0.0 };
        let b = DVector::from_element(1, a * beta + a.sqrt() * noise);
        Evidence { a: DMatrix::from_element(1, 1, a), b }
    };
    (0..18).map(one).collect()
}

/// Three views of eighteen show a cause, which is worth 150 nats in them: 0.5 a beta^2 each.
#[test]
fn the_views_that_show_it_are_found() {
    let mut found = best(&views("few-views/three", 1.0, 3), 0.1).unwrap();
    found.views.sort_unstable();
    assert_eq!(found.views, [0, 1, 2]);
    assert!((found.beta[0] - 1.0).abs() < 0.25 && found.gain > 90.0, "{}", found.gain);
}

/// Eight views of eighteen still count as few. At most three quarters of the 390 nats are lost: the
/// lower quartile of all views is the median of the ten noise views, four times the quartile it is
/// taken for.
#[test]
fn nearly_half_of_the_views_are_few() {
    let slope = Candidate::curve(Basis::powers(Coordinate::Column, 1, Modulation::One));
    let tried = Tried::of(&slope, views("few-views/half", 1.0, 8), 0.1, 1.0).unwrap();
    let found = tried.best().unwrap();
    assert_eq!((found.views.len(), found.gain > 90.0), (8, true), "{}", found.gain);
}

/// Of sixteen columns a view shows three. Views that scatter five times as much in the variance: their evidence
/// counts a fifth, where sixteen degrees of freedom a view would let it pass whole.
#[test]
fn what_a_view_does_not_show_is_no_freedom_of_its_own() {
    let curve = Candidate::curve(Basis::powers(Coordinate::Column, 16, Modulation::One));
    let mut rng = Seed(8).stream("few-views/rank");
    let mut one = |v: usize| {
        let seen = |i: usize| (3 * v..3 * v + 3).any(|k| k % 16 == i);
        let a = DVector::from_fn(16, |i, _| if seen(i) { 100.0 } else { 0.0 });
        let white = DVector::from_fn(16, |_, _| StandardNormal.sample(&mut rng));
        let b = a.map(|a: f64| (5.0 * a).sqrt()).component_mul(&white);
        Evidence { a: DMatrix::from_diagonal(&a), b }
    };
    let mean = (0..40)
        .map(|_| {
            let tried = Tried::of(&curve, (0..24).map(&mut one).collect(), 0.1, 1.0).unwrap();
            100.0 / tried.evidence[0].a.trace() * 3.0 / 40.0
        })
        .sum::<f64>();
    assert!((3.5..7.0).contains(&mean), "{mean}");
}

#[test]
fn noise_brings_less_than_the_choice_costs() {
    let gain = |n: u64| best(&views(&format!("few-views/{n}"), 0.0, 0), 0.1).unwrap().gain;
    let above = (0..200).filter(|&n| gain(n) > 5.0).count();
    assert!(above <= 6, "{above} of 200 above 5 nats");
}

/// Three views of eighteen with one cause predict one another. Three with errors of their own, of opposite signs
/// or of one view alone, do not, however clear they are.
#[test]
fn views_with_errors_of_their_own_have_no_cause_in_common() {
    let slope =
        Candidate::named("column-banding", Basis::powers(Coordinate::Column, 2, Modulation::One));
    let best = |errors: &[[f64; 2]]| {
        let mut rng = Seed(9).stream("few-views/agreed");
        let mut one = |v: usize| {
            let beta = errors.get(v).copied().unwrap_or_default();
            let white = DVector::from_fn(2, |_, _| StandardNormal.sample(&mut rng));
            let b = 100.0 * DVector::from_row_slice(&beta) + 10.0 * white;
            Evidence { a: DMatrix::identity(2, 2) * 100.0, b }
        };
        Tried::of(&slope, (0..18).map(&mut one).collect(), 0.1, 1.0).unwrap().best().unwrap()
    };
    let agreed = |errors: &[[f64; 2]]| {
        let best = best(errors);
        best.views.len() <= errors.len() && best.agreed
    };
    assert!(agreed(&[[1.0, 0.5]; 3]));
    assert!(!agreed(&[[1.0, 0.5]]));
    assert!(!agreed(&[[1.5, 0.0], [0.0, 1.5], [-1.0, 1.0]]));
    // A view that is off alone has a cause; the largest of many that are off has none of its own.
    assert!(best(&[[1.5, 0.0]]).is_cause(15.0));
    assert!(!best(&[[1.5, 0.0], [0.0, 1.1], [-0.9, 0.9], [0.8, -0.8]]).is_cause(15.0));
}

/// Bands that a curve over distance explains as well have no name; they keep it where only a curve over
/// their own axis does.
#[test]
fn a_name_is_better_than_curves_on_other_axes() {
    let basis = |over| Basis::Ring { over, period: 1.0, nodes: 6, times: Modulation::One };
    let [columns, distance] = [Coordinate::Column, Coordinate::Z].map(basis);
    let bands = Candidate::named("column-banding", columns.clone());
    let [own, other] = [columns, distance].map(Candidate::curve);
    let found = |candidate, gain| {
        (candidate, Best { gain, views: vec![3], beta: DVector::zeros(6), agreed: true, next: 0.0 })
    };
    let name_of = |all: &[_], nameless| told(all, nameless).unwrap().1.first().copied();
    let cases = [
        (&other, 95.0, None),
        (&other, 60.0, Some("column-banding")),
        (&own, 99.0, Some("column-banding")),
    ];
    for (curve, gain, name) in cases {
        let all = [found(&bands, 100.0), found(curve, gain)];
        assert_eq!(name_of(&all, 0.0), name, "{gain}");
        assert_eq!(name_of(&all, 20.0), name, "{gain}, much more than what has none");
        assert_eq!(name_of(&all, 90.0), None, "{gain}, about what has no name");
    }
    let all = [found(&other, 100.0), found(&bands, 80.0)];
    assert_eq!(name_of(&all, 0.0), None, "a name that explains too little");
}

/// So many causes explain one view's noise level that none is named, and a curve whose columns cost
/// most of its gain is not taken either; two causes are both named.
#[test]
fn what_many_causes_explain_has_no_name() {
    let level = |id| Candidate::named(id, Basis::Level);
    let causes =
        ["slope-noise", "range-exponent", "tilt-axis-anisotropy", "ambient-light"].map(level);
    let curve = Candidate::ring(Coordinate::Column, 1.0, 8);
    let found = |candidate, gain| {
        (candidate, Best { gain, views: vec![3], beta: DVector::zeros(1), agreed: true, next: 0.0 })
    };
    let with = |causes| -> Vec<(&Candidate, Best)> {
        let causes: &[Candidate] = causes;
        causes.iter().map(|c| found(c, 24.5)).chain([found(&curve, 4.0)]).collect()
    };
    let all = with(&causes[..]);
    let ((_, best), names) = told(&all, 0.0).unwrap();
    assert!(names.is_empty() && best.gain == 24.5, "{names:?}");
    let two = with(&causes[..2]);
    assert_eq!(told(&two, 0.0).unwrap().1, ["slope-noise", "range-exponent"]);
}
