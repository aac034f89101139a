//! Which terms stay, and whether there are maps beside them.

use super::super::tests::{NOISE_PX, bowl, fitted, left, map, session, smooth, term};
use crate::diagnose::finding::pixels::terms_of;
use crate::diagnose::search::outcome::Chosen;
use crate::rng::Seed;
use crate::terms::{Basis, Coordinate, Modulation, PixelContext, Statistic, Term};

#[test]
fn a_bowl_and_its_smooth_rest_are_recovered() {
    let rng = &mut Seed(3).stream("joint/rest");
    let data = session([0.8, 3.0], rng, |p| 0.3 * p.radius.powi(2) + smooth(p));
    let outcome = fitted(&data, vec![bowl(), map()]);
    let maps = |c: &&Chosen| matches!(c.candidate.basis, Basis::Spline { .. });
    assert_eq!(outcome.chosen.iter().filter(maps).count(), 2);
    let others = session([0.8, 3.0], rng, |p| 0.3 * p.radius.powi(2) + smooth(p));
    let [before, after] = left(&others, &outcome);
    assert!(before > 2.0 * NOISE_PX && after < 1.1 * NOISE_PX, "{before} {after}");
}

#[test]
fn a_bowl_alone_needs_no_maps_and_keeps_its_size() {
    let rng = &mut Seed(4).stream("joint/bowl");
    let data = session([0.8, 3.0], rng, |p| 0.3 * p.radius.powi(2));
    let outcome = fitted(&data, vec![bowl()]);
    assert_eq!(outcome.chosen.len(), 2, "the bowl, and what planes absorb of it");
    let k = outcome.coefficients(0)[0];
    assert!((k - 0.3).abs() < 0.01, "{k}");
}

/// One near view may hold most of the evidence, and most of what the maps gain. That the others gain as large a
/// share is what counts.
#[test]
fn a_view_of_much_evidence_does_not_make_maps_uncertain() {
    let rng = &mut Seed(9).stream("joint/heavy");
    let mut data = session([0.8, 3.0], rng, |p| 0.3 * p.radius.powi(2) + 0.5 * smooth(p));
    data[0].weight.iter_mut().for_each(|w| *w *= 30.0);
    let outcome = fitted(&data, vec![bowl()]);
    let maps = |c: &&Chosen| matches!(c.candidate.basis, Basis::Spline { .. });
    assert_eq!(outcome.chosen.iter().filter(maps).count(), 2);
}

/// A wave and a curve over the same columns: the wave explains it all, and keeps its size.
#[test]
fn a_nameless_curve_does_not_share_what_a_name_says() {
    let period_px = 20.0;
    let bias = |p: &PixelContext| 0.1 * (std::f64::consts::TAU * p.u / period_px).sin();
    let rng = &mut Seed(6).stream("joint/companion");
    let data = session([0.8, 3.0], rng, bias);
    let wave = Basis::waves(Coordinate::Column, period_px, 2);
    let (over, low, high) = (Coordinate::Column, 0.0, 160.0);
    let curve = Basis::Curve { over, low, high, nodes: 72, times: Modulation::One };
    let chosen = vec![term(Some("column-banding"), wave), term(None, curve)];
    let outcome = fitted(&data, chosen);
    let families: Vec<_> = outcome.chosen.iter().map(|c| c.candidate.family).collect();
    assert!(families.iter().all(|f| *f == Some("column-banding")), "{families:?}");
    let terms = terms_of(&outcome, Statistic::Bias);
    let at = |u| Term::sum(&terms, &PixelContext { u, ..data[0].places[0] });
    let height = 0.5 * (at(65.0) - at(75.0));
    assert!((height - 0.1).abs() < 0.01, "{height}");
}

/// Waves that only approximate a smooth shape are dropped; a sawtooth leaves the maps too much.
#[test]
fn waves_are_told_beside_the_maps_where_they_are_clear() {
    let waves = |period| term(Some("column-banding"), Basis::waves(Coordinate::Column, period, 2));
    for (teeth_px, told) in [(0.0, false), (0.02, true)] {
        let rng = &mut Seed(8).stream("joint/waves");
        let tooth = |u: f64| teeth_px * (u / 40.0 - (u / 40.0).round());
        let data = session([0.8, 3.0], rng, |p| smooth(p) + tooth(p.u));
        let outcome = fitted(&data, vec![waves(if told { 40.0 } else { 50.0 }), map()]);
        let named = outcome.chosen.iter().any(|c| c.candidate.family.is_some());
        assert_eq!(named, told, "{teeth_px} px");
    }
}
