//! Known values of each shape.

use nalgebra::Vector3;

use super::*;
use crate::plane::Plane;

const TIMES: Modulation = Modulation::DisparitySquared;
const OVER: Coordinate = Coordinate::Disparity;

fn places() -> impl Iterator<Item = PixelContext> {
    (0..200u32).map(|k| PixelContext {
        u: f64::from(k * 3),
        v: f64::from(k * 37 % 480),
        disparity: 5.0 + 0.275 * f64::from(k),
        rho: 1.3,
        theta: 0.4,
        z: 0.5 + 0.01 * f64::from(k),
        ..PixelContext::default()
    })
}

/// Node values on a straight line give that line between the nodes too, so the weights sum to one and each is
/// at its place.
#[test]
fn between_the_nodes_of_a_line_is_the_line() {
    let (width, height) = (640.0, 480.0);
    let curve = Basis::Curve { over: OVER, low: 5.0, high: 60.0, nodes: 7, times: TIMES };
    let map = Basis::Map { width, height, across: 5, down: 4, times: Modulation::Tilt };
    let spline = Basis::Spline { width, height, across: 5, down: 4, times: TIMES };
    let over = [OVER, Coordinate::Row];
    let pair = Basis::Pair { over, low: [5.0, 0.0], high: [60.0, 479.0], nodes: [3, 6] };
    // Nodes across, steps between the first and the last that count (a spline's: inside the picture), columns
    // seen.
    let shapes = [(curve, 7, [6.0, 1.0], 2), (map, 5, [4.0, 3.0], 4), (spline, 5, [2.0, 1.0], 16)];
    for (basis, across, [right, down], few) in shapes.into_iter().chain([(pair, 3, [2.0, 5.0], 4)])
    {
        let at_node = |k: usize| 0.3 + 0.7 * (k % across) as f64 - 1.1 * (k / across) as f64;
        let line: Vec<f64> = (0..basis.count()).map(at_node).collect();
        for p in places() {
            let (scale, [x, y]) = match basis {
                Basis::Curve { .. } => (TIMES.value(&p), [(p.disparity - 5.0) / 55.0, 0.0]),
                Basis::Pair { .. } => (1.0, [(p.disparity - 5.0) / 55.0, p.v / 479.0]),
                Basis::Map { times, .. } | Basis::Spline { times, .. } => {
                    (times.value(&p), [p.u / 639.0, p.v / 479.0])
                }
                _ => unreachable!(),
            };
            // A spline's first node is a step before the picture.
            let before = if matches!(basis, Basis::Spline { .. }) { 1.0 } else { 0.0 };
            let expected = scale * (0.3 + 0.7 * (right * x + before) - 1.1 * (down * y + before));
            let value = basis.value(&line, &p);
            assert!((value - expected).abs() < 1e-11, "{basis:?}: {value} {expected}");
            let mut seen = 0;
            basis.visit(&p, |_, _| seen += 1);
            assert_eq!(seen, few, "{basis:?}");
        }
    }
}

/// Moving and tilting a board as a whole changes nothing.
#[test]
fn a_lift_has_no_straight_part() {
    let basis = Basis::Curve {
        over: Coordinate::Right,
        low: -0.5,
        high: 0.7,
        nodes: 6,
        times: Modulation::Lift,
    };
    let bent: Vec<f64> = (0..6).map(|k| (2.1 * f64::from(k)).sin()).collect();
    let moved: Vec<f64> = (0..6).map(|k| bent[k] + 4.0 - 1.5 * k as f64).collect();
    for k in 0..50 {
        let right = f64::from(k) * 0.03 - 0.6;
        let place = PixelContext { right, disparity: 40.0, rho: 2.0, ..PixelContext::default() };
        let [a, b] = [&bent, &moved].map(|c| basis.value(c, &place));
        assert!((a - b).abs() < 1e-10, "{right}: {a} {b}");
    }
    let line: Vec<f64> = (0..6).map(|k| 1.0 + f64::from(k)).collect();
    let place = PixelContext { right: 0.3, disparity: 40.0, rho: 2.0, ..PixelContext::default() };
    assert!(basis.value(&line, &place).abs() < 1e-10);
}

/// A ring closes; a table returns its numbers; powers have their constant second.
#[test]
fn known_values() {
    let ring = Basis::Ring { over: OVER, period: 3.0, nodes: 5, times: Modulation::One };
    let nodes = [1.0, -2.0, 0.5, 4.0, 7.0];
    let depths = (0..TABLE * TABLE).map(|k| (k % TABLE) as f64).collect();
    let table = Basis::Table { z_m: [0.5, 2.5], theta_rad: [0.0, 1.0], columns: vec![depths] };
    let (over, times) = (OVER, Modulation::Tilt);
    let powers = Basis::Powers { over, orders: 3, level: true, times };
    for k in 0..10 {
        let at = |turned: f64| PixelContext { disparity: 0.6 * turned, ..Default::default() };
        let middle = 0.5 * (nodes[k % 5] + nodes[(k + 1) % 5]);
        assert!((ring.value(&nodes, &at(k as f64)) - nodes[k % 5]).abs() < 1e-9, "{k}");
        assert!((ring.value(&nodes, &at(k as f64 + 0.5)) - middle).abs() < 1e-9, "{k}");
    }
    for p in places() {
        let (d, tilt) = (p.disparity, 0.4f64.sin());
        let expected = 2.0 * (8.0 * (p.z - 0.5)).min(16.0);
        assert!((table.value(&[2.0], &p) - expected).abs() < 1e-9, "{p:?}");
        let mut row = [0.0; 4];
        powers.fill(&p, &mut row);
        let expected = [d, 1.0, d * d, d * d * d].map(|x| tilt * x);
        assert!(row.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9 * b.abs()), "{row:?}");
    }
}

/// Light on a tilted wall, by vectors: the square of the range over the cosine between ray and normal.
#[test]
fn the_pattern_falls_off_with_range_and_incidence() {
    let plane = Plane::tilted(2.0, 1.0, 0.4);
    for (x, y) in [(-0.4, 0.1), (0.0, 0.0), (0.3, -0.3)] {
        let point = Vector3::new(x, y, 1.0) * plane.depth(x, y);
        let facing = plane.normal().dot(&point.normalize()).abs();
        let place =
            PixelContext { x, y, z: point.z, rho: plane.distance(), ..PixelContext::default() };
        let truth = point.norm_squared() / facing;
        assert!((place.pattern_fall_off() / truth - 1.0).abs() < 1e-12);
    }
}
