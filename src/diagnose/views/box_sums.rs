//! Box sums of an image, and its residual about the box mean or about a cubic.

use nalgebra::{SMatrix, SVector};

use crate::stats::{MAD_TO_SIGMA, coprime, median_in_place, range};

/// Side of the box whose mean is subtracted, px: several matching windows, and less than a lens's bowl.
pub const SMOOTH_PX: usize = 49;

/// Calls `tell` for every finite pixel with the sum and number of the finite pixels within `reach` of it
/// along either axis. Uses running sums down the columns, and of these along the row.
pub fn over_boxes(image: &[f32], width: usize, reach: usize, tell: impl FnMut(usize, f64, f64)) {
    over_boxes_within(image, width, reach, f32::MAX, tell);
}

/// Same, with values larger than `limit` left out of the sums.
fn over_boxes_within(
    image: &[f32],
    width: usize,
    reach: usize,
    limit: f32,
    mut tell: impl FnMut(usize, f64, f64),
) {
    let add = |to: &mut [f64; 2], [sum, n]: [f64; 2], sign: f64| {
        to[0] += sign * sum;
        to[1] += sign * n;
    };
    let change = |columns: &mut [[f64; 2]], row: &[f32], sign: f64| {
        for (column, r) in columns.iter_mut().zip(row) {
            let pixel = if r.abs() <= limit { [f64::from(*r), 1.0] } else { [0.0; 2] };
            add(column, pixel, sign);
        }
    };
    let rows: Vec<&[f32]> = image.chunks_exact(width.max(1)).collect();
    let mut columns = vec![[0.0; 2]; width];
    for (v, row) in rows.iter().enumerate() {
        let entering = if v == 0 { 0..reach + 1 } else { v + reach..v + reach + 1 };
        entering.filter_map(|e| rows.get(e)).for_each(|e| change(&mut columns, e, 1.0));
        if v > reach {
            change(&mut columns, rows[v - reach - 1], -1.0);
        }
        let Some(first) = row.iter().position(|r| r.is_finite()) else { continue };
        let mut whole = [0.0; 2];
        for column in &columns[first.saturating_sub(reach)..(first + reach).min(width)] {
            add(&mut whole, *column, 1.0);
        }
        for (u, r) in row.iter().enumerate().skip(first) {
            if let Some(column) = columns.get(u + reach) {
                add(&mut whole, *column, 1.0);
            }
            if u > first && u > reach {
                add(&mut whole, columns[u - reach - 1], -1.0);
            }
            if r.is_finite() {
                tell(v * width + u, whole[0], whole[1]);
            }
        }
    }
}

/// Subtracts the mean over a box of `side` px where at least a quarter of the box is finite; NaN elsewhere.
/// Gross errors are left out of the means: a few at a target's rim would shift all their neighbours.
pub fn high_pass(image: &[f32], width: usize, side: usize) -> Vec<f32> {
    let mut left = vec![f32::NAN; image.len()];
    let limit = gross_limit(image);
    over_boxes_within(image, width, side / 2, limit, |i, sum, n| {
        if 4.0 * n >= (side * side) as f64 {
            left[i] = image[i] - (sum / n) as f32;
        }
    });
    left
}

/// Pixels used to fit the ten coefficients of a cubic; the fit adds 1 / 200 of the noise's variance.
const FITTED: usize = 2000;

/// Subtracts the best-fitting cubic in column and row from `values`, one per pixel of `pixels`.
pub fn take_out_cubic(values: &mut [f32], pixels: &[u32], width: usize) {
    let at = |i: u32| [i as usize % width, i as usize / width].map(|at| at as f64);
    let ranges = [0, 1].map(|k| range(pixels.iter().map(|&i| at(i)[k])));
    let columns = |i: u32| {
        let place = at(i);
        let [x, y] = [0, 1].map(|k| {
            let [low, high] = ranges[k];
            (2.0 * place[k] - low - high) / (high - low).max(1.0)
        });
        let (xx, xy, yy) = (x * x, x * y, y * y);
        SVector::from([1.0, x, y, xx, xy, yy, xx * x, xx * y, x * yy, y * yy])
    };
    let limit = gross_limit(values);
    let (mut normal, mut cross) = (SMatrix::<f64, 10, 10>::zeros(), SVector::<f64, 10>::zeros());
    let stride = coprime((pixels.len() / FITTED).max(1), width);
    for (&i, r) in pixels.iter().zip(&*values).step_by(stride) {
        if r.abs() <= limit {
            let columns = columns(i);
            normal += columns * columns.transpose();
            cross += columns * f64::from(*r);
        }
    }
    let Some(cubic) = normal.cholesky().map(|c| c.solve(&cross)) else { return };
    for (&i, r) in pixels.iter().zip(values) {
        *r -= columns(i).dot(&cubic) as f32;
    }
}

/// Squared correlation, summed over all lags, of white pixels averaged over squares.
pub fn repeats_of_box(side: f64) -> f64 {
    ((2.0 * side * side + 1.0) / (3.0 * side)).powi(2)
}

/// Gross-error limit: six robust standard deviations about zero. No limit (`f32::MAX`) where most values are
/// exactly zero.
pub fn gross_limit(image: &[f32]) -> f32 {
    let mut sizes: Vec<f32> = image.iter().filter(|r| r.is_finite()).map(|r| r.abs()).collect();
    let limit = 6.0 * MAD_TO_SIGMA as f32 * median_in_place(&mut sizes);
    if limit > 0.0 { limit } else { f32::MAX }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::SummedArea;

    /// A block that sees something else keeps its values, and so do its neighbours.
    #[test]
    fn gross_errors_lift_no_neighbours() {
        const SIDE: usize = 60;
        let block = |i: usize| (20..28).contains(&(i % SIDE)) && (20..28).contains(&(i / SIDE));
        let image: Vec<f32> = (0..SIDE * SIDE)
            .map(|i| if block(i) { 50.0 } else { (1.7 * i as f32).sin() })
            .collect();
        let left = high_pass(&image, SIDE, 21);
        for (i, (left, r)) in left.iter().zip(&image).enumerate() {
            assert!((left - r).abs() < 0.2, "{i}: {left} of {r}");
        }
    }

    /// Against a summed-area table, on an image with holes, empty rows and a wide empty rim.
    #[test]
    fn boxes_sum_what_lies_in_them() {
        let (width, height) = (37, 29);
        let image: Vec<f32> = (0..width * height)
            .map(|i| {
                let (u, v) = (i % width, i / width);
                let hole = u < 4 || v < 3 || v % 11 == 7 || (3 * u + 5 * v) % 17 == 0;
                if hole { f32::NAN } else { (1.7 * i as f32).sin() }
            })
            .collect();
        let pixel =
            |i: usize| Some(image[i]).filter(|r| r.is_finite()).map(|r| [f64::from(r), 1.0]);
        let table = SummedArea::of(width, height, pixel);
        for reach in [0, 1, 4, 12, 40] {
            let mut told = 0;
            over_boxes(&image, width, reach, |i, sum, n| {
                let truth = table.around(i % width, i / width, reach);
                assert!((sum - truth[0]).abs() < 1e-12 && n == truth[1], "{i} {reach}");
                told += 1;
            });
            assert_eq!(told, image.iter().filter(|r| r.is_finite()).count());
        }
    }
}
