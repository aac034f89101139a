//! Weighted least squares of an affine function of three columns, such as (x, y, 1).

use nalgebra::{Matrix3, Vector3};

/// Sums over rows; memory does not grow with them.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct NormalEquations {
    normal: Matrix3<f64>,
    right: Vector3<f64>,
    /// Weighted sum of squares of the values.
    squares: f64,
}

impl NormalEquations {
    /// One row: its columns, the value to be explained, and its weight, 1 over a variance.
    pub fn add(&mut self, row: &Vector3<f64>, value: f64, weight: f64) {
        self.normal += weight * row * row.transpose();
        self.right += weight * value * row;
        self.squares += weight * value * value;
    }

    /// The coefficients; `None` where the rows do not determine them.
    pub fn solve(&self) -> Option<Vector3<f64>> {
        self.normal.cholesky().map(|c| c.solve(&self.right))
    }

    /// Sum of squares that the fit leaves, not below zero; nothing where nothing is determined.
    pub fn left(&self) -> f64 {
        let taken = self.solve().map_or(self.squares, |q| self.right.dot(&q));
        (self.squares - taken).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: values on a plane, off by 1 at the corners of a square and by -4 m in its middle,
    /// which weighs 1/m. The weighted offsets vanish in all three sums, so no plane takes them up.
    #[test]
    fn what_is_beside_the_plane_is_left() {
        let plane = Vector3::new(0.5, -2.0, 3.0);
        for m in [1.0, 2.0] {
            let mut sums = NormalEquations::default();
            let mut add = |x: f64, y: f64, off: f64, weight: f64| {
                let row = Vector3::new(x, y, 1.0);
                sums.add(&row, plane.dot(&row) + off, weight);
            };
            for (x, y) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
                add(x, y, 1.0, 1.0);
            }
            add(0.0, 0.0, -4.0 * m, 1.0 / m);
            approx::assert_relative_eq!(sums.solve().unwrap(), plane, epsilon = 1e-12);
            approx::assert_relative_eq!(sums.left(), 4.0 + 16.0 * m, epsilon = 1e-12);
        }
    }

    #[test]
    fn a_line_of_points_determines_no_plane() {
        let mut sums = NormalEquations::default();
        for x in [-1.0, 0.0, 1.0] {
            sums.add(&Vector3::new(x, 0.0, 1.0), x, 1.0);
        }
        assert_eq!((sums.solve(), sums.left()), (None, 0.0));
    }
}
