//! What may shift the mean: candidates in px of disparity.

use std::f64::consts::TAU;

use super::candidate::Candidate;
use super::tiles::Place;
use crate::camera::Camera;

/// Disparity at which a term that grows with a power of it is in px: a Kinect at 1.1 m.
pub const DISPARITY_UNIT_PX: f64 = 40.0;

/// Ranges over which the curves run.
#[derive(Debug, Clone, Copy)]
pub struct Reach {
    pub disparity: [f64; 2],
    pub right: [f64; 2],
    pub down: [f64; 2],
    pub edge: f64,
    pub z: [f64; 2],
    pub theta: [f64; 2],
    pub session: [f64; 2],
    pub light: [f64; 2],
}

/// All named bias families for a camera.
pub fn families(camera: &Camera, reach: &Reach) -> Vec<Candidate> {
    let mut all = Vec::new();
    radial(&mut all);
    all.push(lens(camera));
    all.push(Candidate::named("range-not-depth", "radius", 1, |p, g| {
        g[0] = p.disparity * (1.0 / (1.0 + p.x * p.x + p.y * p.y).sqrt() - 1.0);
    }));
    all.push(Candidate::named("target-bow", "target-position", 3, |p, g| {
        let lift = p.disparity / p.rho;
        g[0] = lift * p.right * p.right;
        g[1] = lift * p.down * p.down;
        g[2] = lift * p.right * p.down;
    }));
    locking(&mut all, reach);
    banding(&mut all, camera);
    edge_mixing(&mut all, reach);
    all
}

/// A bowl in disparity whose depth goes with a free power of the disparity.
fn radial(all: &mut Vec<Candidate>) {
    for power in [-1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0] {
        let columns = move |p: &Place, g: &mut [f64]| {
            let scale = (p.disparity / DISPARITY_UNIT_PX).powf(power);
            let r2 = p.radius * p.radius;
            let mut term = scale;
            for g in g {
                term *= r2;
                *g = term;
            }
        };
        all.push(
            Candidate::named("radial-disparity-bias", "radius", 4, columns)
                .with("disparity_power", power),
        );
    }
}

/// The ray is shifted along the radius: seen through the slope of the target only.
fn lens(camera: &Camera) -> Candidate {
    let (cx, cy) = (camera.cx, camera.cy);
    Candidate::named("lens-distortion", "radius", 2, move |p, g| {
        let r2 = p.x * p.x + p.y * p.y;
        let along = -(p.slope[0] * (p.u - cx) + p.slope[1] * (p.v - cy));
        g[0] = along * r2;
        g[1] = along * r2 * r2;
    })
}

/// Periodic in the disparity with a period of one pixel, give or take what focal length and
/// baseline are off.
fn locking(all: &mut Vec<Candidate>, reach: &Reach) {
    const OFF: f64 = 0.03;
    // A quarter of a cycle over the range of disparities.
    let step = 0.25 / (reach.disparity[1] - reach.disparity[0]).max(1.0);
    let half = ((OFF / step).ceil() as i64).clamp(1, 12);
    for k in -half..=half {
        let frequency = 1.0 + OFF * k as f64 / half as f64;
        let columns = move |p: &Place, g: &mut [f64]| {
            let (sin, cos) = (TAU * frequency * p.disparity).sin_cos();
            g[0] = sin;
            g[1] = cos;
            g[2] = 2.0 * sin * cos;
            g[3] = cos * cos - sin * sin;
        };
        all.push(
            Candidate::named("pixel-locking", "disparity-phase", 4, columns)
                .with("period_px", 1.0 / frequency),
        );
    }
}

/// Stripes down the picture: four harmonics of a free period.
fn banding(all: &mut Vec<Candidate>, camera: &Camera) {
    let width = camera.width as f64;
    for half_cycles in 4..=64 {
        let period = 2.0 * width / f64::from(half_cycles);
        let columns = move |p: &Place, g: &mut [f64]| {
            let (s, c) = (TAU * p.u / period).sin_cos();
            let (mut sk, mut ck) = (s, c);
            for pair in g.chunks_exact_mut(2) {
                pair[0] = sk;
                pair[1] = ck;
                (sk, ck) = (sk * c + ck * s, ck * c - sk * s);
            }
        };
        all.push(
            Candidate::named("column-banding", "column", 8, columns).with("period_px", period),
        );
    }
}

/// Towards what is behind, fading with the distance from the edge.
fn edge_mixing(all: &mut Vec<Candidate>, reach: &Reach) {
    for width in [1.0, 2.0, 4.0, 8.0] {
        if reach.edge < 4.0 * width {
            continue;
        }
        let columns = move |p: &Place, g: &mut [f64]| g[0] = (-p.edge / width).exp();
        all.push(
            Candidate::named("edge-mixing", "edge-distance", 1, columns).with("width_px", width),
        );
    }
}

/// Curves without a name, one axis each.
pub fn curves(camera: &Camera, reach: &Reach) -> Vec<Candidate> {
    let (w, h) = (camera.width as f64, camera.height as f64);
    let one = |_: &Place| 1.0;
    let by_disparity = |p: &Place| (p.disparity / DISPARITY_UNIT_PX).powi(2);
    vec![
        Candidate::curve("column", [0.0, w], 24, |p| p.u, one),
        Candidate::curve("row", [0.0, h], 24, |p| p.v, one),
        Candidate::curve("radius", [0.0, 1.0], 10, |p| p.radius, one),
        Candidate::curve("radius", [0.0, 1.0], 10, |p| p.radius, by_disparity),
        Candidate::curve("z", reach.disparity, 16, |p| p.disparity, one),
        Candidate::ring("disparity-phase", 12, |p| p.disparity),
        Candidate::curve("target-position", reach.right, 12, |p| p.right, |p| p.disparity / p.rho),
        Candidate::curve("target-position", reach.down, 12, |p| p.down, |p| p.disparity / p.rho),
        Candidate::curve("edge-distance", [0.0, 24.0], 9, |p| p.edge, one),
        Candidate::map(w, h, 8, 6),
    ]
}
