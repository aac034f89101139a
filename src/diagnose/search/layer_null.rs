//! Null distribution of a layer's search.

use super::candidate::{Candidate, RECALIBRATE};
use super::noise_gains::NoiseGains;

/// Candidates that are tested together. The catalogue's shapes are few and have few columns; changes of
/// sigma and nameless curves are many and wide.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Group {
    Named,
    Other,
}

impl Group {
    const ALL: [Group; 2] = [Group::Named, Group::Other];

    pub fn of(candidate: &Candidate) -> Self {
        let named = candidate.family.is_some_and(|id| id != RECALIBRATE);
        if named { Group::Named } else { Group::Other }
    }
}

/// Largest gains under noise alone, by group.
#[derive(Debug, Clone, Default)]
pub struct LayerNull {
    gains: [NoiseGains; 2],
    /// Number of groups that have candidates; they share the layer's level.
    groups: usize,
}

impl LayerNull {
    /// Of each candidate's gains of simulated noise.
    pub fn of<'a>(candidates: impl Iterator<Item = (Group, &'a [f64])>) -> Self {
        let all: Vec<(Group, &[f64])> = candidates.collect();
        let own = |group| all.iter().filter(move |(of, _)| *of == group).map(|(_, gains)| *gains);
        LayerNull {
            gains: Group::ALL.map(|group| NoiseGains::of(own(group))),
            groups: Group::ALL.into_iter().filter(|group| own(*group).next().is_some()).count(),
        }
    }

    /// A null in which noise brings next to nothing.
    pub fn unknown() -> Self {
        LayerNull::same(&NoiseGains::unknown())
    }

    /// The same null for both groups.
    pub fn same(gains: &NoiseGains) -> Self {
        LayerNull { gains: Group::ALL.map(|_| gains.clone()), groups: Group::ALL.len() }
    }

    /// Whether any noise was simulated.
    pub fn is_tested(&self) -> bool {
        self.gains.iter().any(NoiseGains::is_tested)
    }

    /// Threshold of a gain in `group`, at this group's part of the layer's `level` (Bonferroni).
    pub fn threshold(&self, group: Group, level: f64) -> f64 {
        self.gains[group as usize].threshold(level / self.parts())
    }

    /// P-value of a gain in `group`, corrected for the number of groups (Bonferroni).
    pub fn p(&self, group: Group, gain: f64) -> f64 {
        (self.parts() * self.gains[group as usize].p(gain)).min(1.0)
    }

    fn parts(&self) -> f64 {
        self.groups.max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::search::noise_gains::REPLICATES;

    fn exponential(scale: f64) -> Vec<f64> {
        let gain = |k: usize| -scale * (1.0 - (k + 1) as f64 / (REPLICATES + 1) as f64).ln();
        (0..REPLICATES).map(gain).collect()
    }

    /// A candidate that is another one again adds no noise; independent noise would raise the threshold.
    #[test]
    fn a_candidate_given_twice_costs_nothing() {
        let (named, other) = (exponential(1.0), exponential(2.0));
        let once = [(Group::Named, &named[..]), (Group::Other, &other[..])];
        let twice = [once[0], once[1], once[0], once[1]];
        let [once, twice] = [&once[..], &twice].map(|all| LayerNull::of(all.iter().copied()));
        for group in Group::ALL {
            for level in [0.05, 0.01, 1e-3] {
                let threshold = once.threshold(group, level);
                assert_eq!(threshold, twice.threshold(group, level));
                approx::assert_relative_eq!(once.p(group, threshold), level, max_relative = 1e-9);
            }
        }
        let alone = LayerNull::of([(Group::Named, &named[..])].into_iter());
        assert!(alone.threshold(Group::Named, 0.01) < once.threshold(Group::Named, 0.01));
    }
}
