//! Laws of distance error, fitted to views whose distance was measured by other means.

use nalgebra::DVector;

use super::referenced_view::{ReferencedView, Scatter, is_tilted};
use super::warm_up::warm_up;
use crate::diagnose::checks::replication::Halves;
use crate::diagnose::joint::anchor::Family;
use crate::diagnose::search::evidence::{Evidence, gain};
use crate::diagnose::search::null::Null;
use crate::solve::Cholesky;
use crate::stats::student_quantile;
use crate::terms::Axis;

/// A law of distance error.
pub struct Law {
    pub family: &'static str,
    pub axis: Axis,
    /// Range of the axis.
    pub reach: [f64; 2],
    /// RMS change of the depth, m and in sigmas.
    pub rms_m: f64,
    pub rms_sigma: f64,
    /// RMS of the part of it that no open constant imitates, m and in errors of a reference.
    pub beyond_m: f64,
    pub beyond_errors: f64,
    /// Parameters that determine its shape, each with its standard error.
    pub settled: Vec<(&'static str, [f64; 2])>,
    /// Nats.
    pub gain: f64,
    /// Coefficient and its standard error.
    pub estimate: [f64; 2],
    pub null: Null,
    /// Degrees of freedom of the estimate of the references' error.
    pub freedom: f64,
    /// Whether both halves of the references say the same.
    pub replicated: Option<bool>,
}

/// Fewest references; anything fits fewer.
pub const MIN_VIEWS: usize = 5;
/// Time constants of a warm-up, s.
const WARM_UPS: [f64; 6] = [60.0, 180.0, 480.0, 1200.0, 2400.0, 7200.0];

/// Views with a reference, and the nuisance columns fitted beside every law.
struct References<'a> {
    checked: &'a [ReferencedView],
    /// Shift of each view by one unit of each nuisance, m.
    others: Vec<Vec<f64>>,
    /// Number of the last of these that are open constants of biases.
    open: usize,
    scatter: Scatter,
}

impl<'a> References<'a> {
    fn of(checked: &'a [ReferencedView], bent_m: f64, open: &[Family]) -> Self {
        let angles = if is_tilted(checked) { 2 } else { 0 };
        let bent = (bent_m > 0.0).then_some(bent_m);
        let others = |c: &ReferencedView| -> Vec<f64> {
            let angles = c.slope[..angles].iter().map(|s| c.z * s);
            angles.chain(bent).chain(open.iter().map(|f| f.moves_m(c))).collect()
        };
        let scatter = Scatter::of(checked);
        let others = checked.iter().map(others).collect();
        References { checked, others, open: open.len(), scatter }
    }

    /// Evidence on the nuisances, and on a law that moves the views so far.
    fn evidence(&self, law: Option<&dyn Fn(&ReferencedView) -> f64>) -> Vec<Evidence> {
        let of = |(n, c): (usize, &ReferencedView)| {
            let law = law.map(|moves| moves(c));
            let g = DVector::from_iterator(
                self.others[n].len() + usize::from(law.is_some()),
                self.others[n].iter().copied().chain(law),
            );
            let variance = self.scatter.variances[n];
            Evidence { a: &g * g.transpose() / variance, b: g * (c.off / variance) }
        };
        self.checked.iter().enumerate().map(of).collect()
    }

    /// What the open constants, fitted to a law's `moves` with their prior, leave of them; `views` is the
    /// evidence on all nuisances and the law.
    fn beyond_constants(&self, views: &[Evidence], moves: &[f64]) -> Option<Vec<f64>> {
        let beside = self.others.first().map_or(0, Vec::len);
        let first = beside - self.open;
        let all = Evidence::sum(beside + 1, PRIOR, views).a;
        let own = all.view((first, first), (self.open, self.open)).into_owned();
        let with_law = all.view((first, beside), (self.open, 1)).column(0).into_owned();
        let imitation = Cholesky::of(own)?.solve(&with_law);
        let left = |(moves, others): (&f64, &Vec<f64>)| {
            let of = others[first..].iter().zip(imitation.iter());
            moves - of.map(|(constant, size)| constant * size).sum::<f64>()
        };
        Some(moves.iter().zip(&self.others).map(left).collect())
    }

