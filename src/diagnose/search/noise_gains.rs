//! Null distribution of the best candidate's gain.

use rayon::prelude::*;

/// Largest gains of all candidates under noise alone, nats.
#[derive(Debug, Clone, Default)]
pub struct NoiseGains {
    ascending: Vec<f64>,
    /// Lower bound on the tail's mean excess: a few gains that happen to be close give too small a one.
    min_excess: f64,
}

/// Simulations of the null.
pub const REPLICATES: usize = 600;
pub const MIN_EXCESS: f64 = 0.5;
/// Upper-tail probability beyond which a log-likelihood is taken to fall off exponentially.
const TAIL: f64 = 0.1;

impl NoiseGains {
    /// Of the gains that all candidates have of the same draws of noise.
    pub fn of<'a>(candidates: impl Iterator<Item = &'a [f64]>) -> Self {
        let all: Vec<&[f64]> = candidates.collect();
        NoiseGains::simulated(REPLICATES as u64, MIN_EXCESS, |draw| {
            all.iter().map(|gains| gains[draw as usize]).fold(0.0, f64::max)
        })
    }

    /// `draw` returns the gain of one simulation, given its number.
    pub fn simulated(
        replicates: u64,
        min_excess: f64,
        draw: impl Fn(u64) -> f64 + Send + Sync,
    ) -> Self {
        let mut ascending: Vec<f64> = (0..replicates).into_par_iter().map(draw).collect();
        ascending.sort_by(f64::total_cmp);
        NoiseGains { ascending, min_excess }
    }

    /// Whether there are any simulated gains.
    pub fn is_tested(&self) -> bool {
        !self.ascending.is_empty()
    }

    /// A null in which noise brings next to nothing.
    pub fn unknown() -> Self {
        NoiseGains { ascending: vec![0.0], min_excess: MIN_EXCESS }
    }

    /// Where the tail begins, and its mean excess.
    fn cut(&self) -> (f64, f64) {
        let gains = &self.ascending;
        let cut = gains[((gains.len() - 1) as f64 * (1.0 - TAIL)) as usize];
        let tail: Vec<f64> = gains.iter().filter(|g| **g > cut).map(|g| g - cut).collect();
        let mean_excess = tail.iter().sum::<f64>() / tail.len().max(1) as f64;
        (cut, mean_excess.max(self.min_excess))
    }

    /// Gain that noise exceeds with probability `level`; infinite where nothing was simulated.
    pub fn threshold(&self, level: f64) -> f64 {
        if !self.is_tested() {
            return f64::INFINITY;
        }
        let (cut, mean_excess) = self.cut();
        cut + mean_excess * (TAIL / level).ln().max(0.0)
    }

    /// Chance that noise exceeds `gain`; 1 where nothing was simulated.
    pub fn p(&self, gain: f64) -> f64 {
        if !self.is_tested() {
            return 1.0;
        }
        let (cut, mean_excess) = self.cut();
        if gain > cut {
            return TAIL * (-(gain - cut) / mean_excess).exp();
        }
        let gains = &self.ascending;
        let above = gains.len() - gains.partition_point(|g| *g < gain);
        (above as f64 / gains.len() as f64).max(TAIL)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thresholds_and_chances_are_each_others_inverse() {
        let gains = NoiseGains::simulated(600, 0.5, |k| -(1.0 - (k + 1) as f64 / 601.0).ln());
        // Exponential: exceeded with probability exp(-g).
        for level in [0.05, 0.01, 1e-3, 1e-5] {
            let threshold = gains.threshold(level);
            assert!((gains.p(threshold) / level - 1.0).abs() < 1e-9, "{level}");
            assert!((threshold / -level.ln() - 1.0).abs() < 0.08, "{level}: {threshold}");
        }
        assert!(gains.p(0.0) > 0.9 && gains.p(0.0) <= 1.0);
        assert!(NoiseGains::default().threshold(0.05) == f64::INFINITY);
        assert!(NoiseGains::default().p(1e9) == 1.0);
    }
}
