//! Milliseconds, by the name of what took them.

/// In order of first appearance.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Stages(Vec<(&'static str, f64)>);

impl Stages {
    pub fn add(&mut self, name: &'static str, ms: f64) {
        match self.0.iter_mut().find(|(known, _)| *known == name) {
            Some((_, sum)) => *sum += ms,
            None => self.0.push((name, ms)),
        }
    }

    pub fn each(&self) -> impl Iterator<Item = (&'static str, f64)> + '_ {
        self.0.iter().copied()
    }

    pub fn total(&self) -> f64 {
        self.0.iter().map(|(_, ms)| ms).sum()
    }

    /// The median of each stage over frames.
    pub fn medians(all: &[Stages]) -> Stages {
        let mut lists: Vec<(&'static str, Vec<f64>)> = Vec::new();
        for (name, ms) in all.iter().flat_map(Stages::each) {
            match lists.iter_mut().find(|(known, _)| *known == name) {
                Some((_, list)) => list.push(ms),
                None => lists.push((name, vec![ms])),
            }
        }
        let median =
            |(name, mut list): (&'static str, Vec<f64>)| (name, crate::stats::median(&mut list));
        Stages(lists.into_iter().map(median).collect())
    }
}
