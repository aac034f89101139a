//! Detects statistics that only some of the views show; a mean over all views would hide them.

use statrs::distribution::{Chi, Continuous};

use super::structure::Structure;
use super::view_mean::Weight;
use crate::stats::{at_least, normal_beyond, student_upper};

/// Fewer views than this, or than this share of all, may be outliers.
const MIN_VIEWS: usize = 3;
const MIN_SHARE: f64 = 0.2;
/// Least number of views that are tested although they may be outliers: a single one has a reason of its own.
pub const MIN_OUTLIERS: usize = 2;
/// With fewer views below the expected value their scatter is unknown: with two, half of it is chance. The
/// views' own error, where it is known, counts as this many views.
const MIN_BELOW: usize = 3;
/// Any further view is included where its p-value is below this.
const CLEAR: f64 = 0.01;

/// Fewest views, out of this many, that are more than outliers.
pub fn min_views(views: usize) -> usize {
    MIN_VIEWS.max((MIN_SHARE * views as f64).ceil() as usize)
}

/// Numbers of views whose far values are tested.
pub fn counts(views: usize) -> [usize; 2] {
    [min_views(views), MIN_OUTLIERS]
}

/// The count whose far views are the least likely by chance, and the p-value of that many tests; `p` is that of
/// one.
pub fn least_likely(counts: &[usize], p: impl Fn(usize) -> Option<f64>) -> Option<(usize, f64)> {
    let each = counts.iter().filter_map(|&k| Some((k, p(k)?)));
    let (k, p) = each.min_by(|a, b| a.1.total_cmp(&b.1))?;
    Some((k, (counts.len() as f64 * p).min(1.0)))
}

/// Indices of the views that lie above the others, and the p-value.
pub struct SomeViews {
    pub which: Vec<usize>,
    pub p: f64,
}

impl SomeViews {
    /// Tests the deviations of the views, all in one unit. Without an effect they scatter symmetrically, so
    /// those below zero give the scale.
    pub fn above(off: &[f64]) -> Option<Self> {
        let (n, squares) = below(off);
        let scale = (squares / n as f64).sqrt();
        (n >= MIN_BELOW && scale > 0.0)
            .then(|| SomeViews::beyond(off, scale, n, &counts(off.len())))?
    }

    /// Tests deviations in units of each view's own error. Few may lie below zero: where most views show the
    /// effect, or few views were recorded.
    pub fn above_error(off: &[f64]) -> Option<Self> {
        let (n, squares) = below(off);
        let freedom = n + MIN_BELOW;
        let scale = ((squares + MIN_BELOW as f64) / freedom as f64).sqrt();
        SomeViews::beyond(off, scale, freedom, &counts(off.len()))
    }

    /// Tests deviations with a standard error of `scale`, known with `freedom` degrees of freedom, in as many
    /// views as any of these `counts`.
    pub fn beyond(off: &[f64], scale: f64, freedom: usize, counts: &[usize]) -> Option<Self> {
        let above = |v: &usize| off[*v] > 0.0;
        let mut which: Vec<usize> = (0..off.len()).filter(above).collect();
        which.sort_by(|a, b| off[*b].total_cmp(&off[*a]));
        let n = which.len();
        let (min, p) = least_likely(counts, |k| {
            Some(order_statistic(off[*which.get(k - 1)?] / scale, k, n, freedom))
        })?;
        let sure = |v: &&usize| student_upper(off[**v] / scale, freedom as f64) < CLEAR;
        let clear = which.iter().filter(sure).count();
        which.truncate(clear.max(min));
        which.sort_unstable();
        Some(SomeViews { which, p })
    }
}

/// Number of values below zero, and the sum of their squares.
fn below(off: &[f64]) -> (usize, f64) {
    let below = off.iter().filter(|t| **t < 0.0);
    below.fold((0, 0.0), |(n, sum), t| (n + 1, sum + t * t))
}

/// Views that lie above the others, the number of views measured, and the p-value.
pub struct Above {
    pub views: Vec<Structure>,
    pub of: usize,
    pub p: f64,
}

/// Finds the views whose `value` lies above the others'. Its mean is zero without an effect; `error` is then
/// its standard error, where known.
pub fn some_views(
    views: &[Structure],
    value: impl Fn(&Structure) -> Option<f64>,
    error: Option<&dyn Fn(&Structure) -> f64>,
) -> Option<Above> {
    let measured = |s: &Structure| Some((value(s).filter(|v| v.is_finite())?, s.pixels));
    let which: Vec<&Structure> = views.iter().filter(|s| measured(s).is_some()).collect();
    let values: Vec<(f64, f64)> = which.iter().filter_map(|s| measured(s)).collect();
    let weight = Weight::of(&values);
    let off: Vec<f64> = values.iter().map(|(x, size)| weight.at(*size).sqrt() * x).collect();
    let by_error = |error: &dyn Fn(&Structure) -> f64| {
        let off: Vec<f64> = values.iter().zip(&which).map(|((x, _), s)| x / error(s)).collect();
        SomeViews::above_error(&off)
    };
    let tests = [SomeViews::above(&off), error.and_then(by_error)];
    let count = tests.iter().flatten().count() as f64;
    let best = tests.into_iter().flatten().min_by(|a, b| a.p.total_cmp(&b.p))?;
    let views = best.which.into_iter().map(|v| which[v].clone()).collect();
    Some(Above { views, of: which.len(), p: (count * best.p).min(1.0) })
}

