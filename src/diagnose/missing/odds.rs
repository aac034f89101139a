//! Log odds of lost shares, and what counting does to them in patches of few readings.

use statrs::distribution::{Binomial, Discrete};

/// Losses below this share are indistinguishable.
const HARDLY: f64 = 0.002;

/// Log odds of a share, flattened near 0 and 1.
pub fn odds(share: f64) -> f64 {
    ((share + HARDLY) / (1.0 - share + HARDLY)).ln()
}

/// Inverse of [`odds`].
pub fn share(odds: f64) -> f64 {
    let e = odds.exp();
    (((1.0 + HARDLY) * e - HARDLY) / (1.0 + e)).clamp(0.0, 1.0)
}

/// Standard deviations over which the mean of a count's log odds is summed.
const WIDE: f64 = 8.0;

/// Readings lost, and kept, from which the second-order term is the bias to 1e-4.
const MANY: f64 = 50.0;

/// Log odds of a counted share, less those of the share itself.
#[derive(Debug, Clone, Copy, Default)]
pub struct Counting {
    /// Mean. A logarithm's mean is below the logarithm of the mean: by 0.3 where one reading of 200 is lost, and
    /// by a tenth of that in patches ten times as large.
    pub bias: f64,
    pub median: f64,
    pub variance: f64,
}

impl Counting {
    /// Of a `share` where `asked` readings are lost independently, or so many `together`.
    pub fn of(share: f64, asked: f64, together: f64) -> Self {
        let events = (asked / together).round().max(1.0);
        let (mean, kept) = (share * events, (1.0 - share) * events);
        if mean > MANY && kept > MANY {
            let [lost, kept] = [share, 1.0 - share].map(|s| (s + HARDLY).recip());
            let of_share = share * (1.0 - share) / events;
            let bias = 0.5 * of_share * (kept * kept - lost * lost);
            return Counting { bias, median: 0.0, variance: of_share * (lost + kept).powi(2) };
        }
        let Ok(count) = Binomial::new(share, events as u64) else { return Counting::default() };
        let reach = WIDE * (share * kept).sqrt() + WIDE;
        let [first, last] = [(mean - reach).max(0.0), (mean + reach).min(events)].map(|k| k as u64);
        let (mut moments, mut below, mut median) = ([0.0; 2], 0.0, None);
        for k in first..=last {
            let (p, off) = (count.pmf(k), odds(k as f64 / events) - odds(share));
            below += p;
            moments = [moments[0] + p * off, moments[1] + p * off * off];
            median = median.or((below >= 0.5).then_some(off));
        }
        let [bias, square] = moments;
        let variance = (square - bias * bias).max(0.0);
        Counting { bias, median: median.unwrap_or(0.0), variance }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Seed;
    use crate::stats::median;
    use rand_distr::Distribution;

    fn bias(share: f64, asked: f64, together: f64) -> f64 {
        Counting::of(share, asked, together).bias
    }

    /// Whatever the number of readings, the mean of the corrected log odds is that of the share, and so are their
    /// median and variance.
    #[test]
    fn small_patches_do_not_seem_to_lose_less() {
        let mut rng = Seed(5).stream("odds");
        for (lost, asked) in
            [(0.005, 64.0), (0.005, 320.0), (0.02, 32.0), (0.02, 1600.0), (0.5, 32.0)]
        {
            let count = rand_distr::Binomial::new(asked as u64, lost).unwrap();
            let draws = 20_000;
            let mut drawn: Vec<f64> =
                (0..draws).map(|_| odds(count.sample(&mut rng) as f64 / asked)).collect();
            let mean = drawn.iter().sum::<f64>() / f64::from(draws);
            let off = mean - odds(lost);
            let counting = Counting::of(lost, asked, 1.0);
            assert!((off - counting.bias).abs() < 0.03, "{lost} of {asked}: {off}");
            let square = drawn.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / f64::from(draws);
            assert!((square / counting.variance - 1.0).abs() < 0.05, "{lost} of {asked}: {square}");
            let middle = median(&mut drawn) - odds(lost);
            assert!((middle - counting.median).abs() < 0.01, "{lost} of {asked}: {middle}");
        }
        assert!(bias(0.005, 200.0, 1.0) < -0.25 && bias(0.005, 2000.0, 1.0) > -0.04);
        // The sum and its second-order term meet.
        let [few, many] = [2490.0, 2510.0].map(|asked| Counting::of(0.02, asked, 1.0));
        assert!((few.bias - many.bias).abs() < 2e-4);
        assert!((few.variance / many.variance - 1.0).abs() < 0.05 && few.median.abs() < 0.02);
        // Four readings lost together are a quarter as many events.
        assert!((bias(0.02, 400.0, 4.0) - bias(0.02, 100.0, 1.0)).abs() < 1e-12);
        assert_eq!(bias(0.0, 100.0, 1.0), 0.0);
        assert!((share(odds(0.3)) - 0.3).abs() < 1e-12);
    }
}
