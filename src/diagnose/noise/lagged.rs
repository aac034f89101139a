//! Correlation of a pixel with itself in later frames, and its standard error.

use super::structure::Structure;

/// Largest share of a pattern in the variance: beyond it the rest of a view's noise is unknown.
const LARGEST_PATTERN: f64 = 0.95;

/// Mean correlation of frames two or three apart: of four frames, two pairs and one.
pub fn later(s: &Structure) -> Option<f64> {
    let (two, three) = (s.lagged[1]?, s.lagged[2]);
    Some(three.map_or(two, |three| (2.0 * two + three) / 3.0))
}

/// Mean correlation of any two frames, each pair counted once: of four frames, three pairs are successive.
pub fn of_any_two(s: &Structure) -> Option<f64> {
    let next = s.lagged[0]?;
    let Some(rest) = later(s) else { return Some(next) };
    let share = if s.lagged[2].is_some() { 1.0 / 2.0 } else { 1.0 / 3.0 };
    Some(next + share * (rest - next))
}

impl Structure {
    /// Standard error of the mean correlation of so many `pairs` of frames that share nothing.
    pub fn lagged_error(&self, pairs: f64) -> f64 {
        (self.repeats() / (self.pixels * pairs)).sqrt() / (1.0 - self.rounding)
    }

    /// Same of successive frames beside a pattern of this variance, which varies by chance over a view's
    /// pixels.
    pub fn lagged_error_beside(&self, pattern_px2: f64) -> f64 {
        let changes = self.lagged.iter().flatten().count() as f64;
        let (share, left) = self.pattern_share(pattern_px2);
        let of_pattern = share / left * (2.0 / self.pixels).sqrt();
        self.lagged_error(changes).hypot(of_pattern)
    }

    /// Correlation of a pixel with itself 1, 2 and 3 frames later, without a pattern of this variance.
    pub fn beside_pattern(&self, pattern_px2: f64) -> [Option<f64>; 3] {
        let (share, left) = self.pattern_share(pattern_px2);
        self.lagged.map(|c| Some((c? - share) / left))
    }

    /// Share of a pattern in the variance, and the rest.
    fn pattern_share(&self, pattern_px2: f64) -> (f64, f64) {
        let share = (pattern_px2.max(0.0) / self.noise_px2().max(1e-12)).min(LARGEST_PATTERN);
        (share, 1.0 - share)
    }
}

/// Mean correlation of two different frames of `n`, from the correlations at lags one, two, and three or more;
/// the first of these where there is one frame.
pub fn of_any_two_frames(lagged: [f64; 3], n: usize) -> f64 {
    let (mut sum, mut pairs) = (0.0, 0.0);
    for lag in 1..n {
        sum += (n - lag) as f64 * lagged[lag.min(3) - 1];
        pairs += (n - lag) as f64;
    }
    if pairs > 0.0 { sum / pairs } else { lagged[0] }
}

/// Correlation of successive frames behind a first-order filter, from that of the frames by lag: beside a constant,
/// it falls by the same factor from lag to lag. Zero where it hardly falls.
pub fn fading([first, second, last]: [f64; 3]) -> f64 {
    /// Five standard errors of a correlation of 10,000 pixels.
    const FALLS: f64 = 0.05;
    let fall = first - second;
    if fall > FALLS { ((second - last) / fall).clamp(0.0, 0.95) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Behind a filter of .6, beside a pattern of half of the variance, and of a pattern alone.
    #[test]
    fn a_filter_is_told_from_what_stands_still() {
        let rho: f64 = 0.6;
        let beside = |still: f64| [1, 2, 3].map(|lag| still + (1.0 - still) * rho.powi(lag));
        for still in [0.0, 0.5] {
            assert!((fading(beside(still)) - rho).abs() < 1e-12);
        }
        assert_eq!(fading([0.5, 0.48, 0.5]), 0.0);
    }
}
