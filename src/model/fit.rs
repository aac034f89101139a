//! Fitting a form of sigma(z, theta) to a table.
//!
//! Residuals are relative to the model, (s_i - sigma_i)/sigma_i, and the weights follow the
//! model, so the estimate solves sum_i J_i' C^-1 (s_i - sigma_i) = 0 (quasi-likelihood with
//! constant coefficient of variation). The start comes from the data alone, so there is no
//! "start" to get wrong.

use nalgebra::DMatrix;

use super::forms::{Form, SigmaForm};
use super::local::{natural_jacobian, polish};
use super::rows::Rows;
use super::{Domain, SigmaModel};
use crate::error::{Error, Result};
use crate::measure::{SigmaRow, SigmaTable};

/// A parameter as reported.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    pub name: &'static str,
    pub value: f64,
    /// `None` when the parameter was held.
    pub std_error: Option<f64>,
    /// Said where the data do not determine it.
    pub remark: Option<String>,
}

/// A fitted form and how well it fits.
#[derive(Debug, Clone, PartialEq)]
pub struct SigmaFit {
    pub form: Form,
    pub parameters: Vec<Parameter>,
    /// Covariance of the parameters; rows and columns of held ones are zero.
    pub covariance: DMatrix<f64>,
    pub domain: Domain,
    pub rows: usize,
    pub views: usize,
    /// Sigmas that stand far off the surface and were not fitted.
    pub left_out: Vec<SigmaRow>,
    /// Views less free parameters (at least 1): what intervals' quantiles use.
    pub degrees_of_freedom: f64,
    /// Relative scatter that sampling does not explain, within views and between them.
    pub extra_within: f64,
    pub extra_between: f64,
    /// Root mean square of s - sigma, m, and as a share of sigma.
    pub rmse_m: f64,
    pub rmse_relative: f64,
    pub r2: f64,
    pub iterations: usize,
    pub converged: bool,
    pub remarks: Vec<String>,
}

/// Distances closer than this count as one.
pub const DISTANCE_RATIO: f64 = 1.05;
const MOST_ROUNDS: usize = 60;
/// Largest change of ln sigma over the table at which the weights have settled.
const SETTLED: f64 = 1e-10;
/// A parameter whose standard error exceeds this share of its value is called not determined.
const WEAK: f64 = 0.5;

impl SigmaFit {
    pub fn values(&self) -> Vec<f64> {
        self.parameters.iter().map(|p| p.value).collect()
    }

    /// Variance of the relative residual, with the free parameters paid for.
    pub fn relative_variance(&self) -> f64 {
        let free = self.parameters.iter().filter(|p| p.std_error.is_some()).count();
        let n = self.rows as f64;
        self.rmse_relative.powi(2) * n / (n - free as f64).max(1.0)
    }

    /// The surface without the story of its fit.
    pub fn model(&self) -> SigmaModel {
        SigmaModel {
            form: self.form,
            parameters: self.values(),
            std_errors: self.parameters.iter().map(|p| p.std_error).collect(),
            covariance: self.covariance.clone(),
            domain: self.domain,
            degrees_of_freedom: self.degrees_of_freedom,
        }
    }
}

