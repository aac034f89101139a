//! The model's heavy tails: a mixture of two Gaussians.

use crate::diagnose::views::known::KnownTerms;
use crate::stats::{MAD_TO_SIGMA, bisect, normal_beyond};

/// Noise of which a `fraction` is drawn from a Gaussian `scale` times as wide.
#[derive(Debug, Clone, Copy)]
pub struct Mixture {
    fraction: f64,
    scale: f64,
    scale_error: f64,
}

impl Mixture {
    pub fn of(known: &KnownTerms) -> Option<Self> {
        let at = |name| known.parameter("heavy-tails", name);
        let scale_error = known.std_error("heavy-tails", "scale");
        let mixture = Mixture { fraction: at("fraction")?, scale: at("scale")?, scale_error };
        (mixture.fraction > 0.0 && mixture.scale > 1.0).then_some(mixture)
    }

    /// Share of the readings beyond `t` standard deviations of the narrow component.
    fn beyond(&self, t: f64) -> f64 {
        (1.0 - self.fraction) * normal_beyond(t) + self.fraction * normal_beyond(t / self.scale)
    }

    /// Standard deviation by the median, over that of the narrow component.
    pub fn width(&self) -> f64 {
        let [_, median] = bisect([0.0, self.scale], |t| self.beyond(t) > 0.5);
        MAD_TO_SIGMA * median
    }

    /// Share beyond four standard deviations with this share of the outliers, their scale off by so many of
    /// its standard errors: that of weak tails is hardly known.
    pub fn tail(&self, share: f64, errors: f64) -> f64 {
        let scale = (self.scale + errors * self.scale_error).max(1.0);
        let other = Mixture { fraction: share * self.fraction, scale, ..*self };
        other.beyond(4.0 * other.width())
    }

    /// Root mean square of the outliers over all readings, in standard deviations of the noise.
    pub fn size_sigma(&self) -> f64 {
        self.fraction.sqrt() * self.scale
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Seed;
    use crate::stats::median_in_place;
    use rand::Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// Against a Monte-Carlo draw of the catalogue's mixture.
    #[test]
    fn a_mixture_is_as_wide_and_as_heavy_as_what_is_drawn_from_it() {
        let mut rng = Seed(3).stream("mixture");
        for (fraction, scale) in [(0.05, 8.0), (0.3, 3.0), (1.0, 100.0)] {
            let mixture = Mixture { fraction, scale, scale_error: 0.0 };
            let mut drawn: Vec<f32> = (0..400_000)
                .map(|_| {
                    let one: f64 = StandardNormal.sample(&mut rng);
                    let wide = rng.random_bool(fraction);
                    (if wide { scale * one } else { one }).abs() as f32
                })
                .collect();
            let sigma = MAD_TO_SIGMA * f64::from(median_in_place(&mut drawn));
            assert!((mixture.width() / sigma - 1.0).abs() < 0.01, "{sigma} {}", mixture.width());
            let beyond = drawn.iter().filter(|d| f64::from(**d) > 4.0 * sigma).count() as f64;
            let share = beyond / drawn.len() as f64;
            let error = 5.0 * (share / drawn.len() as f64).sqrt();
            assert!((mixture.tail(1.0, 0.0) - share).abs() < error + 0.03 * share, "{share}");
        }
    }
}
