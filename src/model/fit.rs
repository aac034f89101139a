//! Fitting a form of sigma(z, theta) to a table.
//!
//! Residuals are relative to the model, (s_i - sigma_i)/sigma_i, and the weights follow the
//! model, so the estimate solves sum_i J_i' C^-1 (s_i - sigma_i) = 0 (quasi-likelihood with
//! constant coefficient of variation). The start comes from the data alone, so there is no
//! "start" to get wrong.

use super::forms::{Form, SigmaForm};
use super::local::polish;
use super::rows::Rows;
use super::statistics::{SigmaFit, report};
use super::surface::Domain;
use crate::error::{Error, Result};
use crate::measure::SigmaTable;

/// Distances closer than this count as one.
pub const DISTANCE_RATIO: f64 = 1.05;
const MAX_ROUNDS: usize = 60;
/// Largest change of ln sigma over the table at which the weights have settled.
const SETTLED: f64 = 1e-10;

/// Fit `form` to every row of `table`.
///
/// # Errors
/// When the table has too few rows or distances for the form, or the solver finds no surface
/// that is positive over their range.
pub fn fit_all(table: &SigmaTable, form: Form) -> Result<SigmaFit> {
    let spec = form.spec();
    let mut rows = Rows::new(table);
    enough(&rows, spec)?;
    let no_start = || Error::NotEnough {
        what: format!(
            "the form \"{form}\" cannot be fitted to these {} sigmas",
            describe_rows(table)
        ),
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
    while rounds < MAX_ROUNDS && !converged {
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
        converged =
            change < SETTLED && !hold_positive(&rows, spec, &mut p, &mut free, &mut remarks);
    }
    if !positive_in_range(&rows, spec, &p) {
        return Err(Error::Solver {
            what: format!("the form \"{form}\" is not positive over the range of the data"),
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

/// A surface may not come nearer to zero inside its range than this share of the least sigma
/// measured: between two distances a parabola can dip to where no sensor is.
const MIN_SHARE: f64 = 0.1;

/// Where the surface is least inside its range: at the vertex or the end of z next to it, and at
/// the least tilt, for no form's tilt term is negative.
fn min_point(rows: &Rows, spec: &dyn SigmaForm, p: &[f64]) -> Option<(f64, f64)> {
    let domain = Domain::of(rows, spec.pole(p));
    spec.vertex(p).map(|c| domain.clamp(c, 0.0))
}

/// Lift a surface that dips too low to [`MIN_SHARE`] and hold its floor there. True when that
/// was needed: the rest must be fitted again.
fn hold_positive(
    rows: &Rows,
    spec: &dyn SigmaForm,
    p: &mut [f64],
    free: &mut Vec<usize>,
    remarks: &mut Vec<String>,
) -> bool {
    let Some((z, theta)) = min_point(rows, spec, p) else { return false };
    let floor = MIN_SHARE * rows.range(|r| r.sigma_m)[0];
    let sigma = spec.sigma(p, z, theta);
    // Once lifted, half the way down again is let be: the surface is positive.
    if sigma >= if free.contains(&0) { floor } else { 0.5 * floor } {
        return false;
    }
    p[0] += floor - sigma;
    if free.contains(&0) {
        free.retain(|&i| i != 0);
        remarks.push(format!(
            "a is held: fitted freely the surface falls to {:.2} mm at {z:.2} m; record views near that distance",
            1e3 * sigma
        ));
    }
    true
}

fn positive_in_range(rows: &Rows, spec: &dyn SigmaForm, p: &[f64]) -> bool {
    let good = |z, theta| {
        let sigma: f64 = spec.sigma(p, z, theta);
        sigma.is_finite() && sigma > 0.0
    };
    rows.iter().all(|r| good(r.z_m, r.theta_rad))
        && min_point(rows, spec, p).is_none_or(|(z, theta)| good(z, theta))
}

fn positive(sigma: f64, otherwise: f64) -> f64 {
    if sigma > 1e-3 * otherwise && sigma.is_finite() { sigma } else { otherwise }
}

fn describe_rows(table: &SigmaTable) -> String {
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
