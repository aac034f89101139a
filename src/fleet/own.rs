//! Sorts units into those that share a curve and those with their own.

use serde::Serialize;

use super::curve::{Curve, same};

/// Probability that one comparison of identical units raises any false alarm.
pub const LEVEL: f64 = 0.01;

/// Whether a unit shares the common curve.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Standing {
    pub unit: String,
    /// The unit differs from the others by more than the errors explain.
    pub is_own: bool,
    /// p-value times the number of tests of this question.
    pub p_adjusted: f64,
}

/// Removes units from the core one at a time, the most significant first, so that a deviating unit does not
/// bias the mean that the next is compared with. The first step has a false-alarm probability of `LEVEL` over
/// `statistics`; later steps follow only after a detection. Also returns each unit's difference from the mean
/// of the other units of the core, or of all others if there is no core.
pub(super) fn sort_out<'a>(
    names: impl Iterator<Item = &'a String>,
    curves: &[Curve],
    statistics: usize,
) -> Option<(Vec<Standing>, Vec<Curve>)> {
    // Two units make one comparison.
    let of_units = if curves.len() == 2 { 1 } else { curves.len() };
    let tests = (of_units * statistics) as f64;
    let all: Vec<usize> = (0..curves.len()).collect();
    let mut core = all.clone();
    while core.len() > 2 {
        let tried: Vec<(usize, f64)> =
            core.iter().map(|&i| Some((i, against(curves, &core, i)?.0))).collect::<Option<_>>()?;
        let (clearest, p) = tried.into_iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
        if p * tests >= LEVEL {
            break;
        }
        core.retain(|i| *i != clearest);
    }
    // If two units differ, it is unknown which is the odd one.
    if let [a, b] = core[..]
        && same(&[&curves[a], &curves[b]])? * tests < LEVEL
    {
        core.clear();
    }
    let one = |(i, unit): (usize, &String)| {
        let (p, departure) = against(curves, if core.is_empty() { &all } else { &core }, i)?;
        let (is_own, p_adjusted) = (!core.contains(&i), (p * tests).min(1.0));
        Some((Standing { unit: unit.clone(), is_own, p_adjusted }, departure))
    };
    names.enumerate().map(one).collect()
}

/// p-value of unit `i` against the mean of the other `units`, and its difference from that mean.
fn against(curves: &[Curve], units: &[usize], i: usize) -> Option<(f64, Curve)> {
    let others: Vec<&Curve> = units.iter().filter(|j| **j != i).map(|j| &curves[*j]).collect();
    let mean = Curve::mean(&others)?;
    Some((same(&[&curves[i], &mean])?, curves[i].minus(&mean)))
}
