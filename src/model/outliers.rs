//! Sigmas that do not belong to the surface: a bin that caught a neighbouring object, a view
//! whose target was something else. Fit, look, leave out, fit again.

use super::fit::{SigmaFit, fit_all};
use super::forms::Form;
use crate::error::Result;
use crate::measure::{SigmaRow, SigmaTable};
use crate::plane::MAD_TO_SIGMA;
use crate::stats::median_in_place;

/// Robust standard deviations of ln(measured/fitted) beyond which a sigma is left out: a clean
/// Gaussian cell gets there once in two million.
const OFF: f64 = 5.0;
/// More than this share is no longer a few outliers but a wrong form, and nothing is left out.
const MOST_SHARE: f64 = 0.2;
const MOST_ROUNDS: usize = 6;

/// Fit `form` to `table`, leaving out sigmas that stand far off; they are told in the remarks.
///
/// # Errors
/// When the table has too few rows or distances for the form, or the solver finds no surface
/// that is positive where the data are.
pub fn fit(table: &SigmaTable, form: Form) -> Result<SigmaFit> {
    let whole = fit_all(table, form)?;
    let mut current = whole.clone();
    let mut left_out: Vec<usize> = Vec::new();
    for _ in 0..MOST_ROUNDS {
        let off = standing_off(table, &current, &left_out);
        if off == left_out {
            break;
        }
        if off.len() as f64 > MOST_SHARE * table.rows.len() as f64 {
            return Ok(whole);
        }
        let kept = SigmaTable {
            rows: (0..table.rows.len())
                .filter(|i| !off.contains(i))
                .map(|i| table.rows[i])
                .collect(),
        };
        match fit_all(&kept, form) {
            Ok(fitted) => current = fitted,
            // What is left no longer carries the form: the outliers were needed.
            Err(_) => return Ok(whole),
        }
        left_out = off;
    }
    if !left_out.is_empty() {
        current.remarks.insert(0, words(table, &left_out));
        current.left_out = left_out.iter().map(|&i| table.rows[i]).collect();
    }
    Ok(current)
}

/// Indices of the rows that are off the fitted surface. The scale is robust: an error beyond
/// sampling, the same for all rows, chosen so that the kept rows' median is a Gaussian's.
fn standing_off(table: &SigmaTable, fitted: &SigmaFit, left_out: &[usize]) -> Vec<usize> {
    let p = fitted.values();
    let spec = fitted.form.spec();
    let log = |r: &SigmaRow| (r.sigma_m / spec.sigma(&p, r.z_m, r.theta_rad)).ln();
    let sampling = |r: &SigmaRow| r.n_effective.map_or(0.0, |n| 0.5 / n);
    let kept: Vec<&SigmaRow> = table
        .rows
        .iter()
        .enumerate()
        .filter(|(i, _)| !left_out.contains(i))
        .map(|(_, r)| r)
        .collect();
    let scale = |extra: f64| {
        let mut t: Vec<f32> =
            kept.iter().map(|r| (log(r).abs() / (sampling(r) + extra).sqrt()) as f32).collect();
        MAD_TO_SIGMA * f64::from(median_in_place(&mut t))
    };
    let (mut low, mut high) = (LEAST_EXTRA, 1.0);
    if scale(low) <= 1.0 {
        high = low;
    }
    while high > low * 1.001 {
        let middle = (low * high).sqrt();
        if scale(middle) > 1.0 { low = middle } else { high = middle }
    }
    (0..table.rows.len())
        .filter(|&i| {
            let r = &table.rows[i];
            let t = log(r) / (sampling(r) + high).sqrt();
            t.is_nan() || t.abs() > OFF
        })
        .collect()
}

/// A relative error of 0.01 % squared: below it an exact table would call its rounding outliers.
const LEAST_EXTRA: f64 = 1e-8;

fn words(table: &SigmaTable, left_out: &[usize]) -> String {
    const SHOWN: usize = 6;
    let mut places: Vec<String> = left_out
        .iter()
        .take(SHOWN)
        .map(|&i| {
            let r = &table.rows[i];
            format!(
                "{:.1} mm at {:.2} m, {:.0} degrees",
                1e3 * r.sigma_m,
                r.z_m,
                r.theta_rad.to_degrees()
            )
        })
        .collect();
    if left_out.len() > SHOWN {
        places.push("...".into());
    }
    format!(
        "{} of {} sigmas stand more than {OFF} robust standard deviations off the surface and were left out of the fit: {}",
        left_out.len(),
        table.rows.len(),
        places.join("; ")
    )
}
