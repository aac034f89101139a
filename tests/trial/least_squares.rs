//! Weighted least squares of an affine function of three columns, such as (x, y, 1).

use nalgebra::{Matrix3, Vector3};

/// Sums over rows; memory does not grow with them.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct NormalEquations {
    normal: Matrix3<f64>,
    right: Vector3<f64>,
}

impl NormalEquations {
    /// One row: its columns, the value to be explained, and its weight, 1 over a variance.
    pub fn add(&mut self, row: &Vector3<f64>, value: f64, weight: f64) {
        self.normal += weight * row * row.transpose();
        self.right += weight * value * row;
    }

    /// The coefficients; `None` where the rows do not determine them.
    pub fn solve(&self) -> Option<Vector3<f64>> {
        self.normal.cholesky().map(|c| c.solve(&self.right))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_plane_of_weighted_rows_and_nothing_where_they_lie_on_a_line() {
        let truth = Vector3::new(0.5, -2.0, 3.0);
        let mut sums = NormalEquations::default();
        for (x, y, weight) in [(0.0, 0.0, 1.0), (1.0, 0.0, 4.0), (0.0, 1.0, 0.5), (2.0, 3.0, 2.0)] {
            let row = Vector3::new(x, y, 1.0);
            sums.add(&row, truth.dot(&row), weight);
        }
        assert!((sums.solve().expect("a plane") - truth).norm() < 1e-12);
        let mut line = NormalEquations::default();
        for x in [0.0, 1.0, 2.0] {
            line.add(&Vector3::new(x, 0.0, 1.0), x, 1.0);
        }
        assert_eq!(line.solve(), None);
    }
}
