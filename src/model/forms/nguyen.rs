//! Nguyen, Izadi and Lovell 2012: the paper's predecessor.

use super::paper::{parabola_start, vertex_gradient};
use super::{Card, MAX_PARAMETERS, SigmaForm, Start, Walk};
use crate::model::rows::Rows;

pub(super) struct Nguyen;

/// theta^2 / (pi/2 - theta)^2 / sqrt(z).
fn tilt(z: f64, theta: f64) -> f64 {
    super::tilt::tilt(theta, std::f64::consts::FRAC_PI_2) / z.sqrt()
}

impl SigmaForm for Nguyen {
    fn card(&self) -> &'static Card {
        &Card {
            id: "nguyen",
            formula: "sigma = a + b (z - c)^2 + d / sqrt(z) * theta^2 / (pi/2 - theta)^2 (m; z in m, theta in rad)",
            reference: "Nguyen, Izadi and Lovell, 3DIMPVT 2012; theirs: 0.0012, 0.0019, 0.4, 0.0001",
            parameters: &[
                ("a", Walk::Linear),
                ("b", Walk::Log),
                ("c", Walk::Linear),
                ("d", Walk::Log),
            ],
            distances_needed: 3,
        }
    }

    fn sigma(&self, p: &[f64], z: f64, theta: f64) -> f64 {
        p[0] + p[1] * (z - p[2]).powi(2) + p[3] * tilt(z, theta)
    }

    fn gradient(&self, p: &[f64], z: f64, theta: f64, out: &mut [f64; MAX_PARAMETERS]) {
        vertex_gradient(p, z, out);
        out[3] = tilt(z, theta);
    }

    fn vertex(&self, p: &[f64]) -> Option<f64> {
        Some(p[2])
    }

    fn pole(&self, _p: &[f64]) -> Option<f64> {
        Some(std::f64::consts::FRAC_PI_2)
    }

    fn start(&self, rows: &Rows) -> Option<Start> {
        parabola_start(rows, |r| tilt(r.z_m, r.theta_rad))
    }
}
