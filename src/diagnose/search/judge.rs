//! Assessment of a single candidate: its gain, its size, and whether it is plausible.

use super::candidate::Candidate;
use super::evidence::Gain;
use super::layer_null::{Group, LayerNull};
use super::null::Null;
use super::outcome::Look;
use super::rules::Rules;
use crate::terms::Basis;

pub struct Judged {
    pub gain: Gain,
    pub null: Null,
    /// Gains of simulated noise, nats; empty unless the layer's null is being simulated.
    pub of_noise: Vec<f64>,
    /// Large enough beside the largest term, and larger than what fixed errors of the pixels make by
    /// chance.
    pub sensible: bool,
    pub rms: f64,
}

impl Judged {
    /// Gain calibrated for comparison with the null distribution, nats.
    pub fn calibrated_gain(&self, rules: &Rules) -> f64 {
        self.null.calibrated_gain(self.gain.total, self.gain.by_view.len(), rules)
    }
}

pub fn looks(
    candidates: &[Candidate],
    judged: &[Option<Judged>],
    rules: &Rules,
    noise: &LayerNull,
) -> Vec<Look> {
    let nameless = candidates.iter().zip(judged).filter(|(c, _)| c.family.is_none());
    nameless
        .filter_map(|(c, j)| {
            let j = j.as_ref()?;
            Some(Look {
                basis: c.basis.clone(),
                coefficients: own(&j.gain, &c.basis).to_vec(),
                p: noise.p(Group::Other, j.calibrated_gain(rules)),
            })
        })
        .collect()
}

/// A candidate's coefficients, which come last.
pub fn own<'a>(gain: &'a Gain, basis: &Basis) -> &'a [f64] {
    let beta = gain.beta.as_slice();
    &beta[beta.len() - basis.count()..]
}
