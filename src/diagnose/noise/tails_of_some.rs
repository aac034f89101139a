//! Heavy tails that some of the views have and the others have not: of those a mean over all tells little.

use statrs::distribution::{Binomial, DiscreteCDF, Poisson};

use super::structure::Structure;
use super::tail_counts::FEWEST_READINGS;

/// Fewer views than this, and than this share of all, are odd ones.
const FEWEST: usize = 3;
const FEWEST_SHARE: f64 = 0.2;
/// A view has tails where as many are this improbable.
const CLEAR: f64 = 1e-3;

/// Views with tails that the others have not.
pub struct TailedViews {
    pub views: Vec<Structure>,
    /// Chance that so many are so far beyond what was expected.
    pub p: f64,
}

/// The views whose share beyond four sigma is above `heavy`, if they are more than odd ones. By the noise alone
/// a share of up to `expected` is.
pub fn tailed_views(
    views: &[Structure],
    readings: impl Fn(&Structure) -> f64,
    expected: f64,
    heavy: f64,
) -> Option<TailedViews> {
    let looked: Vec<&Structure> = views.iter().filter(|s| s.tails.n > FEWEST_READINGS).collect();
    let chance = |s: &Structure| {
        let n = readings(s);
        let seen = (s.tails.share() * n).floor() as u64;
        // So many or more.
        let poisson = Poisson::new(expected * n).ok()?;
        Some(seen.checked_sub(1).map_or(1.0, |fewer| poisson.sf(fewer)))
    };
    let fewest = FEWEST.max((FEWEST_SHARE * looked.len() as f64).ceil() as usize);
    let mut chances: Vec<f64> = looked.iter().filter_map(|s| chance(s)).collect();
    chances.sort_by(f64::total_cmp);
    let p = chances.get(fewest - 1)?.clamp(0.0, 1.0);
    let of_views = Binomial::new(p, chances.len() as u64).ok()?;
    let tailed = |s: &&&Structure| s.tails.share() > heavy && chance(s).is_some_and(|p| p < CLEAR);
    let tailed: Vec<Structure> = looked.iter().filter(tailed).map(|s| (*s).clone()).collect();
    (tailed.len() >= fewest)
        .then(|| TailedViews { views: tailed, p: of_views.sf(fewest as u64 - 1).max(1e-300) })
}

#[cfg(test)]
mod tests {
    use rand_distr::Distribution;

    use super::*;
    use crate::diagnose::noise::tail_counts::{GAUSSIAN_TAIL, TailCounts};
    use crate::rng::{Seed, Stream};

    fn session(tailed: usize, share: f64, rng: &mut Stream) -> Vec<Structure> {
        let view = |k: usize| {
            let n = 2e4 * (1.0 + k as f64);
            let share = if k < tailed { share } else { GAUSSIAN_TAIL };
            let beyond = rand_distr::Poisson::new(share * n).unwrap().sample(rng);
            Structure {
                tails: TailCounts { n, beyond, ..Default::default() },
                ..Default::default()
            }
        };
        (0..16).map(view).collect()
    }

    fn p(views: &[Structure]) -> f64 {
        let all = tailed_views(views, |s| s.tails.n, 1.5 * GAUSSIAN_TAIL, 2.5 * GAUSSIAN_TAIL);
        all.map_or(1.0, |t| t.p)
    }

    #[test]
    fn tails_of_a_quarter_of_the_views_are_seen_and_those_of_two_are_odd() {
        let mut rng = Seed(3).stream("tails-of-some");
        for _ in 0..50 {
            let views = session(4, 1e-3, &mut rng);
            let found = tailed_views(&views, |s| s.tails.n, 1e-4, 1.6e-4).expect("four views");
            assert_eq!(found.views.len(), 4);
            assert!(p(&views) < 1e-6 && p(&session(2, 1e-2, &mut rng)) == 1.0);
        }
    }

    /// At 3 in 10,000 none of 3,000 sessions of Gaussian noise is found.
    #[test]
    fn gaussian_noise_has_none() {
        let mut rng = Seed(4).stream("tails-of-some/null");
        let seen = (0..3000).filter(|_| p(&session(0, 0.0, &mut rng)) < 3e-4).count();
        assert!(seen <= 3, "{seen}");
    }
}