    /// Fits the law that moves the depth by `moves` times its coefficient, m.
    fn law(
        &self,
        family: &'static str,
        axis: Axis,
        moves: impl Fn(&ReferencedView) -> f64,
    ) -> Option<Law> {
        let checked = self.checked;
        let beside = self.others.first().map_or(0, Vec::len);
        let views = self.evidence(Some(&moves));
        let moves: Vec<f64> = checked.iter().map(moves).collect();
        let beyond = self.beyond_constants(&views, &moves)?;
        let mut gain = gain(&views, PRIOR)?;
        if beside > 0 {
            gain.total -= self::gain(&self.evidence(None), PRIOR).map_or(0.0, |alone| alone.total);
        }
        let beta = gain.beta[beside];
        let rms = |of: &dyn Fn(usize) -> f64| {
            let squares: f64 = (0..checked.len()).map(|n| of(n).powi(2)).sum();
            (squares / checked.len() as f64).sqrt()
        };
        let second: Vec<bool> = checked.iter().map(|c| c.in_second_half).collect();
        let halves = Halves::of(&views, &second, PRIOR, &vec![1; beside + 1]);
        Some(Law {
            family,
            axis,
            reach: crate::stats::range(checked.iter().map(|c| match axis {
                Axis::SessionTime => c.session_s,
                _ => c.z,
            })),
            rms_m: rms(&|n| beta * moves[n]),
            rms_sigma: rms(&|n| beta * moves[n] / checked[n].sigma_m),
            beyond_m: rms(&|n| beta * beyond[n]),
            beyond_errors: rms(&|n| beta * beyond[n] / self.scatter.variances[n].sqrt()),
            settled: Vec::new(),
            gain: gain.total,
            estimate: [beta, gain.covariance[(beside, beside)].sqrt()],
            null: Null::of(&views, beside, PRIOR)?,
            freedom: self.scatter.freedom.max(1.0),
            replicated: halves.and_then(|h| h.replicate_beside(&[beside])),
        })
    }
}

/// Fits all laws, with their gains on references left out; none where there are too few references. `bent_m` is
/// the distance between a bent target and the place on it that was measured, the same at all distances; `open`
/// are biases with an undetermined constant, which cannot be told from an offset of the disparity.
pub fn laws(checked: &[ReferencedView], bent_m: f64, open: &[Family]) -> Vec<Law> {
    if checked.len() < MIN_VIEWS {
        return Vec::new();
    }
    let mut references = References::of(checked, bent_m, open);
    let mut laws = Vec::from_iter(references.law("depth-scale", Axis::Z, |c| c.without_law()));
    if open.is_empty() {
        laws.extend(references.law("disparity-offset", Axis::Z, ReferencedView::moved_by_a_px));
    }
    laws.extend(WARM_UPS.iter().filter_map(|tau| {
        let warm = |c: &ReferencedView| c.without_law() * (1.0 - (-c.session_s / tau).exp());
        references.law("thermal-drift", Axis::SessionTime, warm)
    }));
    // A variance estimated with few degrees of freedom makes a Student's t of a Gaussian: errors are stated so that
    // the usual multiples of them hold 90 %.
    let Scatter { variances, freedom } = &mut references.scatter;
    let wider = student_quantile(0.9, *freedom) / student_quantile(0.9, f64::INFINITY);
    laws.iter_mut().for_each(|law| law.estimate[1] *= wider);
    variances.iter_mut().for_each(|v| *v *= wider * wider);
    let session_s = checked.iter().map(|r| r.session_s).fold(0.0, f64::max);
    if let Some(warm_up) = warm_up(session_s, |moves| references.evidence(Some(moves))) {
        for law in laws.iter_mut().filter(|l| l.family == "thermal-drift") {
            law.estimate = warm_up.relative;
            law.settled = vec![("time_constant_s", warm_up.time_constant_s)];
        }
    }
    laws
}

/// Prior precision of a relative error of a few per cent, or an offset of a few px.
const PRIOR: f64 = 1.0;

#[cfg(test)]
#[path = "laws_tests.rs"]
mod tests;