/// P-value of the `k`-th largest of `above` half-normal values at `far`, in units of the root mean square of
/// `below` other values; marginalised over that root mean square.
fn order_statistic(far: f64, k: usize, above: usize, below: usize) -> f64 {
    const STEPS: usize = 400;
    let Ok(chi) = Chi::new(below as u64) else { return 1.0 };
    // The density beyond is negligible.
    let end = (below as f64).sqrt() + 6.0;
    let at = |step: usize| {
        let chi_value = end * (step as f64 + 0.5) / STEPS as f64;
        let one = normal_beyond(far * chi_value / (below as f64).sqrt());
        at_least(k, above, one) * chi.pdf(chi_value)
    };
    ((0..STEPS).map(at).sum::<f64>() * end / STEPS as f64).clamp(1e-300, 1.0)
}

#[cfg(test)]
mod tests {
    use rand_distr::{ChiSquared, Distribution, StandardNormal};

    use super::*;
    use crate::rng::{Seed, Stream};

    fn views(n: usize, tall: usize, by: f64, rng: &mut Stream) -> Vec<f64> {
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        (0..n).map(|v| 0.01 * (normal() + if v < tall { by } else { 0.0 })).collect()
    }

    /// Of sessions without an effect, one in a hundred is found at that level.
    #[test]
    fn clean_views_are_found_as_often_as_the_level_says() {
        let mut rng = Seed(3).stream("some-views/null");
        for n in [10, 16, 30] {
            let chance = |_| SomeViews::above(&views(n, 0, 0.0, &mut rng)).map_or(1.0, |s| s.p);
            let seen = (0..4000).map(chance).filter(|p| *p < 0.01).count();
            // Binomial: 40 +- 6.3; too few views on one side make it fewer.
            assert!((8..60).contains(&seen), "{seen} of 4000 with {n}");
        }
    }

    /// With their own error, known with three degrees of freedom, five views: one in a hundred would be 200 of
    /// 20,000 +- 14, half of it by either number of views; three of five are seldom above zero.
    #[test]
    fn clean_views_are_found_by_their_own_error_as_often_as_the_level_says() {
        let mut rng = Seed(6).stream("some-views/own-error");
        let known = ChiSquared::new(MIN_BELOW as f64).unwrap();
        let mut off = || -> Vec<f64> {
            let scale = (MIN_BELOW as f64 / known.sample(&mut rng)).sqrt();
            views(5, 0, 0.0, &mut rng).into_iter().map(|x| 100.0 * scale * x).collect()
        };
        let clean = |_| SomeViews::above_error(&off()).map_or(1.0, |s| s.p);
        let seen = (0..20_000).map(clean).filter(|p| *p < 0.01).count();
        assert!((60..140).contains(&seen), "{seen} of 20000");
    }

    /// Nine of twelve views show the effect; in most sessions fewer than three of the others lie below zero.
    #[test]
    fn nine_of_twelve_views_are_told_by_their_own_error() {
        let mut rng = Seed(5).stream("some-views/most");
        let mut off = |tall| -> Vec<f64> {
            views(12, tall, 15.0, &mut rng).into_iter().map(|x| 100.0 * x).collect()
        };
        let told = (0..200).filter_map(|_| SomeViews::above_error(&off(9)));
        let told = told.filter(|s| s.p < 2e-4 && s.which.len() == 9).count();
        // Two counts are tested. In one session in ten a tenth view has a p-value below 0.01; the scale, of
        // three views and three more, may be wide.
        assert!((120..=175).contains(&told), "{told} of 200");
    }

    #[test]
    fn a_quarter_of_the_views_is_told_and_one_is_odd() {
        let mut rng = Seed(4).stream("some-views/quarter");
        let mut clear = 0;
        for _ in 0..50 {
            let Some(found) = SomeViews::above(&views(20, 5, 12.0, &mut rng)) else { continue };
            clear += usize::from(found.p < 1e-4 && found.which[..5] == [0, 1, 2, 3, 4]);
        }
        // In 44 of 50 +- 2.3: the others have few views below zero, which say little of the views' scatter.
        assert!(clear >= 36, "{clear} of 50");
        // Two of 20 are a tenth; they lie farther off than outliers do.
        for _ in 0..20 {
            let found = SomeViews::above(&views(20, 2, 30.0, &mut rng));
            assert!(found.is_some_and(|s| s.p < 1e-3 && s.which[..2] == [0, 1]));
        }
        let odd = views(20, 1, 100.0, &mut rng);
        assert!(SomeViews::above(&odd).is_none_or(|s| s.p > 1e-3));
        // As many views below the others are no effect.
        let low = views(20, 5, -12.0, &mut rng);
        assert!(SomeViews::above(&low).is_none_or(|s| s.p > 1e-3));
    }
}
