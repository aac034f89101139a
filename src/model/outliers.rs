//! Removes outlying sigmas, such as a bin that caught a neighbouring object or a view of another target.
//! The search starts from robust surfaces (one per form, because the stiff ones cannot follow an outlier
//! among a few steep views), rejects outliers and refits until nothing changes, and takes the result with
//! the least bounded loss.

use super::fit::fit_all;
use super::forms::Form;
use super::robust::{self, Surface, spread};
use super::statistics::SigmaFit;
use crate::error::Result;
use crate::measure::{SigmaRow, SigmaTable};
use crate::units::verb;

/// Threshold in robust standard deviations of ln(measured/fitted). Measured in tests/product/outliers.rs:
/// under 1 % of clean tables of 30 rows lose a row (the scale is a median of few values and sometimes
/// small); where n is known, none of 4,000 (the scale is at least that of sampling).
const OFF: f64 = 5.0;
/// Excess of chi-square over its mean, in standard deviations, that sampling alone gives once in a thousand
/// tables (normal quantile of 0.999). Below it there is nothing to search for.
const PLAINLY_NOISE: f64 = 3.09;
/// A larger share of outliers means a wrong form, and nothing is left out.
const MAX_SHARE: f64 = 0.2;
const MAX_ROUNDS: usize = 6;
/// Fewest rows beyond the parameters for a scale from the median of residuals.
const MIN_SPARE_ROWS: f64 = 6.0;

/// The forms against which outliers are judged, the most flexible first, so that a misfit of the requested
/// form does not make outliers.
const JUDGES: [Form; 4] = [Form::Paper, Form::Nguyen, Form::Disparity, Form::Khoshelham];

/// A table without its outliers, on which all forms are fitted and compared.
#[derive(Debug, Clone, PartialEq)]
pub struct Sorted {
    pub kept: SigmaTable,
    pub left_out: Vec<SigmaRow>,
    /// A remark about the rows left out, or about too many outliers.
    pub remark: Option<String>,
    /// The judging form's fit to the rows kept.
    judged_by: Option<SigmaFit>,
}

impl Sorted {
    /// Fits `form` to the rows kept.
    /// Fails when they are too few or at too few distances for the form, or the solver finds no surface that
    /// is positive over their range.
    pub fn fit(&self, form: Form) -> Result<SigmaFit> {
        let mut fitted = match &self.judged_by {
            Some(fitted) if fitted.form == form => fitted.clone(),
            _ => fit_all(&self.kept, form)?,
        };
        fitted.remarks.splice(0..0, self.remark.clone());
        Ok(fitted)
    }
}

/// Removes outliers from the most flexible surface that can be fitted to the rest.
pub fn sort_out(table: &SigmaTable) -> Sorted {
    JUDGES.into_iter().find_map(|form| judged(table, form)).unwrap_or_else(|| all(table, None))
}

fn all(table: &SigmaTable, judged_by: Option<SigmaFit>) -> Sorted {
    Sorted { kept: table.clone(), left_out: Vec::new(), remark: None, judged_by }
}

fn judged(table: &SigmaTable, form: Form) -> Option<Sorted> {
    let whole = fit_all(table, form).ok();
    if whole.as_ref().is_some_and(|w| nothing_to_look_for(table, w)) {
        return Some(all(table, whole));
    }
    let mut ends = Vec::new();
    for start in JUDGES.into_iter().skip_while(|judge| *judge != form) {
        let end = robust::surface(table, start).and_then(|s| rejected(table, form, s));
        let Some(end) = end else { continue };
        let done = nothing_to_look_for(&without(table, &end.off), &end.fitted);
        ends.push(end);
        if done {
            break;
        }
    }
    let Some(best) = min_cost(table, ends) else {
        return whole.map(|w| all(table, Some(w)));
    };
    if best.off.len() as f64 > MAX_SHARE * table.rows.len() as f64 {
        return Some(Sorted { remark: Some(too_many(table, &best.off)), ..all(table, whole) });
    }
    Some(Sorted {
        kept: without(table, &best.off),
        remark: (!best.off.is_empty()).then(|| describe(table, &best.off)),
        left_out: best.off.iter().map(|&i| table.rows[i]).collect(),
        judged_by: Some(best.fitted),
    })
}

/// Converged result of the rejection from one start.
struct End {
    off: Vec<usize>,
    surface: Surface,
    fitted: SigmaFit,
}