/// Fit `form` to every row of `table`.
///
/// # Errors
/// When the table has too few rows or distances for the form, or the solver finds no surface
/// that is positive where the data are.
pub fn fit_all(table: &SigmaTable, form: Form) -> Result<SigmaFit> {
    let spec = form.spec();
    let mut rows = Rows::new(table);
    enough(&rows, spec)?;
    let no_start = || Error::NotEnough {
        what: format!("the form \"{form}\" cannot be fitted to these {} sigmas", rows_words(table)),
        remedy: "add views at other distances and tilts, or choose --form khoshelham".into(),
    };
    let first = spec.start(&rows).ok_or_else(no_start)?;
    rows.refer_to(|r| positive(spec.sigma(&first.parameters, r.z_m, r.theta_rad), r.sigma_m));
    rows.estimate_extra(first.held.iter().filter(|held| !**held).count());
    let start = spec.start(&rows).ok_or_else(no_start)?;
    let mut remarks = start.remarks;
    let mut free: Vec<usize> = (0..start.held.len()).filter(|&i| !start.held[i]).collect();
    let mut p = start.parameters.clone();
    let (mut rounds, mut converged) = (0, false);
    while rounds < MOST_ROUNDS && !converged {
        rounds += 1;
        rows.refer_to(|r| positive(spec.sigma(&p, r.z_m, r.theta_rad), r.sigma_m));
        rows.estimate_extra(free.len());
        let before: Vec<f64> = rows.reference().to_vec();
        p = polish(&rows, spec, &p, &free);
        hold_strays(&rows, spec, &mut p, &mut free, &mut remarks);
        let change = rows
            .iter()
            .zip(&before)
            .map(|(r, s)| (spec.sigma(&p, r.z_m, r.theta_rad) / s).ln().abs())
            .fold(0.0, f64::max);
        converged = change < SETTLED;
    }
    if !rows.iter().all(|r| spec.sigma(&p, r.z_m, r.theta_rad) > 0.0) {
        return Err(Error::Solver {
            what: format!("the form \"{form}\" is not positive where the data are"),
            remedy: "look for outlying views in measurements.csv, or choose another --form",
        });
    }
    rows.refer_to(|r| spec.sigma(&p, r.z_m, r.theta_rad));
    Ok(report(form, &rows, p, &free, remarks, rounds, converged))
}

/// Hold free parameters that left where they can be believed at the edge.
fn hold_strays(
    rows: &Rows,
    spec: &dyn SigmaForm,
    p: &mut [f64],
    free: &mut Vec<usize>,
    remarks: &mut Vec<String>,
) {
    free.retain(|&i| match spec.limits(i, rows) {
        Some([low, high]) if !(low..=high).contains(&p[i]) => {
            p[i] = if p[i] > high { high } else { low };
            remarks.push(format!(
                "{} runs out of what is believed and is held at {:.3}",
                spec.parameters()[i].0,
                p[i]
            ));
            false
        }
        _ => true,
    });
}

fn positive(sigma: f64, otherwise: f64) -> f64 {
    if sigma > 1e-3 * otherwise && sigma.is_finite() { sigma } else { otherwise }
}

fn rows_words(table: &SigmaTable) -> String {
    let [low, high] = table.range(|r| r.z_m);
    format!("{} measured from {low:.2} to {high:.2} m", table.rows.len())
}

fn enough(rows: &Rows, spec: &dyn SigmaForm) -> Result<()> {
    let parameters = spec.parameters().len();
    let free_at_least = parameters.min(4);
    if rows.len() < free_at_least {
        return Err(Error::NotEnough {
            what: format!(
                "{} measured sigmas are too few for the form \"{}\"",
                rows.len(),
                spec.id()
            ),
            remedy: format!("give at least {free_at_least}, better {}", 3 * parameters),
        });
    }
    let distances = rows.distances(DISTANCE_RATIO);
    let needed = spec.distances_needed();
    if distances < needed {
        return Err(Error::NotEnough {
            what: format!(
                "the views stand at {distances} different distance{} and the form \"{}\" needs {needed}",
                if distances == 1 { "" } else { "s" },
                spec.id()
            ),
            remedy: "record views at other distances, or choose --form khoshelham, which needs one"
                .into(),
        });
    }
    Ok(())
}

