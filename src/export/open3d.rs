//! The distortion table of Open3D's `DepthNoiseSimulator` and of Redwood's simdepth.py.
//!
//! Layout: five skipped lines, then a number a line: for 80 x 80 blocks (8 x 6 px each, row by row) 23, three that
//! describe the bins, then counts, two sums and the factors of five bins of 2 m. The reader divides a true
//! depth by the factor, interpolated linearly between the bin centres at 1, 3, 5, 7 and 9 m
//! (cpp/open3d/t/io/ImageIO.cpp; <http://redwood-data.org/indoor/data/simdepth.py>).

use std::fmt::Write as _;

use super::Exported;
use super::tables::{Blocks, known, notes_of_bias};
use crate::correct::{Conditions, Correction};
use crate::error::{Error, Result};
use crate::model::NoiseModel;

const BLOCK: [usize; 2] = [8, 6];
const BLOCKS: usize = 80;
const BINS: usize = 5;
const BIN_M: f64 = 2.0;
/// Number of examples claimed for each bin; a block with fewer in every bin counts as never seen.
const EXAMPLES: f64 = 8000.0;
/// Iterations of the search for the stored depth; each shrinks the error by the bias's slope, a tenth.
const ROUNDS: usize = 12;

pub(super) fn write(model: &NoiseModel) -> Result<Exported> {
    let (sensor, correction) = known(model, "Open3D's table")?;
    let size = [sensor.camera.width, sensor.camera.height];
    if size[0] > BLOCKS * BLOCK[0] || size[1] > BLOCKS * BLOCK[1] {
        return Err(Error::Argument {
            what: format!(
                "Open3D's table is of 640 x 480 px, the model of {} x {}",
                size[0], size[1]
            ),
            remedy: "export to python, c, npz or clams, which hold any size",
        });
    }
    let blocks = Blocks { size, block: BLOCK };
    let [across, down] = blocks.count();
    let bins: Vec<Vec<f64>> = (0..BINS)
        .map(|bin| factors(&correction, &blocks, (bin as f64 + 0.5) * BIN_M))
        .collect::<Result<_>>()?;
    let mut text = String::from(
        "% A distortion model for Open3D's DepthNoiseSimulator, written by kinoise\n\
         % max_dist num_bins bin_depth counts[5] numerators[5] denominators[5] multipliers[5]\n\
         % 23 numbers a block of 8 x 6 px, row by row, a number a line\n%\n%\n",
    );
    for y in 0..BLOCKS {
        for x in 0..BLOCKS {
            let inside = x < across && y < down;
            let of = |bin: &Vec<f64>| if inside { bin[y * across + x] } else { 1.0 };
            let factors: Vec<f64> = bins.iter().map(of).collect();
            let examples = vec![EXAMPLES; BINS];
            // Sums over examples of truth squared and of truth times measurement: only their ratio matters.
            let sums = factors.iter().map(|f| EXAMPLES * f).collect();
            let _ = writeln!(text, "10\n{BINS}\n{BIN_M}");
            for number in [examples.clone(), sums, examples, factors].concat() {
                let _ = writeln!(text, "{}", number as f32);
            }
        }
    }
    let mut notes = notes_of_bias(&correction);
    notes.push("the file holds the bias alone: Open3D's noise and steps are its own constants (1/8 px, 35.13 px m)".into());
    Ok(Exported { bytes: text.into_bytes(), notes })
}

/// Ratio of true to stored depth of frontal surfaces at a true depth, by block.
fn factors(correction: &Correction, blocks: &Blocks, true_m: f64) -> Result<Vec<f64>> {
    let pixels = blocks.size[0] * blocks.size[1];
    let mut stored = vec![true_m; pixels];
    for _ in 0..ROUNDS {
        let picture: Vec<f32> = stored.iter().map(|z| *z as f32).collect();
        let corrected = correction.corrected(&picture, &Conditions::default())?;
        for (stored, corrected) in stored.iter_mut().zip(corrected) {
            let next = *stored * true_m / corrected;
            *stored = if next.is_finite() && next > 0.0 { next } else { true_m };
        }
    }
    Ok(blocks.means(|i| true_m / stored[i]))
}
