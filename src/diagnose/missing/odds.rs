//! Log odds of lost shares, and their bias in patches of few readings.

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

/// How far the mean log odds of a counted share are from those of the `share` itself, where `asked` readings
/// are lost independently, or so many `together`. A logarithm's mean is below the logarithm of the mean: by
/// 0.3 where one reading of 200 is lost, and by a tenth of that in patches ten times as large.
pub fn bias(share: f64, asked: f64, together: f64) -> f64 {
    let events = (asked / together).round().max(1.0);
    let (mean, kept) = (share * events, (1.0 - share) * events);
    if mean > MANY && kept > MANY {
        let curvature = (1.0 - share + HARDLY).powi(-2) - (share + HARDLY).powi(-2);
        return 0.5 * share * (1.0 - share) / events * curvature;
    }
    let Ok(count) = Binomial::new(share, events as u64) else { return 0.0 };
    let sd = (share * kept).sqrt();
    let reach = WIDE * sd + WIDE;
    let [first, last] = [(mean - reach).max(0.0), (mean + reach).min(events)].map(|k| k as u64);
    let each = (first..=last).map(|k| count.pmf(k) * (odds(k as f64 / events) - odds(share)));
    each.sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Seed;
    use rand_distr::Distribution;

    /// Whatever the number of readings, the mean of the corrected log odds is that of the share.
    #[test]
    fn small_patches_do_not_seem_to_lose_less() {
        let mut rng = Seed(5).stream("odds");
        for (lost, asked) in
            [(0.005, 64.0), (0.005, 320.0), (0.02, 32.0), (0.02, 1600.0), (0.5, 32.0)]
        {
            let count = rand_distr::Binomial::new(asked as u64, lost).unwrap();
            let draws = 20_000;
            let drawn = (0..draws).map(|_| odds(count.sample(&mut rng) as f64 / asked));
            let mean = drawn.sum::<f64>() / f64::from(draws);
            let off = mean - odds(lost);
            assert!((off - bias(lost, asked, 1.0)).abs() < 0.03, "{lost} of {asked}: {off}");
        }
        assert!(bias(0.005, 200.0, 1.0) < -0.25 && bias(0.005, 2000.0, 1.0) > -0.04);
        // The sum and its second-order term meet.
        assert!((bias(0.02, 2490.0, 1.0) - bias(0.02, 2510.0, 1.0)).abs() < 2e-4);
        // Four readings lost together are a quarter as many events.
        assert!((bias(0.02, 400.0, 4.0) - bias(0.02, 100.0, 1.0)).abs() < 1e-12);
        assert_eq!(bias(0.0, 100.0, 1.0), 0.0);
        assert!((share(odds(0.3)) - 0.3).abs() < 1e-12);
    }
}
