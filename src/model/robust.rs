//! A surface that a few wild sigmas cannot pull: Huber's estimate by pseudo-values.
//!
//! Every sigma is moved to within [`HUBER`] robust standard deviations of the current surface (on
//! the logarithm, where a factor 30 and a thirtieth are alike), the form is fitted to these, and
//! so on until the surface rests: the fixed point is Huber's M-estimate (Huber and Ronchetti,
//! Robust Statistics, 2nd ed., 7.8.2, "modified residuals"), with no weights to carry through the
//! fit. It starts from k z^2 with k the median of sigma/z^2, which up to half the rows cannot move.

use super::fit::fit_all;
use super::forms::Form;
use crate::measure::{SigmaRow, SigmaTable};
use crate::plane::MAD_TO_SIGMA;
use crate::stats::median_in_place;

/// Huber's constant: 95 % efficiency where the errors are Gaussian after all.
const HUBER: f64 = 1.345;
/// What has not come to rest by then is judged as it is: leaving out and looking again follows.
const MAX_ROUNDS: usize = 10;
/// The surface rests when no sigma of it moves by more than this share of a standard deviation:
/// what follows asks about several of them.
const RESTS: f64 = 0.1;
/// A relative error of 0.01 % squared: below it an exact table would call its rounding outliers.
const MIN_EXTRA: f64 = 1e-8;
/// A relative variance of one: no sensor's sigma is less certain than that.
const MAX_EXTRA: f64 = 1.0;
/// Relative width at which the search for the extra variance ends: half of it on the scale.
const EXTRA_DIGITS: f64 = 1e-2;

/// Sigma of the surface at every row of `table`, m, and how many parameters it took.
pub(super) struct Surface {
    pub sigma: Vec<f64>,
    pub free: usize,
}

impl Surface {
    pub fn of(table: &SigmaTable, form: Form, values: &[f64], free: usize) -> Self {
        let spec = form.spec();
        let sigma = table.rows.iter().map(|r| spec.sigma(values, r.z_m, r.theta_rad)).collect();
        Surface { sigma, free }
    }

    /// k z^2 by the median.
    fn median(table: &SigmaTable) -> Self {
        let mut ratios: Vec<f32> =
            table.rows.iter().map(|r| (r.sigma_m / r.z_m.powi(2)).ln() as f32).collect();
        let k = f64::from(median_in_place(&mut ratios)).exp();
        Surface { sigma: table.rows.iter().map(|r| k * r.z_m.powi(2)).collect(), free: 1 }
    }
}

/// Huber's fit of `form`; `None` where the form cannot be fitted.
pub(super) fn surface(table: &SigmaTable, form: Form) -> Option<Surface> {
    let mut current = Surface::median(table);
    for _ in 0..MAX_ROUNDS {
        let spread = spread(table, &current, |_| true);
        let fitted = fit_all(&pulled_in(table, &current, &spread), form).ok()?;
        let next = Surface::of(table, form, &fitted.values(), fitted.free());
        let moved = (0..spread.len())
            .map(|i| (next.sigma[i] / current.sigma[i]).ln().abs() / spread[i])
            .fold(0.0, f64::max);
        current = next;
        if moved < RESTS {
            break;
        }
    }
    Some(current)
}

/// The table with every sigma within [`HUBER`] standard deviations of the surface.
fn pulled_in(table: &SigmaTable, surface: &Surface, spread: &[f64]) -> SigmaTable {
    let pull = |((row, sigma), spread): ((&SigmaRow, &f64), &f64)| {
        let off = (row.sigma_m / sigma).ln().clamp(-HUBER * spread, HUBER * spread);
        SigmaRow { sigma_m: sigma * off.exp(), ..*row }
    };
    SigmaTable { rows: table.rows.iter().zip(&surface.sigma).zip(spread).map(pull).collect() }
}

/// Robust standard deviation of ln(measured/surface) of every row: sampling, plus an error that is
/// the same for all and makes the median of the rows picked that of a Gaussian.
pub(super) fn spread(
    table: &SigmaTable,
    surface: &Surface,
    pick: impl Fn(usize) -> bool,
) -> Vec<f64> {
    let sampling: Vec<f64> =
        table.rows.iter().map(|r| r.n_effective.map_or(0.0, |n| 0.5 / n)).collect();
    let picked: Vec<(f64, f64)> = (0..table.rows.len())
        .filter(|&i| pick(i))
        .map(|i| ((table.rows[i].sigma_m / surface.sigma[i]).ln().abs(), sampling[i]))
        .collect();
    let n = picked.len() as f64;
    // The fit has taken as much of the scatter as it has parameters.
    let paid = (n / (n - surface.free as f64).max(1.0)).sqrt();
    let too_wide = |extra: f64| {
        let mut t: Vec<f32> =
            picked.iter().map(|(off, s)| (off / (s + extra).sqrt()) as f32).collect();
        paid * MAD_TO_SIGMA * f64::from(median_in_place(&mut t)) > 1.0
    };
    let extra = extra_variance(too_wide);
    sampling.iter().map(|s| (s + extra).sqrt()).collect()
}

/// The least extra variance at which the scatter is not too wide, by bisection of its logarithm.
fn extra_variance(too_wide: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (MIN_EXTRA, MAX_EXTRA);
    if !too_wide(low) {
        return low;
    }
    while high > low * (1.0 + EXTRA_DIGITS) {
        let middle = (low * high).sqrt();
        if too_wide(middle) { low = middle } else { high = middle }
    }
    high
}
