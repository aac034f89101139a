//! Fits a form of sigma(z, theta) to a table.
//!
//! Residuals are relative to the model, (s_i - sigma_i)/sigma_i, and the weights follow the
//! model, so the estimate solves sum_i J_i' C^-1 (s_i - sigma_i) = 0 (quasi-likelihood with
//! constant coefficient of variation). The start comes from the data alone; the user gives none.

use nalgebra::{DMatrix, DVector};

use super::forms::{Form, SigmaForm, Walk, natural_jacobian};
use super::rows::Rows;
use super::statistics::{SigmaFit, report};
use super::surface::Domain;
use crate::error::{Error, Result};
use crate::measure::{SigmaRow, SigmaTable};
use crate::solve::{LeastSquares, trust_region};
use crate::units::{counted, verb};

/// Distances within this ratio count as one.
pub const DISTANCE_RATIO: f64 = 1.05;
const MAX_ROUNDS: usize = 60;
/// Largest change of ln sigma over the table at which the weights have converged.
const SETTLED: f64 = 1e-10;

/// Fits `form` to every row of `table`. Fails when it has too few rows or distances for the form, or the
/// solver finds no surface that is positive over their range.
pub fn fit_all(table: &SigmaTable, form: Form) -> Result<SigmaFit> {
    let spec = form.spec();
    let mut rows = Rows::new(table);
    enough(&rows, spec)?;
    let no_start = || {
        let (n, [low, high]) = (table.rows.len(), table.range(|r| r.z_m));
        Error::NotEnough {
            what: format!(
                "the form \"{form}\" cannot be fitted to these {n} sigmas, measured from {low:.2} to {high:.2} m"
            ),
            remedy: "add views at other distances and tilts, or choose --form khoshelham".into(),
        }
    };
    let first = spec.start(&rows).ok_or_else(no_start)?;
    rows.refer_to(|r| positive(spec.sigma(&first.parameters, r.z_m, r.theta_rad), r.sigma_m));
    rows.estimate_extra(first.held.iter().filter(|held| !**held).count());
    let start = spec.start(&rows).ok_or_else(no_start)?;
    let free = (0..start.held.len()).filter(|&i| !start.held[i]).collect();
    let mut fit = Fit { rows, spec, p: start.parameters, free, remarks: start.remarks };
    let (mut rounds, mut converged) = (0, false);
    while rounds < MAX_ROUNDS && !converged {
        rounds += 1;
        converged = fit.round() < SETTLED && !fit.hold_positive();
    }
    if !fit.positive_in_range() {
        return Err(Error::Solver {
            what: format!("the form \"{form}\" is not positive over the range of the data"),
            remedy: "look for outlying views in measurements.csv, or choose another --form",
        });
    }
    let Fit { mut rows, p, free, remarks, .. } = fit;
    rows.refer_to(|r| spec.sigma(&p, r.z_m, r.theta_rad));
    Ok(report(form, &rows, p, &free, remarks, rounds, converged))
}

/// A fit in progress.
struct Fit<'a> {
    rows: Rows,
    spec: &'a dyn SigmaForm,
    p: Vec<f64>,
    /// Indices of the parameters that are not held.
    free: Vec<usize>,
    remarks: Vec<String>,
}

/// Floor of a surface inside its range, as a share of the least measured sigma: between two distances a
/// parabola can dip lower than any sensor's noise.
const MIN_SHARE: f64 = 0.1;

impl Fit<'_> {
    /// Weights by the surface and fits again; returns the largest change of ln sigma over the table.
    fn round(&mut self) -> f64 {
        let Fit { rows, spec, p, free, .. } = self;
        rows.refer_to(|r| positive(spec.sigma(p, r.z_m, r.theta_rad), r.sigma_m));
        rows.estimate_extra(free.len());
        *p = polish(rows, *spec, p, free);
        self.hold_strays();
        let (spec, p) = (self.spec, &self.p);
        let change = |(r, s): (&SigmaRow, &f64)| (spec.sigma(p, r.z_m, r.theta_rad) / s).ln().abs();
        self.rows.iter().zip(self.rows.reference()).map(change).fold(0.0, f64::max)
    }

    /// Holds free parameters that left their plausible range at its edge.
    fn hold_strays(&mut self) {
        let Fit { rows, spec, p, free, remarks } = self;
        free.retain(|&i| match spec.limits(i, rows) {
            Some([low, high]) if !(low..=high).contains(&p[i]) => {
                p[i] = if p[i] > high { high } else { low };
                let name = spec.card().parameters[i].0;
                remarks.push(format!(
                    "{name} runs out of what is believed and is held at {:.3}",
                    p[i]
                ));
                false
            }
            _ => true,
        });
    }

    /// Where the surface is least inside its range: at the vertex or the end of z next to it, and at the
    /// least tilt, because no form's tilt term is negative.
    fn min_point(&self) -> Option<(f64, f64)> {
        let domain = Domain::of(&self.rows, self.spec.pole(&self.p));
        self.spec.vertex(&self.p).map(|c| domain.clamp(c, 0.0))
    }

    /// Lifts a surface that dips below the floor ([`MIN_SHARE`]) and holds its first parameter. Returns
    /// whether it did: the others must then be fitted again.
    fn hold_positive(&mut self) -> bool {
        let Some((z, theta)) = self.min_point() else { return false };
        let floor = MIN_SHARE * self.rows.range(|r| r.sigma_m)[0];
        let sigma = self.spec.sigma(&self.p, z, theta);
        let is_free = self.free.contains(&0);
        // Once lifted, a dip to half the floor is accepted: the surface is still positive.
        if sigma >= if is_free { floor } else { 0.5 * floor } {
            return false;
        }
        self.p[0] += floor - sigma;
        if is_free {
            self.free.retain(|&i| i != 0);
            self.remarks.push(format!(
                "a is held: fitted freely the surface falls to {:.2} mm at {z:.2} m; record views near that distance",
                1e3 * sigma
            ));
        }
        true
    }

    fn positive_in_range(&self) -> bool {
        let good = |(z, theta): (f64, f64)| {
            let sigma = self.spec.sigma(&self.p, z, theta);
            sigma.is_finite() && sigma > 0.0
        };
        self.rows.iter().all(|r| good((r.z_m, r.theta_rad))) && self.min_point().is_none_or(good)
    }
}

