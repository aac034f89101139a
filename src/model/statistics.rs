//! What is told of a finished fit: covariance, standard errors, figures of merit.

use nalgebra::DMatrix;

use super::fit::{Parameter, SigmaFit};
use super::forms::{Form, SigmaForm};
use super::local::natural_jacobian;
use super::quality::{Quality, few_views};
use super::rows::Rows;
use super::surface::Domain;

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
    remarks.splice(0..0, few_views(rows.views(), free.len()).into_iter().chain(quality.words()));
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
