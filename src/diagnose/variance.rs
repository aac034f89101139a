//! What may change the size of the noise: candidates for the logarithm of the variance.

use super::candidate::Candidate;
use super::tiles::Place;
use crate::camera::Camera;

/// All named variance families.
pub fn families(sensible: &Sensible) -> Vec<Candidate> {
    let mut all = vec![
        Candidate::named("range-exponent", "z", 1, |p, g| g[0] = p.z.ln()),
        Candidate::named("vignetting", "radius", 2, |p, g| {
            let r2 = p.radius * p.radius;
            g[0] = r2;
            g[1] = r2 * r2;
        }),
    ];
    for lateral_px in [0.1, 0.2, 0.4, 0.8, 1.6] {
        let columns = move |p: &Place, g: &mut [f64]| {
            let slope2 = p.slope[0].powi(2) + p.slope[1].powi(2);
            g[0] = (lateral_px * lateral_px * slope2 / p.variance).ln_1p();
        };
        all.push(
            Candidate::named("slope-noise", "theta", 1, columns)
                .with("sigma_lateral_px", lateral_px),
        );
    }
    // Along the baseline against across it, fading as the tilt does.
    for power in [1, 2] {
        let columns = move |p: &Place, g: &mut [f64]| {
            g[0] = (2.0 * p.azimuth).cos() * p.theta.sin().powi(power);
        };
        all.push(
            Candidate::named("tilt-axis-anisotropy", "azimuth", 1, columns)
                .with("tilt_power", f64::from(power)),
        );
    }
    if sensible.light {
        all.push(Candidate::named("intensity-dependent-noise", "intensity", 1, |p, g| {
            g[0] = p.light.max(1e-3).ln();
        }));
    }
    if sensible.ambient {
        all.push(Candidate::named("ambient-light", "intensity", 1, |p, g| {
            g[0] = p.ambient.ln_1p();
        }));
    }
    all
}

/// What the recording brings beside depth.
#[derive(Debug, Clone, Copy, Default)]
pub struct Sensible {
    pub light: bool,
    pub ambient: bool,
}

/// Curves without a name, one axis each.
pub fn curves(camera: &Camera, reach: &super::bias::Reach) -> Vec<Candidate> {
    let (w, h) = (camera.width as f64, camera.height as f64);
    let one = |_: &Place| 1.0;
    let z = reach.z.map(f64::ln);
    vec![
        Candidate::curve("z", z, 8, |p| p.z.ln(), one),
        Candidate::curve("theta", reach.theta, 6, |p| p.theta, one),
        Candidate::ring("azimuth", 8, |p| p.azimuth / std::f64::consts::TAU),
        Candidate::curve("radius", [0.0, 1.0], 8, |p| p.radius, one),
        Candidate::curve("column", [0.0, w], 12, |p| p.u, one),
        Candidate::curve("row", [0.0, h], 12, |p| p.v, one),
        Candidate::ring("disparity-phase", 8, |p| p.disparity),
        Candidate::curve("session-time", reach.session, 6, |p| p.session_s, one),
        Candidate::curve("edge-distance", [0.0, 24.0], 6, |p| p.edge, one),
        Candidate::curve("intensity", reach.light, 6, |p| p.light, one),
        Candidate::map(w, h, 6, 4),
    ]
}
