//! Laws that distances may be off by, fitted to views whose distance was measured by other means.

use nalgebra::DVector;

use super::referenced_view::{ReferencedView, is_tilted, scatter};
use super::warm_up::warm_up;
use crate::diagnose::checks::replication::agree;
use crate::diagnose::joint::anchor::Family;
use crate::diagnose::noise::view_mean::ViewMean;
use crate::diagnose::search::evidence::{Evidence, gain};
use crate::diagnose::search::null::Null;
use crate::terms::Axis;

/// A law that the distances may be off by.
pub struct Law {
    pub family: &'static str,
    pub axis: Axis,
    /// Of the axis.
    pub reach: [f64; 2],
    /// What it makes of the depth, m and in sigmas.
    pub rms_m: f64,
    pub rms_sigma: f64,
    /// Of one reference, m.
    pub error_m: f64,
    /// What settles its shape, each with its standard error.
    pub settled: Vec<(&'static str, [f64; 2])>,
    /// Nats.
    pub gain: f64,
    /// Its coefficient, and the standard error.
    pub estimate: [f64; 2],
    pub null: Null,
    /// Degrees of freedom that the references' own error was measured with.
    pub freedom: f64,
    /// Both halves of the references say the same.
    pub replicated: Option<bool>,
}

/// Fewer references than this can be fitted by anything.
pub const FEWEST: usize = 5;
/// Time constants of a warm-up, s.
const WARM_UPS: [f64; 6] = [60.0, 180.0, 480.0, 1200.0, 2400.0, 7200.0];

/// What else distances may be off by.
#[derive(Default)]
pub struct Nuisances {
    /// How far a bent target may lie from the place on it that was measured, at any distance, m.
    pub bent_m: f64,
    /// Biases whose constants are open: an offset of the disparity cannot be told from them.
    pub open: Vec<Family>,
}

/// All laws, with what each gains on references left out; none where there are too few.
pub fn laws(checked: &[ReferencedView], Nuisances { bent_m, open }: &Nuisances) -> Vec<Law> {
    if checked.len() < FEWEST {
        return Vec::new();
    }
    let angles = if is_tilted(checked) { 2 } else { 0 };
    let bent = (*bent_m > 0.0).then_some(*bent_m);
    let others = |c: &ReferencedView| -> Vec<f64> {
        let angles = c.slope[..angles].iter().map(|s| c.z * s);
        angles.chain(bent).chain(open.iter().map(|f| f.moves_m(c))).collect()
    };
    let beside = angles + usize::from(bent.is_some()) + open.len();
    let (variance, free) = scatter(checked);
    let mut laws = Vec::new();
    let mut add = |family, axis, column: &dyn Fn(&ReferencedView) -> f64| {
        let evidence = |with: bool| -> Vec<Evidence> {
            let of = |c: &ReferencedView| {
                let mut g = others(c);
                g.extend(with.then(|| column(c)));
                let g = DVector::from_vec(g);
                Evidence { a: &g * g.transpose() / variance, b: g * (c.off / variance) }
            };
            checked.iter().map(of).collect()
        };
        let views = evidence(true);
        let alone = if beside > 0 { gain(&evidence(false), PRIOR) } else { None };
        if let (Some(mut gain), Some(null)) = (gain(&views, PRIOR), Null::of(&views, beside, PRIOR))
        {
            if let Some(alone) = alone {
                gain.total -= alone.total;
            }
            let beta = gain.beta[beside];
            let beta_error = gain.covariance[(beside, beside)].sqrt();
            let n = checked.len() as f64;
            let square = |of: &dyn Fn(&ReferencedView) -> f64| {
                (checked.iter().map(|c| of(c).powi(2)).sum::<f64>() / n).sqrt()
            };
            let shift = |c: &ReferencedView| beta * column(c);
            let reach = crate::stats::range(checked.iter().map(|c| match axis {
                Axis::SessionTime => c.session_s,
                _ => c.z,
            }));
            let (rms_m, rms_sigma) = (square(&shift), square(&|c| shift(c) / c.sigma_m));
            // The others as all references have them.
            let sizes = &gain.beta.as_slice()[..beside];
            let moved = |c: &ReferencedView| -> f64 {
                sizes.iter().zip(others(c)).map(|(size, column)| size * column).sum()
            };
            let half = |second: bool| {
                let mine = checked.iter().filter(|c| c.in_second_half == second);
                ViewMean::of_scores(mine.map(|c| {
                    let g = column(c);
                    (g * g / variance, g * (c.off - moved(c)) / variance)
                }))
            };
            let replicated = agree([half(false), half(true)]);
            let error_m = variance.sqrt();
            let freedom = free.max(1.0);
            laws.push(Law {
                family,
                axis,
                reach,
                rms_m,
                rms_sigma,
                error_m,
                settled: Vec::new(),
                gain: gain.total,
                estimate: [beta, beta_error],
                null,
                freedom,
                replicated,
            });
        }
    };
    add("depth-scale", Axis::Z, &|c| c.z);
    // An offset of the disparity by delta px moves the depth by -z^2 delta / (f b).
    if open.is_empty() {
        add("disparity-offset", Axis::Z, &|c| -c.z * c.z / c.px_m);
    }
    for tau in WARM_UPS {
        add("thermal-drift", Axis::SessionTime, &|c| c.z * (1.0 - (-c.session_s / tau).exp()));
    }
    // The variance was measured with few degrees of freedom: a Student's t in place of a Gaussian.
    let widened = variance * free / (free - 2.0).max(1.0);
    if let Some(warm_up) = warm_up(checked, &others, widened) {
        for law in laws.iter_mut().filter(|l| l.family == "thermal-drift") {
            law.estimate = warm_up.relative;
            law.settled = vec![("time_constant_s", warm_up.time_constant_s)];
        }
    }
    laws
}

/// A relative error of a few percent, an offset of a few px.
const PRIOR: f64 = 1.0;

#[cfg(test)]
#[path = "laws_tests.rs"]
mod tests;
