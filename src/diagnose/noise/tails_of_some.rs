//! Detects heavy tails that only some of the views have; a mean over all views would hide them.

use statrs::distribution::{DiscreteCDF, Poisson};

use super::some_views::{Above, MIN_OUTLIERS, counts, least_likely};
use super::structure::Structure;
use super::tail_counts::{MIN_READINGS, TAIL_EDGES};
use crate::stats::{at_least, normal_beyond};

/// A view has tails where so many far readings have a probability below this.
const CLEAR: f64 = 1e-3;

/// Views with tails that the others do not have: those whose share beyond four sigma is above `heavy`, if there
/// are at least [`MIN_OUTLIERS`] of them. Noise alone has a share of up to `expected`.
pub fn tailed_views(views: &[Structure], expected: f64, heavy: f64) -> Option<Above> {
    let looked: Vec<&Structure> = views.iter().filter(|s| s.tails.n > MIN_READINGS).collect();
    let tailed = |s: &&&Structure| {
        s.tails.share() > heavy * bent(s) && chance(s, expected).is_some_and(|p| p < CLEAR)
    };
    let tailed: Vec<Structure> = looked.iter().filter(tailed).map(|s| (*s).clone()).collect();
    if tailed.len() < MIN_OUTLIERS {
        return None;
    }
    let p = order_statistic(&looked, expected)?;
    Some(Above { views: tailed, of: looked.len(), p })
}

/// Factor on the share beyond four sigma of the disparity for noise that is Gaussian in the depth: noise x of
/// s times the disparity becomes x / (1 - s x).
fn bent(view: &Structure) -> f64 {
    let far = TAIL_EDGES[0];
    let s = far * view.relative_sigma.min(MAX_RELATIVE);
    let sides = normal_beyond(far / (1.0 + s)) + normal_beyond(far / (1.0 - s));
    sides / (2.0 * normal_beyond(far))
}

/// Limit of the relative noise: at a quarter, four sigma below the disparity is zero.
const MAX_RELATIVE: f64 = 0.2;

/// P-value of a view's number of places with far readings; connected readings count once. The expected number
/// of readings bounds that of places: through a window of 5 px most places hold one or two readings, not as
/// many as share the window.
fn chance(view: &Structure, expected: f64) -> Option<f64> {
    let poisson = Poisson::new(expected * bent(view) * view.tails.n).ok()?;
    Some((view.far_places as u64).checked_sub(1).map_or(1.0, |fewer| poisson.sf(fewer)))
}

/// P-value of the smallest of the views' p-values, in as many views as any of the [`counts`].
fn order_statistic(views: &[&Structure], expected: f64) -> Option<f64> {
    let all = views.iter().filter_map(|s| chance(s, expected));
    let mut chances: Vec<f64> = all.collect();
    chances.sort_by(f64::total_cmp);
    let (_, p) = least_likely(&counts(views.len()), |k| {
        let p = chances.get(k - 1)?.clamp(0.0, 1.0);
        Some(at_least(k, chances.len(), p))
    })?;
    Some(p.max(1e-300))
}

#[cfg(test)]
mod tests {
    use rand_distr::Distribution;

    use super::*;
    use crate::diagnose::noise::tail_counts::{GAUSSIAN_TAIL, TailCounts, places, tail};
    use crate::rng::{Seed, Stream};

    fn session(tailed: usize, share: f64, rng: &mut Stream) -> Vec<Structure> {
        let view = |k: usize| {
            let n = 2e4 * (1.0 + k as f64);
            let share = if k < tailed { share } else { GAUSSIAN_TAIL };
            let beyond = rand_distr::Poisson::new(share * n).unwrap().sample(rng);
            let tails = TailCounts { n, beyond, ..Default::default() };
            Structure { tails, far_places: beyond, ..Default::default() }
        };
        (0..16).map(view).collect()
    }

    fn p(views: &[Structure]) -> f64 {
        let all = tailed_views(views, 1.5 * GAUSSIAN_TAIL, 2.5 * GAUSSIAN_TAIL);
        all.map_or(1.0, |t| t.p)
    }

