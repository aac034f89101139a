//! Symmetric systems, residuals of least-squares fits, and the argmin solvers that the fits use, each with
//! a limit on its steps.

mod cholesky;

pub use cholesky::Cholesky;

use std::cell::RefCell;
use std::marker::PhantomData;

use argmin::core::{CostFunction, Error as ArgminError, Executor, Gradient, Hessian, State};
use argmin::solver::brent::BrentOpt;
use argmin::solver::neldermead::NelderMead;
use argmin::solver::trustregion::{Steihaug, TrustRegion};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// A sum of squares: residuals and their Jacobian at a point.
pub trait LeastSquares {
    /// Residuals (n) and Jacobian (n x p); `None` outside the domain.
    fn linearise(&self, x: &DVector<f64>) -> Option<(DVector<f64>, DMatrix<f64>)>;
    /// Half the sum of squares; infinite outside the domain.
    fn cost(&self, x: &DVector<f64>) -> f64;
}

/// The best point a solver visited.
#[derive(Debug, Clone, PartialEq)]
pub struct Minimum {
    pub x: DVector<f64>,
    /// Half the sum of squares there.
    pub cost: f64,
}

/// Adapts a problem to argmin. Gradient and Hessian are requested one after the other at the same point and
/// share a linearisation, so the last one is cached.
struct AsArgmin<'a, P> {
    problem: &'a P,
    last: RefCell<Option<Linear>>,
}

struct Linear {
    at: DVector<f64>,
    gradient: DVector<f64>,
    hessian: DMatrix<f64>,
}

impl<P: LeastSquares> AsArgmin<'_, P> {
    /// Gradient J'r and Gauss-Newton Hessian J'J at a point.
    fn linear<T>(&self, at: &DVector<f64>, take: impl Fn(&Linear) -> T) -> T {
        let mut last = self.last.borrow_mut();
        if let Some(linear) = last.as_ref().filter(|l| l.at == *at) {
            return take(linear);
        }
        let n = at.len();
        let (gradient, hessian) = self.problem.linearise(at).map_or_else(
            || (DVector::zeros(n), DMatrix::identity(n, n)),
            |(r, j)| (j.tr_mul(&r), j.tr_mul(&j)),
        );
        take(last.insert(Linear { at: at.clone(), gradient, hessian }))
    }
}

impl<P: LeastSquares> CostFunction for AsArgmin<'_, P> {
    type Param = DVector<f64>;
    type Output = f64;
    fn cost(&self, x: &Self::Param) -> Result<f64, ArgminError> {
        Ok(finite_or_huge(self.problem.cost(x)))
    }
}

impl<P: LeastSquares> Gradient for AsArgmin<'_, P> {
    type Param = DVector<f64>;
    type Gradient = DVector<f64>;
    fn gradient(&self, x: &Self::Param) -> Result<DVector<f64>, ArgminError> {
        Ok(self.linear(x, |l| l.gradient.clone()))
    }
}

impl<P: LeastSquares> Hessian for AsArgmin<'_, P> {
    type Param = DVector<f64>;
    type Hessian = DMatrix<f64>;
    fn hessian(&self, x: &Self::Param) -> Result<DMatrix<f64>, ArgminError> {
        Ok(self.linear(x, |l| l.hessian.clone()))
    }
}

/// argmin's solvers compare costs, and NaN would pass every comparison.
fn finite_or_huge(cost: f64) -> f64 {
    if cost.is_finite() { cost } else { f64::MAX / 4.0 }
}

/// Minimises by a trust region with Steihaug's truncated conjugate gradients on the Gauss-Newton Hessian,
/// from a start that is already near: the only one of argmin's solvers that almost always converges on the
/// fit of sigma. Takes at most `max_steps` steps and returns the best point visited, which is the start
/// where the solver fails. `None` when the start is outside the domain.
pub fn trust_region<P: LeastSquares>(
    problem: &P,
    start: DVector<f64>,
    max_steps: u64,
) -> Option<Minimum> {
    let initial = problem.cost(&start);
    if !initial.is_finite() {
        return None;
    }
    let radius = (1e-2 * start.norm()).max(1e-3);
    let subproblem = Steihaug::new().with_max_iters(2 * start.len() as u64 + 4);
    let solver =
        TrustRegion::new(subproblem).with_radius(radius).ok()?.with_max_radius(1e6).ok()?;
    let run = Executor::new(AsArgmin { problem, last: RefCell::new(None) }, solver)
        .configure(|state| state.param(start.clone()).max_iters(max_steps).target_cost(0.0))
        .timer(false)
        .run();
    let Ok(result) = run else { return Some(Minimum { x: start, cost: initial }) };
    let state = result.state();
    Some(match state.get_best_param() {
        Some(best) if state.get_best_cost() <= initial => {
            Minimum { x: best.clone(), cost: state.get_best_cost() }
        }
        _ => Minimum { x: start, cost: initial },
    })
}

/// A function of a parameter `P`.
struct Plain<P, F>(F, PhantomData<P>);

impl<P, F: Fn(&P) -> f64> CostFunction for Plain<P, F> {
    type Param = P;
    type Output = f64;
    fn cost(&self, x: &P) -> Result<f64, ArgminError> {
        Ok(finite_or_huge((self.0)(x)))
    }
}

/// Minimum of a function of one variable within an interval, to the absolute `tolerance`, by Brent's
/// method; `None` where the interval is not valid.
pub fn brent(
    cost: impl Fn(f64) -> f64,
    [low, high]: [f64; 2],
    tolerance: f64,
    max_steps: u64,
) -> Option<f64> {
    let solver = BrentOpt::new(low, high).set_tolerance(f64::EPSILON.sqrt(), tolerance);
    let run = Executor::new(Plain(|x: &f64| cost(*x), PhantomData::<f64>), solver)
        .configure(|state| state.max_iters(max_steps))
        .timer(false)
        .run();
    run.ok()?.state().get_best_param().copied()
}

