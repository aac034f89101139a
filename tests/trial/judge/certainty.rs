//! Whether stated probabilities come true.

use serde::{Deserialize, Serialize};

use super::marks::Stated;

/// Probabilities between two borders.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Bin {
    pub low: f64,
    pub high: f64,
    pub n: usize,
    /// Mean of what was stated.
    pub stated: f64,
    /// Share that was right.
    pub right: f64,
}

/// Reliability of the names' probabilities.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Certainty {
    pub n: usize,
    /// Expected calibration error: mean distance of stated and right over the bins, by their counts.
    pub ece: Option<f64>,
    /// Mean square of probability less outcome.
    pub brier: Option<f64>,
    /// Those that hold something.
    pub bins: Vec<Bin>,
}

const BINS: usize = 10;

impl Certainty {
    pub fn of<'a>(stated: impl Iterator<Item = &'a Stated>) -> Self {
        let mut sums = [(0usize, 0.0f64, 0usize); BINS];
        let (mut n, mut squares) = (0usize, 0.0);
        for s in stated {
            let p = s.probability.clamp(0.0, 1.0);
            let bin = &mut sums[((p * BINS as f64) as usize).min(BINS - 1)];
            *bin = (bin.0 + 1, bin.1 + p, bin.2 + usize::from(s.right));
            n += 1;
            squares += (p - f64::from(u8::from(s.right))).powi(2);
        }
        let bins: Vec<Bin> = sums
            .iter()
            .enumerate()
            .filter(|(_, b)| b.0 > 0)
            .map(|(i, b)| Bin {
                low: i as f64 / BINS as f64,
                high: (i + 1) as f64 / BINS as f64,
                n: b.0,
                stated: b.1 / b.0 as f64,
                right: b.2 as f64 / b.0 as f64,
            })
            .collect();
        let off = bins.iter().map(|b| b.n as f64 * (b.stated - b.right).abs()).sum::<f64>();
        let mean = |sum: f64| (n > 0).then(|| sum / n as f64);
        Certainty { n, ece: mean(off), brier: mean(squares), bins }
    }
}
