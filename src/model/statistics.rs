//! A finished fit: covariance, standard errors, figures of merit.

use nalgebra::DMatrix;

use super::forms::{Form, SigmaForm};
use super::local::natural_jacobian;
use super::quality::{Quality, few_views};
use super::rows::Rows;
use super::surface::{Direction, Domain, SigmaModel};
use crate::measure::SigmaRow;

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
    /// What `rmse_relative` would be from sampling alone; `None` when no n is known.
    pub sampling_relative: Option<f64>,
    pub r2: f64,
    /// The surface explains so little that the remarks warn of it first.
    pub poor: bool,
    pub iterations: usize,
    pub converged: bool,
    pub remarks: Vec<String>,
}

impl SigmaFit {
    pub fn values(&self) -> Vec<f64> {
        self.parameters.iter().map(|p| p.value).collect()
    }

    /// Number of parameters that were fitted.
    pub fn free(&self) -> usize {
        self.parameters.iter().filter(|p| p.std_error.is_some()).count()
    }

    /// Variance of the relative residual, with the free parameters paid for.
    pub fn relative_variance(&self) -> f64 {
        let n = self.rows as f64;
        self.rmse_relative.powi(2) * n / (n - self.free() as f64).max(1.0)
    }

    /// The surface without the story of its fit, as one along the optical axis.
    pub fn model(&self) -> SigmaModel {
        SigmaModel {
            form: self.form,
            parameters: self.values(),
            std_errors: self.parameters.iter().map(|p| p.std_error).collect(),
            covariance: self.covariance.clone(),
            domain: self.domain,
            degrees_of_freedom: self.degrees_of_freedom,
            direction: Direction::Axial,
        }
    }
}

/// A parameter whose standard error exceeds this share of its value is called not determined.
const WEAK: f64 = 0.5;

/// The finished fit; `rows` refer to its surface.
pub(super) fn report(
    form: Form,
    rows: &Rows,
    p: Vec<f64>,
    free: &[usize],
    mut remarks: Vec<String>,
    iterations: usize,
    converged: bool,
) -> SigmaFit {
    let spec = form.spec();
    let quality = Quality::of(rows, rows.reference());
    let degrees = (rows.views() as f64 - free.len() as f64).max(1.0);
    let scale = if rows.counted() {
        1.0
    } else {
        let n = rows.len() as f64;
        quality.rmse_relative.powi(2) * n / (n - free.len() as f64).max(1.0)
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
    remarks.splice(0..0, few_views(rows.views(), free.len()).into_iter().chain(quality.warning()));
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
        rmse_m: quality.rmse_m,
        rmse_relative: quality.rmse_relative,
        sampling_relative: quality.sampling_relative,
        r2: quality.r2,
        poor: quality.is_poor(),
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
