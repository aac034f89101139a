//! Constant disparity noise and a constant floor, added as variances.

use super::{Card, MAX_PARAMETERS, SigmaForm, Start, Walk};
use crate::model::rows::Rows;

pub(super) struct Disparity;

impl SigmaForm for Disparity {
    fn card(&self) -> &'static Card {
        &Card {
            id: "disparity",
            formula: "sigma^2 = s0^2 + (k z^2)^2 (m; z in m); k times fx * baseline is the disparity noise in px",
            reference: "z = fx b / d with constant noise in d, and a floor from rounding and the target",
            parameters: &[("k", Walk::Log), ("s0", Walk::Log)],
            distances_needed: 2,
        }
    }

    fn sigma(&self, p: &[f64], z: f64, _theta: f64) -> f64 {
        (p[0] * z * z).hypot(p[1])
    }

    fn gradient(&self, p: &[f64], z: f64, theta: f64, out: &mut [f64; MAX_PARAMETERS]) {
        let sigma = self.sigma(p, z, theta);
        out[0] = p[0] * z.powi(4) / sigma;
        out[1] = p[1] / sigma;
    }

    /// sigma^2 is linear in k^2 and s0^2.
    fn start(&self, rows: &Rows) -> Option<Start> {
        let squares = rows.solve_linear(2, |r, out| {
            // d(sigma) = d(sigma^2) / (2 sigma): both sides are divided by sigma so that the weights fit.
            let per = 1.0 / r.sigma_m;
            out[0] = r.z_m.powi(4) * per;
            out[1] = per;
        })?;
        let min_sigma = rows.iter().map(|r| r.sigma_m).fold(f64::INFINITY, f64::min);
        let largest = rows.iter().map(|r| r.sigma_m / (r.z_m * r.z_m)).fold(0.0, f64::max);
        let k = squares[0].max(0.0).sqrt().max(1e-3 * largest);
        let no_floor = squares[1] <= 0.0;
        let held = "no floor s0 shows in the data; it is held at a hundredth of the least sigma";
        Some(Start {
            parameters: vec![k, if no_floor { 1e-2 * min_sigma } else { squares[1].sqrt() }],
            held: vec![false, no_floor],
            remarks: no_floor.then(|| held.into()).into_iter().collect(),
        })
    }
}