/// Minimises by Nelder-Mead, from a simplex at `start` with the given edge lengths.
pub fn nelder_mead(
    cost: impl Fn(&[f64]) -> f64,
    start: &[f64],
    edges: &[f64],
    max_steps: u64,
) -> Vec<f64> {
    let mut simplex = vec![start.to_vec()];
    for (i, edge) in edges.iter().enumerate() {
        let mut corner = start.to_vec();
        corner[i] += edge;
        simplex.push(corner);
    }
    let Ok(solver) = NelderMead::new(simplex).with_sd_tolerance(1e-9) else {
        return start.to_vec();
    };
    let run = Executor::new(Plain(|x: &Vec<f64>| cost(x), PhantomData::<Vec<f64>>), solver)
        .configure(|state| state.max_iters(max_steps))
        .timer(false)
        .run();
    run.ok().and_then(|r| r.state().get_best_param().cloned()).unwrap_or_else(|| start.to_vec())
}

/// Singular values below this share of the largest are rounding errors.
const TINY: f64 = 1e-6;

/// Residual of a response after a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Left {
    /// Sum of squares.
    pub squares: f64,
    /// Degrees of freedom: rows less the rank of the columns.
    pub free: f64,
}

/// Least squares by SVD, so that linearly dependent columns count once: the coefficients and the rank.
/// `None` where there is no decomposition.
pub fn fit_by_svd(x: &DMatrix<f64>, y: &DVector<f64>) -> Option<(DVector<f64>, usize)> {
    let svd = x.clone().svd(true, true);
    let tiny = TINY * svd.singular_values.max();
    let beta = svd.solve(y, tiny).ok()?;
    Some((beta, svd.rank(tiny)))
}

/// Residual of `y` after the fit of the columns of `x`; see [`fit_by_svd`].
pub fn left_by_fit(x: &DMatrix<f64>, y: &DVector<f64>) -> Option<Left> {
    let (beta, rank) = fit_by_svd(x, y)?;
    Some(Left { squares: (y - x * beta).norm_squared(), free: (y.len() - rank) as f64 })
}

/// Normal equations of the plane 1, x, y through (place, value, weight), skipping values not finite.
pub fn plane_equations(
    points: impl Iterator<Item = ([f64; 2], f64, f64)>,
) -> (Matrix3<f64>, Vector3<f64>) {
    let (mut a, mut b) = (Matrix3::zeros(), Vector3::zeros());
    for ([x, y], value, weight) in points.filter(|p| p.1.is_finite()) {
        let row = Vector3::new(1.0, x, y);
        a += weight * row * row.transpose();
        b += weight * value * row;
    }
    (a, b)
}

/// The three coefficients of [`plane_equations`], if determined.
pub fn plane_through(points: impl Iterator<Item = ([f64; 2], f64, f64)>) -> Option<Vector3<f64>> {
    let (a, b) = plane_equations(points);
    a.lu().solve(&b)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rosenbrock's valley as least squares: minimum 0 at (1, 1).
    struct Valley;

    impl LeastSquares for Valley {
        fn linearise(&self, x: &DVector<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
            let r = DVector::from_vec(vec![10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]]);
            let j = DMatrix::from_row_slice(2, 2, &[-20.0 * x[0], 10.0, -1.0, 0.0]);
            Some((r, j))
        }
        fn cost(&self, x: &DVector<f64>) -> f64 {
            self.linearise(x).map_or(f64::INFINITY, |(r, _)| 0.5 * r.norm_squared())
        }
    }

    #[test]
    fn trust_region_walks_the_valley() {
        let end = trust_region(&Valley, DVector::from_vec(vec![-1.2, 1.0]), 200).unwrap();
        assert!((end.x[0] - 1.0).abs() < 1e-6 && (end.x[1] - 1.0).abs() < 1e-6, "{end:?}");
    }

    #[test]
    fn nelder_mead_survives_nan() {
        let cost =
            |x: &[f64]| if x[0] < 0.0 { f64::NAN } else { (x[0] - 2.0).powi(2) + x[1].powi(2) };
        let x = nelder_mead(cost, &[0.5, 1.0], &[0.5, 0.5], 400);
        assert!((x[0] - 2.0).abs() < 1e-3 && x[1].abs() < 1e-3, "{x:?}");
    }

    /// A line through four points, and the same line with a redundant column.
    #[test]
    fn columns_that_say_the_same_count_once() {
        let y = DVector::from_row_slice(&[1.0, 3.0, 2.0, 4.6]);
        let line = DMatrix::from_fn(4, 2, |i, k| [1.0, i as f64][k]);
        let twice = DMatrix::from_fn(4, 3, |i, k| [1.0, i as f64, 2.0 * i as f64 - 1.0][k]);
        for x in [line, twice] {
            let left = left_by_fit(&x, &y).unwrap();
            assert_eq!(left.free, 2.0);
            approx::assert_relative_eq!(left.squares, expected(&y), max_relative = 1e-12);
        }
    }

    /// Total sum of squares less the part explained by the slope.
    fn expected(y: &DVector<f64>) -> f64 {
        let mean = y.mean();
        let x = |i: usize| i as f64 - 1.5;
        let xy: f64 = (0..4).map(|i| x(i) * (y[i] - mean)).sum();
        let xx: f64 = (0..4).map(|i| x(i) * x(i)).sum();
        y.iter().map(|v| (v - mean).powi(2)).sum::<f64>() - xy * xy / xx
    }
}
