//! Results of a search.

use super::candidate::Candidate;
use super::evidence::{Evidence, Gain};
use super::layer_null::LayerNull;
use crate::diagnose::checks::replication::Halves;
use crate::model::Covariance;
use crate::terms::Basis;

/// A family that competes with the chosen one.
#[derive(Debug, Clone)]
pub struct Rival {
    pub family: &'static str,
    pub basis: Basis,
    /// Nats over the terms before, divided by the root of the views' dispersion beyond chance.
    pub gain: f64,
    /// How far behind the chosen one, in standard errors over the views.
    pub behind: f64,
}

/// A term that was accepted.
#[derive(Debug, Clone)]
pub struct Chosen {
    pub candidate: Candidate,
    /// Root mean square, in the response's unit.
    pub rms: f64,
    /// Share of the best curve's gain that its name had to reach.
    pub adequacy: f64,
    /// Nats over the terms before it.
    pub gain: f64,
    /// Gain of the best nameless curve at the same step, nats.
    pub best_curve: f64,
    /// All families at this step, best first, including the chosen one if it has a name.
    pub rivals: Vec<Rival>,
    /// P-value under noise alone, corrected for all candidates of this layer.
    pub p: f64,
}

impl Chosen {
    /// A term that has no rivals and is not tested.
    pub fn of(candidate: Candidate) -> Self {
        let (rms, adequacy, gain, best_curve) = (0.0, 0.0, 0.0, 0.0);
        Chosen { candidate, rms, adequacy, gain, best_curve, rivals: Vec::new(), p: 1.0 }
    }
}

/// Fit of a single nameless curve before any term is chosen.
#[derive(Debug, Clone)]
pub struct Look {
    pub basis: Basis,
    pub coefficients: Vec<f64>,
    pub p: f64,
}

/// All terms of a layer with their common fit.
#[derive(Default)]
pub struct Outcome {
    pub chosen: Vec<Chosen>,
    /// Every nameless curve on its own, fitted to the original data.
    pub looks: Vec<Look>,
    /// Fit of all terms at once.
    pub fit: Option<Gain>,
    pub evidence: Vec<Evidence>,
    pub noise: LayerNull,
    /// All terms fitted to each half of the views.
    pub halves: Option<Halves>,
    /// Covariance of all coefficients.
    pub covariance: Covariance,
}

impl Outcome {
    /// Range of the coefficients of term `k` in the common fit.
    pub fn span(&self, k: usize) -> std::ops::Range<usize> {
        let first = self.chosen[..k].iter().map(|c| c.candidate.basis.count()).sum();
        first..first + self.chosen[k].candidate.basis.count()
    }

    /// Adds the halves' fits; `second` says which half each view is in.
    pub fn halved(mut self, second: &[bool], prior: f64) -> Self {
        let counts: Vec<usize> = self.chosen.iter().map(|c| c.candidate.basis.count()).collect();
        self.halves = Halves::of(&self.evidence, second, prior, &counts);
        self
    }

    pub fn coefficients(&self, k: usize) -> Vec<f64> {
        let span = self.span(k);
        self.fit.as_ref().map_or_else(Vec::new, |f| f.beta.as_slice()[span].to_vec())
    }
}

/// Bases of all chosen terms, in order.
pub fn bases(chosen: &[Chosen]) -> Vec<&Basis> {
    bases_where(chosen, |_| true)
}

pub fn bases_where(chosen: &[Chosen], which: impl Fn(&Candidate) -> bool) -> Vec<&Basis> {
    chosen.iter().map(|c| &c.candidate).filter(|c| which(c)).map(|c| &c.basis).collect()
}
