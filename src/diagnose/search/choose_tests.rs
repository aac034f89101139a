//! What is chosen of the candidates of a step.

use crate::diagnose::search::candidate::Candidate;
use crate::diagnose::search::rules::Rules;
use crate::diagnose::search::search;
use crate::diagnose::search::tests::{RULES, session};
use crate::rng::Seed;
use crate::terms::{Axis, Basis, Coordinate, Modulation, PixelContext};

/// A ramp over the rows with a small part over the columns is a row curve first; what depends
/// equally on both is a map.
#[test]
fn a_map_is_for_what_depends_on_both() {
    type Bias = fn(&PixelContext) -> f64;
    let ramp: Bias = |p| 1.5 * p.v / 480.0 + 0.15 * p.u / 640.0;
    let hill: Bias = |p| (-((p.u - 300.0).powi(2) + (p.v - 200.0).powi(2)) / 2e4).exp();
    let (over, times) = (Coordinate::Row, Modulation::One);
    let rows = Basis::Curve { over, low: 0.0, high: 479.0, nodes: 9, times };
    let map = Basis::Map { width: 640.0, height: 480.0, across: 6, down: 4, times };
    let candidates = [rows, map].map(Candidate::curve);
    for (seed, bias, axis) in [(1, ramp, Axis::Row), (2, hill, Axis::Pixel)] {
        let views = session(&mut Seed(seed).stream("choose"), bias);
        let outcome = search(&views, &views, &candidates, None, &RULES, Seed(seed));
        assert_eq!(outcome.chosen[0].candidate.basis.axis(), axis);
    }
}

/// A bias of r^2 that grows with d^0.3: r d^0.3 is steadier over the views and explains 95 to 98 % of the best curve,
/// r^2 all of it.
#[test]
fn of_two_shapes_as_simple_the_one_that_explains_enough_is_named() {
    let grown = |p: &PixelContext| 8.0 * p.radius.powi(2) * (p.disparity / 25.0).powf(0.3);
    let of = |over, power| {
        let basis = Basis::powers(over, 1, Modulation::power(power));
        Candidate::named("radial-disparity-bias", basis)
    };
    let (over, times) = (Coordinate::Radius, Modulation::One);
    let rest = Candidate::curve(Basis::Curve { over, low: 0.0, high: 1.0, nodes: 10, times });
    let candidates = [of(over, 0.3), of(Coordinate::RadiusSquared, 0.0), rest];
    let rules = Rules { own_axis_adequacy: 0.99, ..RULES };
    for seed in [1, 2, 3] {
        let views = session(&mut Seed(seed).stream("choose/as-simple"), grown);
        let outcome = search(&views, &views, &candidates, None, &rules, Seed(seed));
        assert_eq!(outcome.chosen[0].candidate.basis, candidates[1].basis);
    }
}