/// Rejects outliers from `surface`, refits and repeats until nothing changes; `None` if it cannot.
fn rejected(table: &SigmaTable, form: Form, mut surface: Surface) -> Option<End> {
    let mut off = standing_off(table, &surface, &[]);
    for _ in 0..MAX_ROUNDS {
        let fitted = fit_all(&without(table, &off), form).ok()?;
        surface = Surface::of(table, form, &fitted.values(), fitted.free());
        let next = standing_off(table, &surface, &off);
        if next == off {
            return Some(End { off, surface, fitted });
        }
        off = next;
    }
    None
}

/// The end with the least bounded loss, the sum of min(t^2, OFF^2) over *all* rows at the smallest scale of
/// any end. A surface bent towards an outlier costs more at its neighbours than it gains at the outlier,
/// and one that left out good rows pays for each.
fn min_cost(table: &SigmaTable, ends: Vec<End>) -> Option<End> {
    let scales: Vec<Vec<f64>> =
        ends.iter().map(|e| spread(table, &e.surface, |i| !e.off.contains(&i))).collect();
    let min_scales =
        scales.into_iter().min_by(|a, b| a.iter().sum::<f64>().total_cmp(&b.iter().sum()))?;
    let cost = |end: &End| -> f64 {
        let t = table.rows.iter().zip(&end.surface.sigma).zip(&min_scales);
        t.map(|((r, sigma), scale)| ((r.sigma_m / sigma).ln() / scale).powi(2).min(OFF * OFF)).sum()
    };
    ends.into_iter().min_by(|a, b| cost(a).total_cmp(&cost(b)))
}

/// Whether there are too few rows to judge, or sampling explains the residuals: no single row is off (the
/// robust scale is never below sampling), and their sum does not exceed what sampling allows, as it would
/// if an outlier had bent the surface.
fn nothing_to_look_for(table: &SigmaTable, fitted: &SigmaFit) -> bool {
    let surface = Surface::of(table, fitted.form, &fitted.values(), fitted.free());
    let spare = table.rows.len() as f64 - surface.free as f64;
    if spare < MIN_SPARE_ROWS {
        return true;
    }
    let square = |(r, sigma): (&SigmaRow, &f64)| {
        r.n_effective.map_or(f64::INFINITY, |n| 2.0 * n * (r.sigma_m / sigma).ln().powi(2))
    };
    let squares = || table.rows.iter().zip(&surface.sigma).map(square);
    squares().all(|t2| t2 <= OFF * OFF)
        && squares().sum::<f64>() <= spare + PLAINLY_NOISE * (2.0 * spare).sqrt()
}

fn without(table: &SigmaTable, off: &[usize]) -> SigmaTable {
    let rows = table.rows.iter().enumerate().filter(|(i, _)| !off.contains(i));
    SigmaTable { rows: rows.map(|(_, r)| *r).collect() }
}

/// Indices of the outlying rows, by the scale of those not left out.
fn standing_off(table: &SigmaTable, surface: &Surface, left_out: &[usize]) -> Vec<usize> {
    let spread = spread(table, surface, |i| !left_out.contains(&i));
    (0..table.rows.len())
        .filter(|&i| {
            let t = (table.rows[i].sigma_m / surface.sigma[i]).ln() / spread[i];
            t.is_nan() || t.abs() > OFF
        })
        .collect()
}

fn too_many(table: &SigmaTable, off: &[usize]) -> String {
    format!(
        "{} of {} sigmas {} more than {OFF} robust standard deviations off the surface: too many to be outliers, and none was left out; look for views of another target in measurements.csv, or try --form auto",
        off.len(),
        table.rows.len(),
        verb(off.len(), "stands", "stand")
    )
}

fn describe(table: &SigmaTable, left_out: &[usize]) -> String {
    const SHOWN: usize = 6;
    let place = |&i: &usize| {
        let SigmaRow { z_m, theta_rad, sigma_m, .. } = table.rows[i];
        let (mm, degrees) = (1e3 * sigma_m, theta_rad.to_degrees());
        format!("{mm:.1} mm at {z_m:.2} m, {degrees:.0} degrees")
    };
    let mut places: Vec<String> = left_out.iter().take(SHOWN).map(place).collect();
    if left_out.len() > SHOWN {
        places.push("...".into());
    }
    let verbs = verb(left_out.len(), "was left", "were left");
    format!(
        "{} of {} sigmas {verbs} out of the fit, more than {OFF} robust standard deviations off the surface: {}",
        left_out.len(),
        table.rows.len(),
        places.join("; ")
    )
}
