//! Robust fit of a surface that a few outliers cannot pull: Huber's M-estimate by pseudo-values.
//!
//! Every sigma is clamped to within [`HUBER`] robust standard deviations of the current surface (in the
//! logarithm, where a factor of 30 and a thirtieth are alike) and the form is fitted to these values, until
//! the surface converges. The fixed point is Huber's M-estimate (Huber and Ronchetti, Robust Statistics,
//! 2nd ed., 7.8.2, "modified residuals"), without weights in the fit. It starts from k z^2 with k the median
//! of sigma/z^2, which up to half the rows cannot move.

use super::fit::fit_all;
use super::forms::Form;
use crate::measure::{SigmaRow, SigmaTable};
use crate::plane::MAD_TO_SIGMA;
use crate::stats::median_in_place;

/// Huber's constant: 95 % efficient for Gaussian errors.
const HUBER: f64 = 1.345;
/// Without convergence the last surface is used: the rejection of outliers iterates further.
const MAX_ROUNDS: usize = 10;
/// The surface has converged when no sigma moves by more than this share of a standard deviation; the outlier
/// test that follows asks for several.
const RESTS: f64 = 0.1;
/// Least extra relative variance, (0.01 %)^2: below it the rounding of an exact table would give outliers.
const MIN_EXTRA: f64 = 1e-8;
/// Largest extra relative variance: no sensor's sigma is less certain.
const MAX_EXTRA: f64 = 1.0;
/// Relative accuracy of the extra variance; that of the standard deviation is half of it.
const EXTRA_DIGITS: f64 = 1e-2;

/// Sigma of the surface at every row of `table`, m, and the number of its free parameters.
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

    /// k z^2 with k the median of sigma/z^2.
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

/// The table with every sigma clamped to within [`HUBER`] standard deviations of the surface.
fn pulled_in(table: &SigmaTable, surface: &Surface, spread: &[f64]) -> SigmaTable {
    let pull = |((row, sigma), spread): ((&SigmaRow, &f64), &f64)| {
        let off = (row.sigma_m / sigma).ln().clamp(-HUBER * spread, HUBER * spread);
        SigmaRow { sigma_m: sigma * off.exp(), ..*row }
    };
    SigmaTable { rows: table.rows.iter().zip(&surface.sigma).zip(spread).map(pull).collect() }
}

/// Robust standard deviation of ln(measured/surface) of every row: sampling, plus an extra error common to
/// all that gives the picked rows the median of a Gaussian.
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
    // Corrects for the degrees of freedom that the fit used.
    let paid = (n / (n - surface.free as f64).max(1.0)).sqrt();
    let too_wide = |extra: f64| {
        let mut t: Vec<f32> =
            picked.iter().map(|(off, s)| (off / (s + extra).sqrt()) as f32).collect();
        paid * MAD_TO_SIGMA * f64::from(median_in_place(&mut t)) > 1.0
    };
    let extra = extra_variance(too_wide);
    sampling.iter().map(|s| (s + extra).sqrt()).collect()
}

/// The least extra variance at which the scatter is not too wide, by bisection in the logarithm.
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