fn report(
    form: Form,
    rows: &Rows,
    p: Vec<f64>,
    free: &[usize],
    mut remarks: Vec<String>,
    iterations: usize,
    converged: bool,
) -> SigmaFit {
    let spec = form.spec();
    let relative: Vec<f64> =
        rows.iter().map(|r| r.sigma_m / spec.sigma(&p, r.z_m, r.theta_rad) - 1.0).collect();
    let degrees = (rows.views() as f64 - free.len() as f64).max(1.0);
    let scale = if rows.counted() {
        1.0
    } else {
        relative.iter().map(|r| r * r).sum::<f64>()
            / (rows.len() as f64 - free.len() as f64).max(1.0)
    };
    let covariance = covariance(rows, spec, &p, free, scale);
    let parameters = name_parameters(spec, rows, &p, free, &covariance);
    if !converged {
        remarks.push(format!("the weights had not settled after {iterations} rounds"));
    }
    let weak = parameters.iter().filter(|q| q.std_error.is_some() && q.remark.is_some());
    for q in weak {
        let text = q.remark.clone().unwrap_or_default();
        if !remarks.contains(&text) {
            remarks.push(text);
        }
    }
    let n = rows.len() as f64;
    let mean = rows.iter().map(|r| r.sigma_m).sum::<f64>() / n;
    let scatter: f64 = rows.iter().map(|r| (r.sigma_m - mean).powi(2)).sum();
    let left: f64 =
        rows.iter().map(|r| (r.sigma_m - spec.sigma(&p, r.z_m, r.theta_rad)).powi(2)).sum();
    SigmaFit {
        form,
        domain: Domain::of(rows, spec.pole(&p)),
        parameters,
        covariance,
        rows: rows.len(),
        views: rows.views(),
        left_out: Vec::new(),
        degrees_of_freedom: degrees,
        extra_within: rows.extra()[0],
        extra_between: rows.extra()[1],
        rmse_m: (left / n).sqrt(),
        rmse_relative: (relative.iter().map(|r| r * r).sum::<f64>() / n).sqrt(),
        r2: if scatter > 0.0 { 1.0 - left / scatter } else { 0.0 },
        iterations,
        converged,
        remarks,
    }
}

/// (J' C^-1 J)^-1 by singular values; directions the data do not see get no variance here and
/// are named by [`name_parameters`].
fn covariance(
    rows: &Rows,
    spec: &dyn SigmaForm,
    p: &[f64],
    free: &[usize],
    scale: f64,
) -> DMatrix<f64> {
    let mut full = DMatrix::zeros(p.len(), p.len());
    if free.is_empty() {
        return full;
    }
    let mut j = natural_jacobian(rows, spec, p, free);
    let norms: Vec<f64> = j.column_iter().map(|c| c.norm().max(f64::MIN_POSITIVE)).collect();
    for (mut column, norm) in j.column_iter_mut().zip(&norms) {
        column /= *norm;
    }
    if j.nrows() < free.len() {
        // Rows of zeros see nothing; without them the decomposition is short of directions.
        j = j.resize_vertically(free.len(), 0.0);
    }
    let svd = j.svd(false, true);
    let Some(v_t) = svd.v_t else { return full };
    let largest = svd.singular_values.max();
    for (a, &ia) in free.iter().enumerate() {
        for (b, &ib) in free.iter().enumerate() {
            let sum: f64 = (0..free.len())
                .map(|k| {
                    let s = svd.singular_values[k].max(UNSEEN * largest);
                    v_t[(k, a)] * v_t[(k, b)] / (s * s)
                })
                .sum();
            full[(ia, ib)] = scale * sum / (norms[a] * norms[b]);
        }
    }
    full
}

/// Singular values below this share of the largest are rounding; the variance along them is
/// then huge but finite.
const UNSEEN: f64 = 1e-10;

fn name_parameters(
    spec: &dyn SigmaForm,
    rows: &Rows,
    p: &[f64],
    free: &[usize],
    covariance: &DMatrix<f64>,
) -> Vec<Parameter> {
    spec.parameters()
        .iter()
        .enumerate()
        .map(|(i, &(name, _))| {
            let std_error = free.contains(&i).then(|| covariance[(i, i)].max(0.0).sqrt());
            let weak = std_error.is_some_and(|e| e.is_nan() || e > WEAK * p[i].abs());
            let remark = match std_error {
                None => Some(format!("{name} was held, not fitted")),
                Some(_) if weak => spec
                    .why_weak(i, rows)
                    .or_else(|| Some(format!("{name} is not determined by these data"))),
                Some(_) => None,
            };
            Parameter { name, value: p[i], std_error, remark }
        })
        .collect()
}
