//! Constant disparity noise and a constant floor, added as variances.

use super::{MAX_PARAMETERS, SigmaForm, Start, Walk};
use crate::model::rows::Rows;

#[derive(Debug)]
pub(super) struct Disparity;

impl SigmaForm for Disparity {
    fn id(&self) -> &'static str {
        "disparity"
    }

    fn formula(&self) -> &'static str {
        "sigma^2 = s0^2 + (k z^2)^2 (m; z in m); k times fx * baseline is the disparity noise in px"
    }

    fn reference(&self) -> &'static str {
        "z = fx b / d with constant noise in d, and a floor from rounding and the target"
    }

    fn parameters(&self) -> &'static [(&'static str, Walk)] {
        &[("k", Walk::Log), ("s0", Walk::Log)]
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
            // d(sigma) = d(sigma^2) / (2 sigma): both sides are divided so that the weights fit.
            let per = 1.0 / r.sigma_m;
            out[0] = r.z_m.powi(4) * per;
            out[1] = per;
        })?;
        let least = rows.iter().map(|r| r.sigma_m).fold(f64::INFINITY, f64::min);
        let largest = rows.iter().map(|r| r.sigma_m / (r.z_m * r.z_m)).fold(0.0, f64::max);
        let k = squares[0].max(0.0).sqrt().max(1e-3 * largest);
        if squares[1] <= 0.0 {
            return Some(Start {
                parameters: vec![k, 1e-2 * least],
                held: vec![false, true],
                remarks: vec![
                    "no floor s0 shows in the data; it is held at a hundredth of the least sigma"
                        .into(),
                ],
            });
        }
        Some(Start {
            parameters: vec![k, squares[1].sqrt()],
            held: vec![false; 2],
            remarks: Vec::new(),
        })
    }

    fn distances_needed(&self) -> usize {
        2
    }
}
