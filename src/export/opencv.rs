//! OpenCV's FileStorage, as YAML: intrinsics, and tables of sigma and of the correction.

use super::Exported;
use super::expressions::number;
use super::program::listed;
use super::tables::{Blocks, SigmaTable, even, known, multipliers, notes_of_bias};
use crate::error::Result;
use crate::model::NoiseModel;

/// Block size of the correction, px: pixel by pixel the text would be long.
const BLOCK: [usize; 2] = [16, 16];
const DEPTHS: usize = 9;

pub(super) fn write(model: &NoiseModel) -> Result<Exported> {
    let (sensor, correction) = known(model, "a camera's FileStorage")?;
    let camera = &sensor.camera;
    let sigma = SigmaTable::of(model);
    let [near, far] = model.sigma.domain.z_m;
    let depths: Vec<f64> =
        even([1.0 / far, 1.0 / near], DEPTHS).iter().rev().map(|q| 1.0 / q).collect();
    let blocks = Blocks { size: [camera.width, camera.height], block: BLOCK };
    let mut factors = Vec::new();
    for &depth in &depths {
        factors.extend(multipliers(&correction, &blocks, depth)?);
    }
    let [across, down] = blocks.count();
    let pinhole = [camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0];
    let distortion = camera.distortion.unwrap_or_default();
    let (n, m) = (sigma.z_m.len(), sigma.theta_rad.len());
    let mut text =
        format!("%YAML:1.0\n---\nimage_width: {}\nimage_height: {}\n", camera.width, camera.height);
    if let Some(baseline) = sensor.baseline_m {
        text.push_str(&format!("baseline_m: {}\n", number(baseline)));
    }
    text.push_str(&matrix("camera_matrix", [3, 3], &pinhole));
    text.push_str(&matrix("distortion_coefficients", [1, 5], &distortion));
    text.push_str(&matrix("sigma_z_m", [1, n], &sigma.z_m));
    text.push_str(&matrix("sigma_theta_rad", [1, m], &sigma.theta_rad));
    text.push_str(&matrix("sigma_m", [n, m], &sigma.sigma_m));
    text.push_str(&format!("correction_block_px: [ {}, {} ]\n", BLOCK[0], BLOCK[1]));
    text.push_str(&format!("correction_blocks: [ {across}, {down} ]\n"));
    text.push_str(&matrix("correction_z_m", [1, DEPTHS], &depths));
    text.push_str(&matrix("correction_factor", [DEPTHS, across * down], &factors));
    let mut notes = notes_of_bias(&correction);
    if !correction.is_identity() {
        notes.push(format!(
            "the correction is a factor for blocks of {} x {} px, a row a depth: what changes within a block is not in it",
            BLOCK[0], BLOCK[1]
        ));
    }
    if !correction.variance.is_empty() {
        notes.push("what changes the noise beside depth and tilt is not in the table".into());
    }
    Ok(Exported { bytes: text.into_bytes(), notes })
}

fn matrix(name: &str, [rows, cols]: [usize; 2], data: &[f64]) -> String {
    // OpenCV requires continuation lines to be indented deeper than their key.
    let data = listed(data).replace("\n", "\n    ");
    format!(
        "{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {cols}\n   dt: d\n   data: [ {data} ]\n"
    )
}
