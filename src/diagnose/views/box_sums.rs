//! Sums over boxes of an image, and what is left of it without their mean.

use crate::stats::SummedArea;

/// Side of the box whose mean is taken out, px: several windows, and less than a lens's bowl.
pub const SMOOTH_PX: usize = 49;

/// Sum and number of the finite pixels in any box.
pub fn box_sums(image: &[f32], width: usize, height: usize) -> SummedArea<2> {
    let pixel = |i: usize| Some(image[i]).filter(|r| r.is_finite()).map(|r| [f64::from(r), 1.0]);
    SummedArea::of(width, height, pixel)
}

/// Minus its mean over a box of `side` px, where at least a quarter of the box is there; NaN elsewhere.
pub fn high_pass(image: &[f32], width: usize, height: usize, side: usize) -> Vec<f32> {
    let sums = box_sums(image, width, height);
    let minus_mean = |i: usize| {
        let [sum, n] = sums.around(i % width, i / width, side / 2);
        if 4.0 * n < (side * side) as f64 { f32::NAN } else { image[i] - (sum / n) as f32 }
    };
    (0..width * height).map(minus_mean).collect()
}
