//! Statistics of a finished fit: covariance, standard errors, figures of merit, and warnings where it should
//! not be trusted.

use nalgebra::DMatrix;

use super::forms::{Form, SigmaForm, natural_jacobian};
use super::rows::Rows;
use super::surface::{Direction, Domain, SigmaModel};
use crate::read::MAX_NUMBER;

/// A parameter as reported.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    pub name: &'static str,
    pub value: f64,
    /// `None` when the parameter was held fixed.
    pub std_error: Option<f64>,
    /// Set where the data do not determine the parameter.
    pub remark: Option<String>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct SigmaFit {
    pub form: Form,
    pub parameters: Vec<Parameter>,
    /// Covariance of the parameters; rows and columns of held ones are zero.
    pub covariance: DMatrix<f64>,
    pub domain: Domain,
    pub rows: usize,
    pub views: usize,
    /// Views less free parameters (at least 1), for the quantiles of intervals.
    pub degrees_of_freedom: f64,
    /// Relative scatter beyond sampling, within views and between them.
    pub extra_within: f64,
    pub extra_between: f64,
    pub quality: Quality,
    pub converged: bool,
    pub remarks: Vec<String>,
}

impl SigmaFit {
    /// Why the fit is not usable as a model of a sensor, if so, and what to do.
    pub fn is_no_model(&self) -> Option<(String, &'static str)> {
        const CHECK: &str = "check how raw values become metres, the intrinsics, and measurements.csv for views that measured something else than one flat target";
        const RECORD: &str = "record views at several distances and tilts";
        match self.views {
            1 => Some(("one view is no calibration".into(), RECORD)),
            n if n < MIN_VIEWS => Some((format!("{n} views are no calibration"), RECORD)),
            _ => self.quality.explains_nothing().map(|what| (what, CHECK)),
        }
    }

    pub fn values(&self) -> Vec<f64> {
        self.parameters.iter().map(|p| p.value).collect()
    }

    pub fn free(&self) -> usize {
        self.parameters.iter().filter(|p| p.std_error.is_some()).count()
    }

    /// Variance of the relative residual, corrected for the free parameters.
    pub fn relative_variance(&self) -> f64 {
        let n = self.rows as f64;
        self.quality.rmse_relative.powi(2) * n / (n - self.free() as f64).max(1.0)
    }

