//! What may shift the mean: candidates in px of disparity.

use super::candidate::Candidate;
use super::reach::Extent;
use super::tiles::SIDE;
use crate::camera::Camera;
use crate::terms::{Basis, Coordinate, Modulation};

/// All named bias families for a camera.
pub fn families(camera: &Camera, reach: &Extent) -> Vec<Candidate> {
    let mut all = Vec::new();
    // Two orders for what is nearly a parabola, four for a wavy one.
    for orders in [2, 4] {
        for disparity_power in [-1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0] {
            let bowl = Basis::Bowl { disparity_power, orders };
            all.push(Candidate::named("radial-disparity-bias", bowl));
        }
    }
    for orders in [1, 2, 4] {
        let lens = Basis::Lens { fx: camera.fx, fy: camera.fy, orders };
        all.push(Candidate::named("lens-distortion", lens));
    }
    all.push(Candidate::named("range-not-depth", Basis::RangeNotDepth));
    all.push(Candidate::named("target-bow", Basis::Bow { degree: 2 }));
    all.push(Candidate::named("target-bow", Basis::Bow { degree: 4 }));
    locking(&mut all, reach);
    let width = camera.width as f64;
    // Bands that do not come again are none: three periods at least.
    for half_cycles in 6..=64 {
        let period_px = 2.0 * width / f64::from(half_cycles);
        // Waves shorter than two tiles look like long ones.
        let resolved = (period_px / (2.0 * SIDE as f64)) as usize;
        if resolved > 0 {
            let banding = Basis::Banding { period_px, harmonics: resolved.min(4) };
            all.push(Candidate::named("column-banding", banding));
        }
        if half_cycles <= 16 && resolved > 4 {
            let banding = Basis::Banding { period_px, harmonics: resolved.min(8) };
            all.push(Candidate::named("column-banding", banding));
        }
    }
    for width_px in [0.5, 1.0, 2.0, 4.0, 8.0] {
        if reach.edge >= 4.0 * width_px {
            all.push(Candidate::named("edge-mixing", Basis::EdgeMixing { width_px }));
        }
    }
    all
}

/// Periodic in the disparity with a period of one pixel, give or take what focal length and
/// baseline are off.
fn locking(all: &mut Vec<Candidate>, reach: &Extent) {
    const OFF: f64 = 0.03;
    // A quarter of a cycle over the range of disparities.
    let step = 0.25 / (reach.disparity[1] - reach.disparity[0]).max(1.0);
    let half = ((OFF / step).ceil() as i64).clamp(1, 12);
    for k in -half..=half {
        let period_px = 1.0 / (1.0 + OFF * k as f64 / half as f64);
        all.push(Candidate::named("pixel-locking", Basis::Locking { period_px, harmonics: 3 }));
    }
}

/// Curves without a name, one axis each, and maps over two.
pub fn curves(camera: &Camera, reach: &Extent) -> Vec<Candidate> {
    let (width, height) = (camera.width as f64, camera.height as f64);
    let curve = |over, [low, high]: [f64; 2], nodes, times| {
        Candidate::curve(Basis::Curve { over, low, high, nodes, times })
    };
    let map =
        |across, down, times| Candidate::curve(Basis::Map { width, height, across, down, times });
    let mut all = vec![
        curve(Coordinate::Column, [0.0, width], 24, Modulation::One),
        curve(Coordinate::Column, [0.0, width], 72, Modulation::One),
        curve(Coordinate::Row, [0.0, height], 24, Modulation::One),
        curve(Coordinate::Row, [0.0, height], 72, Modulation::One),
        curve(Coordinate::Radius, [0.0, 1.0], 10, Modulation::One),
        curve(Coordinate::Radius, [0.0, 1.0], 10, Modulation::DisparitySquared),
        curve(Coordinate::Disparity, reach.disparity, 16, Modulation::One),
        curve(Coordinate::Z, reach.z, 24, Modulation::One),
        curve(Coordinate::Right, reach.right, 12, Modulation::Lift),
        curve(Coordinate::Down, reach.down, 12, Modulation::Lift),
        curve(Coordinate::Edge, [0.0, 24.0], 9, Modulation::One),
        Candidate::curve(Basis::Ring {
            over: Coordinate::Disparity,
            period: 1.0,
            nodes: 12,
            times: Modulation::One,
        }),
        map(8, 6, Modulation::One),
        map(8, 6, Modulation::DisparitySquared),
    ];
    all.extend(seams(width, Coordinate::Column));
    all.extend(seams(height, Coordinate::Row));
    all.push(along(camera));
    all.extend(waves(reach));
    if reach.light[1] > 1.05 * reach.light[0] {
        all.push(curve(Coordinate::Light, reach.light, 8, Modulation::One));
    }
    all
}

/// Two halves of the picture that disagree, at any of these places.
fn seams(length: f64, over: Coordinate) -> impl Iterator<Item = Candidate> {
    const PLACES: usize = 32;
    (2..PLACES - 1).map(move |k| {
        let at = length * k as f64 / PLACES as f64;
        let (low, high) = (at - 1.0, at + 1.0);
        Candidate::curve(Basis::Curve { over, low, high, nodes: 2, times: Modulation::One })
    })
}

/// What turns with the direction of the tilt and is not there without one.
fn along(camera: &Camera) -> Candidate {
    let (x, y) = camera.ray(0.0, 0.0);
    let most = x.hypot(y);
    let (over, times) = (Coordinate::Along, Modulation::Tilt);
    Candidate::curve(Basis::Curve { over, low: -most, high: most, nodes: 9, times })
}

/// Periodic in depth: what a time-of-flight camera's harmonics do.
fn waves(reach: &Extent) -> impl Iterator<Item = Candidate> {
    let span = reach.z[1] - reach.z[0];
    (3..=16).map(move |cycles| {
        let period = span / f64::from(cycles);
        Candidate::curve(Basis::Ring {
            over: Coordinate::Z,
            period,
            nodes: 6,
            times: Modulation::One,
        })
    })
}
