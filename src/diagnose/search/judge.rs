//! What a candidate comes to on its own: what it brings, how large it is, and whether it can be meant.

use nalgebra::DVector;

use super::candidate::Candidate;
use super::evidence::{Evidence, Gain};
use super::noise_gains::NoiseGains;
use super::null::Null;
use super::outcome::Look;
use super::rules::Rules;
use crate::terms::Basis;

pub struct Judged {
    pub gain: Gain,
    pub null: Null,
    /// Can it be meant: of a sensible shape, and larger than what constant errors of the pixels
    /// make by chance.
    pub sensible: bool,
    pub rms: f64,
}

impl Judged {
    /// Nats that count against what noise brings.
    pub fn calibrated_gain(&self, rules: &Rules) -> f64 {
        self.null.calibrated_gain(self.gain.total, self.gain.by_view.len(), rules)
    }
}

/// A later term must be this large beside the largest, root mean square by root mean square.
pub const LEAST_OF_LARGEST: f64 = 0.06;

/// A pattern that stands still must be, in square, so much more than what a fit to nothing but the
/// pixels' own errors would make: seven times, for the best of many and for views that cover little
/// of the picture.
pub const CLEARLY_FIXED: f64 = 50.0;

/// What sizes are held against.
pub struct Judge<'a> {
    /// Of all samples.
    pub weight: f64,
    pub rules: &'a Rules,
    /// Root mean square of the largest term so far.
    pub largest: f64,
}

impl Judge<'_> {
    /// Root mean square of a candidate's fit over the samples, the nuisances taken out.
    pub fn rms(&self, basis: &Basis, m: usize, gain: &Gain, evidence: &[Evidence]) -> f64 {
        let k = basis.count();
        let beta = DVector::from_column_slice(own(gain, basis));
        let square: f64 =
            evidence.iter().map(|e| beta.dot(&(e.a.view((m, m), (k, k)) * &beta))).sum();
        (square / self.weight).max(0.0).sqrt()
    }

    pub fn sensible(&self, basis: &Basis, rms: f64) -> bool {
        let k = basis.count();
        if rms < LEAST_OF_LARGEST * self.largest {
            return false;
        }
        let Some((fixed, pixels)) = self.rules.fixed.filter(|_| basis.is_of_picture()) else {
            return true;
        };
        rms * rms > CLEARLY_FIXED * fixed * fixed * k as f64 / pixels
    }
}

pub fn looks(
    candidates: &[Candidate],
    judged: &[Option<Judged>],
    rules: &Rules,
    noise: &NoiseGains,
) -> Vec<Look> {
    let nameless = candidates.iter().zip(judged).filter(|(c, _)| c.family.is_none());
    nameless
        .filter_map(|(c, j)| {
            let j = j.as_ref()?;
            Some(Look {
                basis: c.basis.clone(),
                coefficients: own(&j.gain, &c.basis).to_vec(),
                p: noise.p(j.calibrated_gain(rules)),
            })
        })
        .collect()
}

/// A candidate's coefficients, which come last.
pub fn own<'a>(gain: &'a Gain, basis: &Basis) -> &'a [f64] {
    let beta = gain.beta.as_slice();
    &beta[beta.len() - basis.count()..]
}
