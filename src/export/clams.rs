//! The table of CLAMS: factors on the stored depth, by block of pixels and distance.
//!
//! Layout: `DiscreteDepthDistortionModel::serialize` of Teichman, Miller and Thrun's code
//! (clams/src/discrete_depth_distortion_model.cpp, "v01"), numbers in machine byte order (little-endian),
//! vectors as `eigen_extensions::serialize` writes them.

use super::Exported;
use super::tables::{Blocks, known, multipliers, notes_of_bias};
use crate::error::Result;
use crate::model::NoiseModel;

/// Block size of CLAMS, px; smaller where it does not divide the image.
const BLOCK: [usize; 2] = [8, 6];
/// Largest distance of CLAMS, m.
const FARTHEST_M: f64 = 10.0;
/// Bin size, m: a tenth of CLAMS's own. CLAMS interpolates between the centres of its bins.
const BIN_M: f64 = 0.2;
const BINS: usize = 50;
/// Number of examples claimed for each bin; with fewer than 50, CLAMS does not interpolate.
const EXAMPLES: f32 = 1000.0;

pub(super) fn write(model: &NoiseModel) -> Result<Exported> {
    let (sensor, correction) = known(model, "a table of CLAMS")?;
    let size = [sensor.camera.width, sensor.camera.height];
    let divisor = |k: usize| (1..=BLOCK[k]).rev().find(|b| size[k] % b == 0).unwrap_or(1);
    let blocks = Blocks { size, block: [divisor(0), divisor(1)] };
    let middle = |bin: usize| (bin as f64 + 0.5) * BIN_M;
    let bins: Vec<Vec<f64>> = (0..BINS)
        .map(|bin| multipliers(&correction, &blocks, middle(bin)))
        .collect::<Result<_>>()?;

    let mut bytes = b"DiscreteDepthDistortionModel v01\n".to_vec();
    let [across, down] = blocks.count();
    for n in [size[0], size[1], blocks.block[0], blocks.block[1]] {
        bytes.extend((n as i32).to_le_bytes());
    }
    bytes.extend(BIN_M.to_le_bytes());
    bytes.extend([across, down].iter().flat_map(|n| (*n as i32).to_le_bytes()));
    let of_block = |block: usize| bins.iter().map(move |bin| bin[block] as f32);
    for factors in (0..across * down).map(of_block) {
        bytes.extend(FARTHEST_M.to_le_bytes());
        bytes.extend((BINS as i32).to_le_bytes());
        bytes.extend(BIN_M.to_le_bytes());
        // Sums over examples of truth squared and of truth times measurement: only their ratio matters.
        vector(&mut bytes, (0..BINS).map(|_| EXAMPLES));
        vector(&mut bytes, factors.clone().map(|f| EXAMPLES * f));
        vector(&mut bytes, (0..BINS).map(|_| EXAMPLES));
        vector(&mut bytes, factors);
    }
    let mut notes = notes_of_bias(&correction);
    notes.push("the file holds the bias alone: no noise, no intrinsics".into());
    Ok(Exported { bytes, notes })
}

/// Writes the bytes per number, rows, columns, then the numbers.
fn vector(bytes: &mut Vec<u8>, numbers: impl Iterator<Item = f32>) {
    let head = [size_of::<f32>() as i32, BINS as i32, 1];
    bytes.extend(head.iter().flat_map(|n| n.to_le_bytes()));
    numbers.for_each(|v| bytes.extend(v.to_le_bytes()));
}
