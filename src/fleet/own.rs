//! Which units share a curve, and which have one of their own.

use serde::Serialize;

use super::curve::{Curve, same};

/// Chance that one comparison of units that are all the same says otherwise anywhere.
pub const LEVEL: f64 = 0.01;

/// Whether a unit shares what the others have in common.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Standing {
    pub unit: String,
    /// It differs from the others by more than the errors explain.
    pub is_own: bool,
    /// Times the number of tests of this question.
    pub p_adjusted: f64,
}

/// The units apart from the core one after the other, the clearest first: so a unit that differs does
/// not pull the mean that the next is held against. At the first step the chance of a false alarm is
/// `LEVEL` over `statistics`, and later steps are taken only when it was none. Each with how far it is
/// from the mean of the others of the core; of all others where there is no core.
pub(super) fn sort_out<'a>(
    names: impl Iterator<Item = &'a String>,
    curves: &[Curve],
    statistics: usize,
) -> Option<(Vec<Standing>, Vec<Curve>)> {
    // Two units are one comparison.
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
    // Of two that differ nobody knows which is the odd one.
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

/// Chance of unit `i` being as far from the mean of these units without it, and how far it is.
fn against(curves: &[Curve], units: &[usize], i: usize) -> Option<(f64, Curve)> {
    let others: Vec<&Curve> = units.iter().filter(|j| **j != i).map(|j| &curves[*j]).collect();
    let mean = Curve::mean(&others)?;
    Some((same(&[&curves[i], &mean])?, curves[i].minus(&mean)))
}