    /// The fitted surface, taken as a sigma along the optical axis.
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

/// A parameter whose standard error exceeds this share of its value counts as not determined.
const WEAK: f64 = 0.5;

/// Assembles the finished fit; `rows` are relative to its surface.
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
    let scale = if rows.sized() {
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
    let fitted = parameters.iter().filter(|q| q.std_error.is_some());
    for weak in fitted.filter_map(|q| q.remark.as_ref()) {
        if !remarks.contains(weak) {
            remarks.push(weak.clone());
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
        degrees_of_freedom: (rows.views() as f64 - free.len() as f64).max(1.0),
        extra_within: rows.extra()[0],
        extra_between: rows.extra()[1],
        quality,
        converged,
        remarks,
    }
}

/// (J' C^-1 J)^-1 by SVD; directions that the data do not determine get a huge but finite variance, and
/// [`name_parameters`] names them.
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
    let norms: Vec<f64> = j.column_iter().map(|c| c.norm().max(UNSEEN_NORM)).collect();
    for (mut column, norm) in j.column_iter_mut().zip(&norms) {
        column /= *norm;
    }
    if j.nrows() < free.len() {
        // Pads with zero rows: without them the thin SVD would lack directions.
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
    // Caps the variance of directions that no row determines.
    let cap = |i: usize| (MAX_VARIANCE / full[(i, i)].max(MAX_VARIANCE)).sqrt();
    let caps: Vec<f64> = (0..p.len()).map(cap).collect();
    DMatrix::from_fn(p.len(), p.len(), |i, j| full[(i, j)] * caps[i] * caps[j])
}

/// Largest variance of a parameter in a model.
const MAX_VARIANCE: f64 = 0.5 * MAX_NUMBER;
/// Floor of a Jacobian column's norm, so that its square does not underflow.
const UNSEEN_NORM: f64 = 1e-100;

/// Singular values below this share of the largest are rounding errors, and are raised to it.
const UNSEEN: f64 = 1e-10;

fn name_parameters(
    spec: &dyn SigmaForm,
    rows: &Rows,
    p: &[f64],
    free: &[usize],
    covariance: &DMatrix<f64>,
) -> Vec<Parameter> {
    spec.card()
        .parameters
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

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// Root mean square of s - sigma, m, and as a share of sigma.
    pub rmse_m: f64,
    pub rmse_relative: f64,
    pub r2: f64,
    /// Expected rmse_relative from sampling alone; `None` when no n is known.
    pub sampling_relative: Option<f64>,
    /// Share of sigma's variance over the rows that neither the surface nor sampling explains.
    pub unexplained: f64,
}

/// Above this unexplained share the surface misses more of the differences between views than rounding a
/// coefficient to one digit would.
const MAX_UNEXPLAINED: f64 = 0.2;
/// Below this r2 the surface leaves more of the differences between views than it explains.
const MIN_R2: f64 = 0.5;
/// Largest relative error of sigma: weights are 1/sigma^2, and would be wrong by a factor of two.
const MAX_ERROR: f64 = 0.5;
/// Scatter of this many times that of sampling is significant for any number of rows: chi^2 per degree of
/// freedom is its square.
const FAR_ABOVE_SAMPLING: f64 = 3.0;
/// Fewest views that can contradict a surface.
const MIN_VIEWS: usize = 3;

impl Quality {
    /// `sigma` is the surface at every row, m.
    pub fn of(rows: &Rows, sigma: &[f64]) -> Self {
        let n = rows.len() as f64;
        let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / n;
        let measured = || rows.iter().map(|r| r.sigma_m);
        let middle = mean(&mut measured());
        let scatter = mean(&mut measured().map(|s| (s - middle).powi(2)));
        let left = mean(&mut measured().zip(sigma).map(|(s, m)| (s - m).powi(2)));
        let relative = mean(&mut measured().zip(sigma).map(|(s, m)| (s / m - 1.0).powi(2)));
        let sampled = || rows.iter().zip(sigma).map(|(r, m)| (m, r.n_effective.map(|n| 0.5 / n)));
        let by_sampling = mean(&mut sampled().map(|(m, v)| m * m * v.unwrap_or(0.0)));
        let sampling = mean(&mut sampled().map(|(_, v)| v.unwrap_or(0.0))).sqrt();
        let share = |left: f64| if scatter > 0.0 { left / scatter } else { 0.0 };
        Quality {
            rmse_m: left.sqrt(),
            rmse_relative: relative.sqrt(),
            r2: if scatter > 0.0 { 1.0 - left / scatter } else { 0.0 },
            sampling_relative: rows.counted().then_some(sampling),
            unexplained: share((left - by_sampling).max(0.0)),
        }
    }

    /// Why the surface is useless as a model, if so: it misses more than it explains, and not because of
    /// sampling; or its sigmas are wrong by half.
    pub fn explains_nothing(&self) -> Option<String> {
        let flat = self.r2 < MIN_R2 && self.unexplained > MAX_UNEXPLAINED;
        (flat || self.rmse_relative > MAX_ERROR).then(|| {
            let error = 1e2 * self.rmse_relative;
            format!("the fit explains nothing (r2 {:.2}, sigmas lie {error:.0} % off it)", self.r2)
        })
    }

    /// Whether the surface explains so little that the remarks warn of it first.
    pub fn is_poor(&self) -> bool {
        self.r2 < 0.0 || self.unexplained > MAX_UNEXPLAINED
    }

    /// What to know before the coefficients, if anything.
    pub fn warning(&self) -> Option<String> {
        const REMEDY: &str = "look in measurements.csv for views that measured something else than one flat target, or try --form auto";
        let sampling = self.sampling_relative.map_or(String::new(), |s| {
            format!(", where the number of samples explains {:.1} %", 1e2 * s)
        });
        let scatter =
            format!("sigmas lie {:.0} % off it (rms){sampling}", 1e2 * self.rmse_relative);
        if self.r2 < 0.0 {
            return Some(format!(
                "the fit is useless: one constant sigma would fit better than this surface (r2 {:.2}), {scatter}; {REMEDY}",
                self.r2
            ));
        }
        if self.is_poor() {
            return Some(format!(
                "the fit is poor: the surface and sampling leave {:.0} % of the variance of sigma unexplained (r2 {:.2}), {scatter}; {REMEDY}",
                1e2 * self.unexplained,
                self.r2
            ));
        }
        let far =
            self.sampling_relative.is_some_and(|s| self.rmse_relative > FAR_ABOVE_SAMPLING * s);
        far.then(|| {
            format!(
                "the views differ by more than noise: {scatter}; the intervals allow for it, more frames will not help, other views will"
            )
        })
    }
}

/// Warning where the views are too few for meaningful intervals.
pub(super) fn few_views(views: usize, free: usize) -> Option<String> {
    let seen = if views == 1 { "one view".into() } else { format!("{views} views") };
    if views < MIN_VIEWS {
        return Some(format!(
            "this is no calibration: a surface through {seen} has nothing to check it by; record views at three distances at least, better at five and at several tilts"
        ));
    }
    (views <= free).then(|| {
        format!(
            "{seen} for {free} coefficients: the views cannot contradict the surface, and its intervals are guesses; record more views"
        )
    })
}

#[cfg(test)]
mod tests {
    use crate::measure::{SigmaRow, SigmaTable};
    use crate::model::Form;
    use crate::model::fit::fit_all;
    use crate::read::MAX_NUMBER;

    /// Walls at normal incidence to within rounding: the effect of the tilt is not determined.
    #[test]
    fn what_no_view_shows_has_a_variance_that_can_be_written() {
        let row = |view: usize| {
            let z_m = 1.0 + 0.3 * view as f64;
            let sigma_m = 0.0015 + 0.002 * (z_m - 0.48).powi(2);
            SigmaRow { z_m, theta_rad: 1e-16, sigma_m, n_effective: Some(1e4), view }
        };
        let table = SigmaTable { rows: (0..10).map(row).collect() };
        let fit = fit_all(&table, Form::Paper).unwrap();
        assert!(fit.covariance.iter().all(|v| v.abs() <= MAX_NUMBER), "{}", fit.covariance);
        assert!(fit.covariance[(1, 1)] > 0.0 && fit.covariance[(1, 1)] < 1e-3);
    }
}
