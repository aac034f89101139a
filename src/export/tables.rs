//! A model as tables: sigma over depth and tilt, the correction over depth and the picture.

use super::program::correction_of;
use crate::correct::{Conditions, Correction};
use crate::error::{Error, Result};
use crate::model::{Domain, NoiseModel};
use crate::view::Sensor;

/// Nodes over depth and over tilt: linear interpolation reproduces Eq. 1 to a thousandth, except near its
/// pole.
const NODES: usize = 61;

/// Sigma at evenly spaced nodes; tilt varies fastest.
pub(super) struct SigmaTable {
    pub z_m: Vec<f64>,
    pub theta_rad: Vec<f64>,
    pub sigma_m: Vec<f64>,
}

impl SigmaTable {
    pub fn of(model: &NoiseModel) -> Self {
        let Domain { z_m, theta_rad } = model.sigma.domain;
        let (z_m, theta_rad) = (even(z_m, NODES), even(theta_rad, NODES));
        let at = |&z: &f64| theta_rad.iter().map(move |&t| (z, t)).collect::<Vec<_>>();
        let places = z_m.iter().flat_map(at);
        let sigma_m = places.map(|(z, t)| model.sigma.axial_sigma(z, t)).collect();
        SigmaTable { z_m, theta_rad, sigma_m }
    }
}

/// `nodes` evenly spaced numbers from `low` to `high`.
pub(super) fn even([low, high]: [f64; 2], nodes: usize) -> Vec<f64> {
    let last = (nodes - 1) as f64;
    let at = |k: usize| if k + 1 == nodes { high } else { low + (high - low) * k as f64 / last };
    (0..nodes).map(at).collect()
}

/// The sensor of a model with its correction; an error where the model has none.
pub(super) fn known(model: &NoiseModel, format: &str) -> Result<(Sensor, Correction)> {
    correction_of(model)?.ok_or_else(|| Error::Argument {
        what: format!("the model has no sensor, and {format} is about one"),
        remedy: "give a model that was made of a recording, with kinoise calibrate or diagnose",
    })
}

/// The corrected depth of every pixel of a picture that shows `depth_m` throughout, m.
pub(super) fn frontal(correction: &Correction, depth_m: f64) -> Result<Vec<f64>> {
    let picture = vec![depth_m as f32; correction.camera.pixels()];
    correction.corrected(&picture, &Conditions::default())
}

/// Notes on what tables of [`frontal`] leave out, where it matters.
pub(super) fn notes_of_bias(correction: &Correction) -> Vec<String> {
    let Correction { needs, drifts, .. } = correction;
    let mut notes = Vec::new();
    if correction.is_identity() {
        notes.push("the model holds no bias: the table corrects nothing".to_string());
    }
    if needs.slope {
        notes.push(
            "a bias that follows the surface's slope is in the table as of frontal surfaces".into(),
        );
    }
    if needs.session || needs.temperature || !drifts.is_empty() {
        notes.push("a bias that changes in the course of a session is in the table as at its begin, without a thermometer".into());
    }
    notes
}

/// Blocks of pixels a picture is divided into.
#[derive(Debug, Clone, Copy)]
pub(super) struct Blocks {
    /// Size of the picture and of a block, px.
    pub size: [usize; 2],
    pub block: [usize; 2],
}

impl Blocks {
    pub fn count(&self) -> [usize; 2] {
        [0, 1].map(|k| self.size[k].div_ceil(self.block[k]))
    }

    /// The mean of `of` over each block's pixels, row by row.
    pub fn means(&self, of: impl Fn(usize) -> f64) -> Vec<f64> {
        let [across, down] = self.count();
        let (mut sums, mut counts) = (vec![0.0; across * down], vec![0.0; across * down]);
        for v in 0..self.size[1] {
            for u in 0..self.size[0] {
                let b = v / self.block[1] * across + u / self.block[0];
                sums[b] += of(v * self.size[0] + u);
                counts[b] += 1.0;
            }
        }
        sums.iter().zip(counts).map(|(s, n)| s / n).collect()
    }
}

/// Ratio of true to stored depth of every block of a picture that shows `depth_m` throughout; 1 where the
/// biases leave no depth.
pub(super) fn multipliers(
    correction: &Correction,
    blocks: &Blocks,
    depth_m: f64,
) -> Result<Vec<f64>> {
    let corrected = frontal(correction, depth_m)?;
    let ratio = |i: usize| Some(corrected[i] / depth_m).filter(|r| r.is_finite()).unwrap_or(1.0);
    Ok(blocks.means(ratio))
}
