//! What noise alone brings for the best of all candidates.

use rayon::prelude::*;

use super::null::Null;
use crate::rng::Seed;

/// The greatest gains that noise alone brings, nats.
#[derive(Debug, Clone, Default)]
pub struct NoiseGains {
    ascending: Vec<f64>,
    /// Minimum mean excess of the tail: a few gains that happen to be close show too short a one.
    min_excess: f64,
}

/// Simulations of the null.
const REPLICATES: u64 = 600;
pub const MIN_EXCESS: f64 = 0.5;
/// Beyond this quantile the tail of a log likelihood falls as an exponential.
const TAIL: f64 = 0.1;

impl NoiseGains {
    pub fn of(nulls: &[&Null], seed: Seed) -> Self {
        NoiseGains::simulated(REPLICATES, MIN_EXCESS, |replicate| {
            let mut rng = seed.stream(&format!("diagnose/null/{replicate}"));
            nulls.iter().map(|null| null.draw(&mut rng)).fold(0.0, f64::max)
        })
    }

    /// `draw` gives the gain of one simulation by its number.
    pub fn simulated(
        replicates: u64,
        min_excess: f64,
        draw: impl Fn(u64) -> f64 + Send + Sync,
    ) -> Self {
        let mut ascending: Vec<f64> = (0..replicates).into_par_iter().map(draw).collect();
        ascending.sort_by(f64::total_cmp);
        NoiseGains { ascending, min_excess }
    }

    /// Was there anything to draw from?
    pub fn is_tested(&self) -> bool {
        !self.ascending.is_empty()
    }

    /// Noise is taken to bring next to nothing.
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

    /// Exceeded with probability `level`.
    pub fn threshold(&self, level: f64) -> f64 {
        if !self.is_tested() {
            return f64::INFINITY;
        }
        let (cut, mean_excess) = self.cut();
        cut + mean_excess * (TAIL / level).ln().max(0.0)
    }

    /// Chance of exceeding `gain`.
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
