//! Fits a step (where half is lost, and how gradually) by weighted least squares on shares. The foot of a
//! rise alone does not determine its width, so the width has a prior at its kind's typical value.

use nalgebra::{DMatrix, DVector};

use super::forms::{Allowed, allowed, errors};
use super::points::{Point, misfit};
use super::shapes::Step;
use crate::solve::{LeastSquares, trust_region};

/// A step with its standard errors.
#[derive(Debug, Clone, Copy)]
pub struct Fitted {
    pub step: Step,
    /// Standard errors of middle, width and share; `None` where unknown or not fitted.
    pub std_error: [Option<f64>; 3],
}

/// Decrease in chi-squared that a free share must bring: the 1 % level.
const WORTH: f64 = 6.6;

/// Parameters: middle, log width and, where the share is free, its logit.
struct Problem<'a> {
    points: &'a [Point],
    start: Step,
    base: f64,
    free_share: bool,
    /// Without it a few lost pixels at the end of the range fit the toe of a step anywhere.
    allowed: Option<&'a Allowed>,
}

impl Problem<'_> {
    fn step(&self, x: &DVector<f64>) -> Step {
        let share = if self.free_share { 1.0 / (1.0 + (-x[2]).exp()) } else { 1.0 };
        Step { middle: x[0], width: self.start.width.signum() * x[1].exp(), share, ..self.start }
    }

    /// Residuals of the points, and of the width from its typical value.
    fn residuals(&self, x: &DVector<f64>) -> DVector<f64> {
        let step = self.step(x);
        let of = |p: &Point| misfit(p, step.loss(p.x, self.base));
        let held = self.allowed.map(|a| a.untypical(step.width.abs()));
        let all: Vec<f64> = self.points.iter().map(of).chain(held).collect();
        DVector::from_vec(all)
    }

    fn start(&self) -> DVector<f64> {
        let mut x = vec![self.start.middle, self.start.width.abs().ln()];
        if self.free_share {
            x.push(1.0);
        }
        DVector::from_vec(x)
    }
}

impl LeastSquares for Problem<'_> {
    fn linearise(&self, x: &DVector<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let step = self.step(x);
        let admitted = self.allowed.is_none_or(|a| a.admits(&step));
        if !admitted || x.iter().any(|v| !v.is_finite()) {
            return None;
        }
        let width = step.width.abs();
        let r = self.residuals(x);
        let mut jacobian = DMatrix::zeros(r.len(), x.len());
        for j in 0..x.len() {
            let h = if j == 0 { 1e-3 * width } else { 1e-4 };
            let mut moved = x.clone();
            moved[j] += h;
            jacobian.set_column(j, &((self.residuals(&moved) - &r) / h));
        }
        Some((r, jacobian))
    }

    fn cost(&self, x: &DVector<f64>) -> f64 {
        self.linearise(x).map_or(f64::INFINITY, |(r, _)| 0.5 * r.norm_squared())
    }
}

/// Refines a step found on the grid.
pub fn fit(start: Step, base: f64, points: &[Point]) -> Option<Fitted> {
    let allowed = allowed(&start);
    let solve = |free_share: bool| {
        let problem = Problem { points, start, base, free_share, allowed: allowed.as_ref() };
        let end = trust_region(&problem, problem.start(), 100)?;
        Some((problem, end))
    };
    let (whole, end) = solve(false)?;
    let partial = solve(true).filter(|(_, free)| 2.0 * (end.cost - free.cost) > WORTH);
    let (problem, end) = partial.unwrap_or((whole, end));
    let (r, jacobian) = problem.linearise(&end.x)?;
    let freedom = (r.len() - end.x.len().min(r.len() - 1)) as f64;
    let scale = (r.norm_squared() / freedom).max(1.0);
    let step = problem.step(&end.x);
    let of_share = || {
        let covariance = (jacobian.transpose() * &jacobian).try_inverse()? * scale;
        Some(covariance[(2, 2)].max(0.0).sqrt() * step.share * (1.0 - step.share))
    };
    let share = problem.free_share.then(|| of_share().unwrap_or(f64::INFINITY));
    let [middle, width] = errors(&step, base, points, scale).map_or([None; 2], |e| e.map(Some));
    Some(Fitted { step, std_error: [middle, width, share] })
}