fn positive(sigma: f64, otherwise: f64) -> f64 {
    if sigma > 1e-3 * otherwise && sigma.is_finite() { sigma } else { otherwise }
}

fn enough(rows: &Rows, spec: &dyn SigmaForm) -> Result<()> {
    let parameters = spec.card().parameters.len();
    let free_at_least = parameters.min(4);
    if rows.len() < free_at_least {
        return Err(Error::NotEnough {
            what: format!(
                "{} {} too few for the form \"{}\"",
                counted(rows.len(), "measured sigma"),
                verb(rows.len(), "is", "are"),
                spec.card().id
            ),
            remedy: format!("give at least {free_at_least}, better {}", 3 * parameters),
        });
    }
    let distances = rows.distances(DISTANCE_RATIO);
    let needed = spec.card().distances_needed;
    if distances < needed {
        return Err(Error::NotEnough {
            what: format!(
                "the views stand at {distances} different distance{} and the form \"{}\" needs {needed}",
                if distances == 1 { "" } else { "s" },
                spec.card().id
            ),
            remedy: "record views at other distances, or choose --form khoshelham, which needs one"
                .into(),
        });
    }
    Ok(())
}

/// The local problem: fixed weights, and scaled working coordinates of the free parameters.
struct Local<'a> {
    rows: &'a Rows,
    spec: &'a dyn SigmaForm,
    base: &'a [f64],
    free: &'a [usize],
    /// Working coordinate = scale * (transformed parameter), so that columns of J have unit length.
    scale: Vec<f64>,
    target: DVector<f64>,
}

impl Local<'_> {
    fn walk(&self, i: usize) -> Walk {
        self.spec.card().parameters[i].1
    }

    fn to_working(&self, p: &[f64]) -> DVector<f64> {
        DVector::from_iterator(
            self.free.len(),
            self.free.iter().zip(&self.scale).map(|(&i, s)| {
                s * match self.walk(i) {
                    Walk::Linear => p[i],
                    Walk::Log => p[i].max(f64::MIN_POSITIVE).ln(),
                    Walk::LogAboveTheta => (p[i] - self.rows.steepest()).max(1e-9).ln(),
                }
            }),
        )
    }

    fn parameters(&self, x: &DVector<f64>) -> Vec<f64> {
        let mut p = self.base.to_vec();
        for ((&i, s), x) in self.free.iter().zip(&self.scale).zip(x.iter()) {
            p[i] = match self.walk(i) {
                Walk::Linear => x / s,
                Walk::Log => (x / s).exp(),
                Walk::LogAboveTheta => self.rows.steepest() + (x / s).exp(),
            };
        }
        p
    }

    /// Derivative of the parameter by the working coordinate, without the scale.
    fn slope(&self, p: &[f64], i: usize) -> f64 {
        match self.walk(i) {
            Walk::Linear => 1.0,
            Walk::Log => p[i],
            Walk::LogAboveTheta => p[i] - self.rows.steepest(),
        }
    }

    fn residual(&self, p: &[f64]) -> DVector<f64> {
        let mut sigma: Vec<f64> =
            self.rows.iter().map(|r| self.spec.sigma(p, r.z_m, r.theta_rad)).collect();
        self.rows.whiten(&mut sigma);
        DVector::from_vec(sigma) - &self.target
    }

    fn jacobian(&self, p: &[f64]) -> DMatrix<f64> {
        let mut j = natural_jacobian(self.rows, self.spec, p, self.free);
        for (column, (&i, s)) in self.free.iter().zip(&self.scale).enumerate() {
            let factor = self.slope(p, i) / s;
            j.column_mut(column).scale_mut(factor);
        }
        j
    }
}

impl LeastSquares for Local<'_> {
    fn linearise(&self, x: &DVector<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let p = self.parameters(x);
        let r = self.residual(&p);
        r.iter().all(|v| v.is_finite()).then(|| (r, self.jacobian(&p)))
    }

    fn cost(&self, x: &DVector<f64>) -> f64 {
        0.5 * self.residual(&self.parameters(x)).norm_squared()
    }
}

const TRUST_REGION_STEPS: u64 = 4;

fn polish(rows: &Rows, spec: &dyn SigmaForm, p: &[f64], free: &[usize]) -> Vec<f64> {
    if free.is_empty() {
        return p.to_vec();
    }
    let target = rows.whitened_sigmas();
    let mut local = Local { rows, spec, base: p, free, scale: vec![1.0; free.len()], target };
    let columns = local.jacobian(p);
    local.scale = columns.column_iter().map(|c| c.norm().max(1e-12)).collect();
    let start = local.to_working(p);
    match trust_region(&local, start, TRUST_REGION_STEPS) {
        Some(end) => local.parameters(&end.x),
        None => p.to_vec(),
    }
}