    #[test]
    fn tails_of_a_quarter_of_the_views_or_of_two_are_seen_and_those_of_one_are_odd() {
        let mut rng = Seed(3).stream("tails-of-some");
        for _ in 0..50 {
            let mut views = session(4, 1e-3, &mut rng);
            // A view of too few readings is not looked at.
            views.push(Structure::default());
            let found = tailed_views(&views, 1e-4, 1.6e-4).expect("four views");
            assert_eq!((found.views.len(), found.of), (4, 16));
            assert!(p(&views) < 1e-6 && p(&session(2, 1e-2, &mut rng)) < 1e-6);
            assert_eq!(p(&session(1, 1e-2, &mut rng)), 1.0);
        }
    }

    /// With the expected share in all views, one session in a hundred is found at that level.
    #[test]
    fn what_is_expected_is_found_as_often_as_its_level_says() {
        let mut rng = Seed(4).stream("tails-of-some/null");
        let mut chance = || {
            let expected = 1.5 * GAUSSIAN_TAIL;
            let views = session(16, expected, &mut rng);
            order_statistic(&views.iter().collect::<Vec<_>>(), expected).unwrap()
        };
        let seen = (0..4000).filter(|_| chance() < 0.01).count();
        // Binomial: 40 +- 6.3; whole-number counts make it fewer.
        assert!((5..60).contains(&seen), "{seen}");
    }

    /// A million Gaussian depths of relative noise 3 %: number of disparities beyond four
    /// sigma, to four times its root.
    #[test]
    fn what_is_gaussian_in_the_depth_has_its_share_in_the_disparity() {
        const S: f64 = 0.03;
        let mut rng = Seed(6).stream("tails-of-some/bent");
        let mut far = || {
            let x: f64 = rand_distr::StandardNormal.sample(&mut rng);
            (x / (1.0 - S * x)).abs() > 4.0
        };
        let n = (0..1_000_000).filter(|_| far()).count() as f64;
        let view = Structure { relative_sigma: S, ..Structure::default() };
        let expected = 1e6 * GAUSSIAN_TAIL * bent(&view);
        assert!((n - expected).abs() < 4.0 * expected.sqrt(), "{n} of {expected}");
        assert!((bent(&Structure::default()) - 1.0).abs() < 1e-12);
    }

    /// Noise through a window of 5 px is far out no more often than white noise, but in clumps: of 400
    /// views no more than one in a hundred is that improbable. With one count for all readings that
    /// share a window, 100 would be.
    #[test]
    fn windows_make_no_tails() {
        const SIZE: [usize; 2] = [160, 120];
        const SIDE: usize = 5;
        let mut rng = Seed(8).stream("tails-of-some/windows");
        let mut view = || {
            let wide = SIZE[0] + SIDE;
            let white: Vec<f32> = (0..wide * (SIZE[1] + SIDE))
                .map(|_| rand_distr::StandardNormal.sample(&mut rng))
                .collect();
            let at = |i: usize| {
                let corner = i / SIZE[0] * wide + i % SIZE[0];
                (0..SIDE * SIDE).map(|k| white[corner + k / SIDE * wide + k % SIDE]).sum()
            };
            let image: Vec<f32> = (0..SIZE[0] * SIZE[1]).map(at).collect();
            let mut far = vec![false; image.len()];
            let tails = tail(&image, SIZE[0], &mut far);
            let far_places = places(far, SIZE[0]);
            Structure { tails, far_places, window_px: Some(5.0), ..Default::default() }
        };
        let improbable = |_: &u32| chance(&view(), GAUSSIAN_TAIL).unwrap() < 0.01;
        let found = (0..400).filter(improbable).count();
        // Binomial: 4 +- 2.
        assert!(found <= 12, "{found} of 400");
    }

    /// A speck of nine pixels in four frames is one place.
    #[test]
    fn specks_are_no_tails() {
        let mut rng = Seed(5).stream("tails-of-some/specks");
        let mut views = session(0, 0.0, &mut rng);
        for view in &mut views[3..7] {
            view.tails.beyond += 36.0;
            view.far_places += 1.0;
        }
        assert!(p(&views) > 1e-3);
    }
}
