//! Null distribution of a layer's search.

use super::candidate::{Candidate, RECALIBRATE};
use super::judge::Judged;
use super::noise_gains::NoiseGains;

/// Candidates that are tested together. The catalogue's shapes are few and have few columns; changes of
/// sigma and nameless curves are many and wide. Each group is tested at half of the layer's level.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Group {
    Named,
    Other,
}

impl Group {
    pub const ALL: [Group; 2] = [Group::Named, Group::Other];

    pub fn of(candidate: &Candidate) -> Self {
        let named = candidate.family.is_some_and(|id| id != RECALIBRATE);
        if named { Group::Named } else { Group::Other }
    }
}

/// Largest gains under noise alone, of each group.
#[derive(Debug, Clone, Default)]
pub struct LayerNull([NoiseGains; 2]);

impl LayerNull {
    /// Of the candidates' gains of the same draws of noise.
    pub fn of(candidates: &[Candidate], judged: &[Option<Judged>]) -> Self {
        let largest = |group: Group| {
            let own = candidates.iter().zip(judged).filter(move |(c, _)| Group::of(c) == group);
            NoiseGains::of(own.filter_map(|(_, j)| Some(&j.as_ref()?.of_noise[..])))
        };
        LayerNull(Group::ALL.map(largest))
    }

    /// A null in which noise brings next to nothing.
    pub fn unknown() -> Self {
        LayerNull(Group::ALL.map(|_| NoiseGains::unknown()))
    }

    /// Whether any noise was simulated.
    pub fn is_tested(&self) -> bool {
        self.0.iter().any(NoiseGains::is_tested)
    }

    /// The same null for both groups.
    #[cfg(test)]
    pub fn same(gains: &NoiseGains) -> Self {
        LayerNull(Group::ALL.map(|_| gains.clone()))
    }

    /// Gain in `group` for which noise, in either, has the chance `level`.
    pub fn threshold(&self, group: Group, level: f64) -> f64 {
        self.0[group as usize].threshold(level / Group::ALL.len() as f64)
    }

    /// Chance that noise, in either group, brings what is as rare as `gain` is in `group`.
    pub fn p(&self, group: Group, gain: f64) -> f64 {
        (Group::ALL.len() as f64 * self.0[group as usize].p(gain)).min(1.0)
    }
}
