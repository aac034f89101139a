//! Cholesky factors for systems of some hundred unknowns.

use nalgebra::{DMatrix, DVector};

/// A = L L', blocked, so that nearly all work is in matrix products (Golub and Van Loan 2013, section
/// 4.2.9): several times as fast as column by column from a hundred unknowns on.
#[derive(Debug, Clone)]
pub struct Cholesky {
    /// The entries above the diagonal are meaningless.
    lower: DMatrix<f64>,
}

/// Columns of a panel.
const PANEL: usize = 48;

impl Cholesky {
    /// Factorises `a`; `None` where it is not positive definite. Only its lower triangle is read.
    pub fn of(mut a: DMatrix<f64>) -> Option<Self> {
        let n = a.nrows();
        for first in (0..n).step_by(PANEL) {
            let width = PANEL.min(n - first);
            let next = first + width;
            let corner = a.view((first, first), (width, width)).into_owned().cholesky()?.unpack();
            a.view_mut((first, first), (width, width)).copy_from(&corner);
            // Below the corner: X L' = A.
            let mut below = a.view((next, first), (n - next, width)).transpose();
            corner.solve_lower_triangular_mut(&mut below);
            let left = below.transpose();
            a.view_mut((next, first), (n - next, width)).copy_from(&left);
            for column in (next..n).step_by(PANEL) {
                let size = PANEL.min(n - column);
                let right = below.columns(column - next, size);
                let rest = left.rows(column - next, n - column);
                a.view_mut((column, column), (n - column, size)).gemm(-1.0, &rest, &right, 1.0);
            }
        }
        Some(Cholesky { lower: a })
    }

    /// The factor L.
    pub fn l(&self) -> DMatrix<f64> {
        self.lower.lower_triangle()
    }

    /// Solves A x = b.
    pub fn solve(&self, b: &DVector<f64>) -> DVector<f64> {
        let n = b.len();
        let x = self.solve_all(DMatrix::from_column_slice(n, 1, b.as_slice()));
        DVector::from_column_slice(x.as_slice())
    }

    /// Solves A x = b for every column of `b`.
    pub fn solve_all(&self, mut b: DMatrix<f64>) -> DMatrix<f64> {
        let (n, m) = b.shape();
        let corner = |first: usize, width| self.lower.view((first, first), (width, width));
        let below = |first: usize, width: usize| {
            self.lower.view((first + width, first), (n - first - width, width))
        };
        for first in (0..n).step_by(PANEL) {
            let width = PANEL.min(n - first);
            let mut mine = b.rows(first, width).into_owned();
            corner(first, width).solve_lower_triangular_mut(&mut mine);
            b.rows_mut(first, width).copy_from(&mine);
            let mut rest = b.rows_mut(first + width, n - first - width);
            rest.gemm(-1.0, &below(first, width), &mine, 1.0);
        }
        for first in (0..n).step_by(PANEL).rev() {
            let width = PANEL.min(n - first);
            let mut mine = b.rows(first, width).into_owned();
            let rest = b.view((first + width, 0), (n - first - width, m));
            mine.gemm(-1.0, &below(first, width).transpose(), &rest, 1.0);
            corner(first, width).tr_solve_lower_triangular_mut(&mut mine);
            b.rows_mut(first, width).copy_from(&mine);
        }
        b
    }

    pub fn inverse(&self) -> DMatrix<f64> {
        let n = self.lower.nrows();
        self.solve_all(DMatrix::identity(n, n))
    }
}

#[cfg(test)]
mod tests {
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::rng::Seed;

    fn definite(n: usize) -> DMatrix<f64> {
        let mut rng = Seed(7).stream("cholesky");
        let mut draw = || -> f64 { StandardNormal.sample(&mut rng) };
        let x = DMatrix::from_fn(n, n + 5, |_, _| draw());
        &x * x.transpose() + DMatrix::identity(n, n)
    }

    /// For sizes below a panel, at its edge, and over several.
    #[test]
    fn it_solves_what_it_was_made_of() {
        for n in [1, 7, PANEL, PANEL + 1, 3 * PANEL - 2] {
            let a = definite(n);
            let truth = DVector::from_fn(n, |i, _| (i as f64).sin());
            let factor = Cholesky::of(a.clone()).expect("positive definite");
            approx::assert_relative_eq!(factor.solve(&(&a * &truth)), truth, epsilon = 1e-8);
            let unit = DMatrix::identity(n, n);
            approx::assert_relative_eq!(&a * factor.inverse(), unit, epsilon = 1e-8);
            approx::assert_relative_eq!(factor.l() * factor.l().transpose(), a, epsilon = 1e-8);
        }
    }

    #[test]
    fn what_is_not_positive_definite_is_refused() {
        let mut a = definite(2 * PANEL);
        let at = PANEL + 3;
        a[(at, at)] = -1.0;
        assert!(Cholesky::of(a).is_none());
    }

    #[test]
    fn nothing_is_solved_by_nothing() {
        let factor = Cholesky::of(DMatrix::zeros(0, 0)).expect("no unknowns");
        assert_eq!(factor.solve(&DVector::zeros(0)).len(), 0);
    }
}
