//! Textures of some of the views, in synthetic structures.

use super::tests::{parameter, with};
use super::*;
use crate::rng::Seed;

const LEVEL: f64 = 1e-3;

/// Fourteen views; the fifth to the ninth have an effect added.
fn of_five(seed: u64, add: impl Fn(&mut Structure)) -> Vec<Structure> {
    let mut rng = Seed(seed).stream("further");
    let mut number = 0;
    with(&mut rng, |s| {
        number += 1;
        // Far views have thirty times the noise variance of near ones, and row noise in proportion.
        let far = 30f64.powf(f64::from(number) / 14.0);
        s.variance_px2 *= far;
        s.row_px2 = s.row_px2.map(|px2| px2 * far);
        (s.neighbour_correlation, s.near_error) = (Some(0.0), f64::INFINITY);
        if (5..10).contains(&number) {
            add(s);
        }
    })
}

/// What is found, and in how many of twelve sessions: in one of eleven, fewer than three of the nine views
/// without it lie below zero.
fn told(id: &str, add: impl Fn(&mut Structure)) -> (TextureFinding, usize) {
    let all = (0..12).map(|seed| {
        let views = of_five(seed, &add);
        let known = KnownTerms::default();
        let found = texture_findings(&views, &known, LEVEL);
        assert!(found.is_empty(), "a mean over all tells it too: {:?}", found[0].families);
        let found = further_textures(&views, &known, LEVEL, &found);
        found.into_iter().find(|f| f.families.contains(&id))
    });
    let found: Vec<TextureFinding> = all.flatten().collect();
    (found.first().cloned().expect("in some session"), found.len())
}

#[test]
fn textures_of_some_views_have_their_names_and_sizes() {
    let rows = |s: &mut Structure| s.row_px2 = s.row_px2.map(|px2| px2 + 0.1 * s.variance_px2);
    let (found, times) = told("row-noise", rows);
    assert!(times >= 7 && found.of_some.is_some(), "{times}");
    assert_eq!(found.words.as_deref(), Some("in 5 of 14 views"));
    // A tenth of .04 px^2 times 30^(5/14) to 30^(9/14): .12 to .19 px.
    let [sigma, error] = parameter(&found, "sigma_px");
    assert!((0.1..0.2).contains(&sigma) && error < 0.05, "{sigma} {error}");
    let alike = |s: &mut Structure| s.lagged = s.lagged.map(|c| c.map(|c| c + 0.3));
    let (_, times) = told("frozen-noise", alike);
    assert!(times >= 7, "{times}");
}

/// Two tests of some views at 0.005 each: 40 of 4000 sessions +- 6.3, less those without a scale or a name.
#[test]
fn sessions_of_nothing_have_a_texture_of_some_as_often_as_the_level_says() {
    let found = (0..4000).filter(|seed| {
        let views = of_five(1000 + seed, |_| {});
        !textures_of_some(&views, &KnownTerms::default(), 0.01, &[]).is_empty()
    });
    let found = found.count();
    assert!((5..60).contains(&found), "{found} of 4000");
}
