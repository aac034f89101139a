//! Candidates for the bias, px of disparity.

use super::candidate::Candidate;
use crate::camera::Camera;
use crate::effects::Bounds;
use crate::sensors::SensorKind;
use crate::terms::{Basis, Coordinate, Extent, Modulation, Statistic};

/// Biases of the catalogue and nameless curves.
pub fn candidates(bounds: &Bounds) -> Vec<Candidate> {
    let mut all = Candidate::of_catalogue(Statistic::Bias, bounds);
    all.extend(curves(bounds.camera, bounds.reach));
    let matches = bounds.kind.is_none_or(SensorKind::has_disparity);
    all.retain(|c| matches || !c.is_of_disparity());
    all
}

/// Nameless curves over one axis, and maps over two.
fn curves(camera: &Camera, reach: &Extent) -> Vec<Candidate> {
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
        Candidate::ring(Coordinate::Disparity, 1.0, 12),
        map(8, 6, Modulation::One),
        map(8, 6, Modulation::DisparitySquared),
    ];
    all.extend(seams(width, Coordinate::Column));
    all.extend(seams(height, Coordinate::Row));
    all.push(along(camera));
    all.extend(waves(reach));
    if reach.is_unevenly_lit() {
        all.push(curve(Coordinate::Light, reach.light, 8, Modulation::One));
    }
    all
}

/// Steps between two parts of the image, at evenly spaced places.
fn seams(length: f64, over: Coordinate) -> impl Iterator<Item = Candidate> {
    const PLACES: usize = 32;
    (2..PLACES - 1).map(move |k| Candidate::step(over, length * k as f64 / PLACES as f64, 2.0))
}

/// A curve along the direction of the tilt that vanishes without tilt.
fn along(camera: &Camera) -> Candidate {
    let (x, y) = camera.ray(0.0, 0.0);
    let most = x.hypot(y);
    let (over, times) = (Coordinate::Along, Modulation::Tilt);
    Candidate::curve(Basis::Curve { over, low: -most, high: most, nodes: 9, times })
}

/// Periodic curves in depth, as from the harmonics of a time-of-flight camera.
fn waves(reach: &Extent) -> impl Iterator<Item = Candidate> {
    let span = reach.z[1] - reach.z[0];
    (3..=16).map(move |cycles| Candidate::ring(Coordinate::Z, span / f64::from(cycles), 6))
}
