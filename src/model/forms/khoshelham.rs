//! sigma = k z^2: constant disparity noise, nothing else.

use super::{MAX_PARAMETERS, SigmaForm, Start, Walk};
use crate::model::rows::Rows;

#[derive(Debug)]
pub(super) struct Khoshelham;

impl SigmaForm for Khoshelham {
    fn id(&self) -> &'static str {
        "khoshelham"
    }

    fn formula(&self) -> &'static str {
        "sigma = k z^2 (m; z in m)"
    }

    fn reference(&self) -> &'static str {
        "Khoshelham and Elberink, Sensors 12 (2012); theirs: k = 1.425e-3 1/m"
    }

    fn parameters(&self) -> &'static [(&'static str, Walk)] {
        &[("k", Walk::Log)]
    }

    fn sigma(&self, p: &[f64], z: f64, _theta: f64) -> f64 {
        p[0] * z * z
    }

    fn gradient(&self, _p: &[f64], z: f64, _theta: f64, out: &mut [f64; MAX_PARAMETERS]) {
        out[0] = z * z;
    }

    fn start(&self, rows: &Rows) -> Option<Start> {
        let n = rows.len() as f64;
        let k = rows.iter().map(|r| r.sigma_m / (r.z_m * r.z_m)).sum::<f64>() / n;
        Some(Start { parameters: vec![k], held: vec![false], remarks: Vec::new() })
    }

    fn distances_needed(&self) -> usize {
        1
    }
}
