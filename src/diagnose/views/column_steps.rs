//! Steps between columns, spaced differently in every view and found in each view's own image.

use serde_json::Map;
use statrs::statistics::Statistics;

use super::field::Field;
use super::known::KnownTerms;
use super::layers::second_half;
use crate::diagnose::diagnosis::{Finding, Size};
use crate::diagnose::finding::other_findings::named;
use crate::diagnose::finding::parameters::estimate;
use crate::measure::ColumnSteps;
use crate::stats::{median, range};
use crate::terms::{Axis, Statistic};

/// Least spread stated: even where all views agree, the firmware could have varied the period.
const MIN_SPREAD: f64 = 1.01;
const BANDING: &str = "column-banding";
/// Relative standard error of a step. It is one read-out step, known up to the disparity scale (0.6 % off
/// on a Kinect).
const STEP_ERROR: f64 = 0.01;

/// Finding of column steps, where views show them and the model does not have them.
pub(in crate::diagnose) fn column_steps(fields: &[Field], known: &KnownTerms) -> Option<Finding> {
    let seen: Vec<(&Field, ColumnSteps)> =
        fields.iter().filter_map(|f| Some((f, f.column_steps?))).collect();
    let known_of_views = known.parameter(BANDING, "spread").is_some_and(|s| s > 1.0);
    if known_of_views {
        return None;
    }
    // Smallest p-value of any view; Bonferroni-corrected below.
    let clearest = seen.iter().map(|(_, s)| s.p()).fold(1.0, f64::min);
    // One read-out step, of either sign.
    let step_px = seen.first()?.1.step_px.abs();
    let [shortest, longest] = range(seen.iter().map(|(_, s)| s.period_px));
    // RMS of a saw-tooth.
    let rms_px = step_px / 12f64.sqrt();
    let middle = |of: &dyn Fn(&Field) -> f64| {
        median(&mut seen.iter().map(|(f, _)| of(f)).collect::<Vec<f64>>())
    };
    let mm = middle(&|f| 1e3 * rms_px / f.plane.q.z.powi(2) / f.scale_px_m);
    let sigma = middle(&|f| f.middle_sigma_px().map_or(0.0, |s| rms_px / f64::from(s)));
    let second = second_half(fields);
    let of_half = |half: bool| {
        fields.iter().zip(&second).any(|(f, s)| *s == half && f.column_steps.is_some())
    };
    let mut parameters = Map::new();
    let amplitude_px = 0.5 * step_px;
    parameters.insert("amplitude_px".into(), estimate(amplitude_px, STEP_ERROR * amplitude_px));
    let logs = seen.iter().map(|(_, s)| s.period_px.ln());
    let period_px = logs.clone().mean().exp();
    let std_error = period_px * logs.std_dev() / (seen.len() as f64).sqrt();
    parameters.insert("period_px".into(), estimate(period_px, std_error));
    // Largest over smallest period: it depends on the number of views, so it has no standard error.
    parameters.insert("spread".into(), estimate((longest / shortest).max(MIN_SPREAD), f64::NAN));
    let plain = named(BANDING, Statistic::Bias, Axis::Column);
    Some(Finding {
        interval: [0.0, fields[0].width as f64],
        share: seen.iter().map(|(_, s)| 0.5 * s.t * s.t).sum(),
        physics: format!(
            "{} The steps lie {shortest:.0} to {longest:.0} px apart, differently in every view, with one in the middle of the picture; {} of {} views show them.",
            plain.physics,
            seen.len(),
            fields.len()
        ),
        parameters,
        size: Size { mm, sigma },
        p_adjusted: Some((clearest * fields.len() as f64).min(1.0)),
        replicated: Some(of_half(false) && of_half(true)),
        ..plain
    })
}
