//! What a least-squares fit leaves, where columns may say the same.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// Singular values below this share of the greatest are rounding.
const TINY: f64 = 1e-6;

/// What is left of a response.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Left {
    /// Sum of squares.
    pub squares: f64,
    /// Degrees of freedom: rows less what the columns determine.
    pub free: f64,
}

/// What the columns of `x` do not explain of `y`; by SVD, so that columns which say the same count
/// once. `None` where there is no decomposition.
pub fn left_by_fit(x: DMatrix<f64>, y: &DVector<f64>) -> Option<Left> {
    let svd = x.clone().svd(true, true);
    let tiny = TINY * svd.singular_values.max();
    let beta = svd.solve(y, tiny).ok()?;
    let free = (y.len() - svd.rank(tiny)) as f64;
    Some(Left { squares: (y - x * beta).norm_squared(), free })
}

/// The plane 1, x, y through values of some weight, as they come: its three coefficients.
pub fn plane_through(points: impl Iterator<Item = ([f64; 2], f64, f64)>) -> Option<Vector3<f64>> {
    let (mut a, mut b) = (Matrix3::zeros(), Vector3::zeros());
    for ([x, y], value, weight) in points.filter(|p| p.1.is_finite()) {
        let row = Vector3::new(1.0, x, y);
        a += weight * row * row.transpose();
        b += weight * value * row;
    }
    a.lu().solve(&b)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A line through four points, and the same line with a column too many.
    #[test]
    fn columns_that_say_the_same_count_once() {
        let y = DVector::from_row_slice(&[1.0, 3.0, 2.0, 4.6]);
        let line = DMatrix::from_fn(4, 2, |i, k| [1.0, i as f64][k]);
        let twice = DMatrix::from_fn(4, 3, |i, k| [1.0, i as f64, 2.0 * i as f64 - 1.0][k]);
        for x in [line, twice] {
            let left = left_by_fit(x, &y).unwrap();
            assert_eq!(left.free, 2.0);
            approx::assert_relative_eq!(left.squares, expected(&y), max_relative = 1e-12);
        }
    }

    /// Total sum of squares less the slope's share.
    fn expected(y: &DVector<f64>) -> f64 {
        let mean = y.mean();
        let x = |i: usize| i as f64 - 1.5;
        let xy: f64 = (0..4).map(|i| x(i) * (y[i] - mean)).sum();
        let xx: f64 = (0..4).map(|i| x(i) * x(i)).sum();
        y.iter().map(|v| (v - mean).powi(2)).sum::<f64>() - xy * xy / xx
    }
}
