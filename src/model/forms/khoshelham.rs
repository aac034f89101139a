//! sigma = k z^2: constant disparity noise, nothing else.

use super::{Card, MAX_PARAMETERS, SigmaForm, Start, Walk};
use crate::model::rows::Rows;

pub(super) struct Khoshelham;

impl SigmaForm for Khoshelham {
    fn card(&self) -> &'static Card {
        &Card {
            id: "khoshelham",
            formula: "sigma = k z^2 (m; z in m)",
            reference: "Khoshelham and Elberink, Sensors 12 (2012); theirs: k = 1.425e-3 1/m",
            parameters: &[("k", Walk::Log)],
            distances_needed: 1,
        }
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
}
