//! Robust mean of a statistic over the views.

use super::structure::Structure;
use crate::diagnose::search::null::student;
use crate::stats::{MAD_TO_SIGMA, mean, median, student_upper};

/// Mean of a statistic over the views, and its standard error.
#[derive(Debug, Clone, Copy)]
pub struct ViewMean {
    pub value: f64,
    pub std_error: f64,
    /// Degrees of freedom of the standard error.
    pub freedom: f64,
    pub views: f64,
}

impl ViewMean {
    /// A mean whose standard error is that of the views' scatter.
    pub fn new(value: f64, std_error: f64, views: f64) -> Self {
        ViewMean { value, std_error, freedom: views - 1.0, views }
    }

    /// Mean of a statistic over the views that have it.
    pub fn of(views: &[Structure], value: impl Fn(&Structure) -> Option<f64>) -> Option<Self> {
        let values: Vec<(f64, f64)> = views
            .iter()
            .filter_map(|s| Some((value(s).filter(|v| v.is_finite())?, s.pixels)))
            .collect();
        ViewMean::weighed(&values)
    }

    /// Mean of what each view shares with all the others. A pair of views counts in two of the values, so
    /// their scatter understates the error of the mean.
    pub fn of_pairs(
        views: &[Structure],
        value: impl Fn(&Structure) -> Option<f64>,
    ) -> Option<Self> {
        let m = ViewMean::of(views, value)?;
        let std_error = m.std_error * (2.0 * (m.views - 1.0) / (m.views - 2.0)).sqrt();
        (m.views > 2.0).then_some(ViewMean { std_error, ..m })
    }

    /// Mean of values, each with the size of what it was measured on.
    pub fn weighed(values: &[(f64, f64)]) -> Option<Self> {
        let weighted = Weight::of(values).each(values);
        if weighted.len() < 2 {
            return None;
        }
        let (value, std_error) = huber(&weighted);
        Some(ViewMean::new(value, std_error, weighted.len() as f64))
    }

    /// Effective number of pixels of a mean over the views, if a view's pixels lie within
    /// those of all larger ones.
    pub fn common_size(views: &[Structure], pixels: impl Fn(&Structure) -> f64) -> f64 {
        let values: Vec<(f64, f64)> = views.iter().map(|s| (pixels(s), s.pixels)).collect();
        let weighted = Weight::of(&values).each(&values);
        let total: f64 = weighted.iter().map(|v| v.1).sum();
        let shared = weighted.iter().flat_map(|(a, at)| {
            weighted.iter().map(move |(b, weight)| at * weight / a.max(*b).max(1.0))
        });
        total * total / shared.sum::<f64>().max(f64::MIN_POSITIVE)
    }

    /// Gain in log-likelihood, nats, of one more view's `value` from the mean of these values rather than
    /// zero, by Student's t of their scatter.
    pub fn predicts(values: &[(f64, f64)], (value, size): (f64, f64)) -> Option<f64> {
        let m = ViewMean::weighed(values)?;
        let weight = Weight::of(values);
        let total: f64 = weight.each(values).iter().map(|v| v.1).sum();
        let of_mean = m.std_error.powi(2);
        let own = of_mean * total / weight.at(size);
        let log = |off: f64, variance: f64| {
            -student(0.5 * off * off / variance, m.views - 1.0) - 0.5 * variance.ln()
        };
        let nats = log(value - m.value, own + of_mean) - log(value, own);
        nats.is_finite().then_some(nats)
    }

    /// Standard error of the mean of these values by their own `errors`.
    pub fn implied(values: &[(f64, f64)], errors: &[f64]) -> f64 {
        let weight = Weight::of(values);
        let weights = || values.iter().map(|v| if v.1 > 0.0 { weight.at(v.1) } else { 0.0 });
        let square: f64 = weights().zip(errors).map(|(w, error)| (w * error).powi(2)).sum();
        square.sqrt() / weights().sum::<f64>()
    }

    /// Adds a standard error common to all views.
    pub fn and_error(self, common: f64) -> Self {
        ViewMean { std_error: self.std_error.hypot(common), ..self }
    }

    /// One-sided p-value of a mean this far above `expected`, by Student's t.
    pub fn p_above(&self, expected: f64) -> f64 {
        if self.std_error.is_nan() {
            return 1.0;
        }
        let t = (self.value - expected) / self.std_error.max(1e-12 * self.value.abs()).max(1e-300);
        student_upper(t, self.freedom).max(1e-300)
    }

    /// Same below `expected`.
    pub fn p_below(&self, expected: f64) -> f64 {
        ViewMean { value: -self.value, ..*self }.p_above(-expected)
    }
}

/// Weights of values by the sizes of what they were measured on.
pub struct Weight {
    sized: bool,
    middle: f64,
}

impl Weight {
    pub fn of(values: &[(f64, f64)]) -> Self {
        let sizes = values.iter().map(|v| v.1).filter(|size| *size > 0.0);
        let middle = mean(sizes);
        Weight { sized: middle.is_some(), middle: middle.unwrap_or(0.0) }
    }

    /// Weight for this size. Small views say little; large ones level off, as views
    /// differ for other reasons too.
    pub fn at(&self, size: f64) -> f64 {
        if self.sized { size / (size + ERROR_OVER_OWN * self.middle) } else { 1.0 }
    }

    /// The values with their weights, without those of size zero.
    fn each(&self, values: &[(f64, f64)]) -> Vec<(f64, f64)> {
        let used = values.iter().filter(|v| v.1 > 0.0 || !self.sized);
        used.map(|v| (v.0, self.at(v.1))).collect()
    }
}

/// Squared error of a view of mean size over the squared scatter of the views for other reasons. Of clean
/// sessions 5 to 12 in 10,000 are then beyond a level of 9 in 10,000, for a scatter of up to a mean view's
/// error (simulated, 11 to 20 views of 1,000 to 19,000 pixels).
const ERROR_OVER_OWN: f64 = 2.0;
/// Fewest views that show which of them is an outlier.
const MIN_FOR_STRAYS: usize = 8;
/// Outlier threshold, in standard deviations. One in 80 Gaussian views is beyond, which costs 0.2 % of the
/// information (Huber, Robust Statistics, 1981).
const STRAY: f64 = 2.5;

/// Outlier threshold of the weighted distances from the mean. Infinite if most of them are zero, as
/// for counts of rare events.
fn stray_beyond(distances: impl Iterator<Item = f64>) -> f64 {
    let mut all: Vec<f64> = distances.collect();
    let stray = STRAY * MAD_TO_SIGMA * median(&mut all);
    if all.len() < MIN_FOR_STRAYS || stray == 0.0 { f64::INFINITY } else { stray }
}

/// Factor on a view's weight at this distance: an outlier moves the mean no farther than
/// a view at the threshold.
fn held(distance: f64, stray: f64) -> f64 {
    if distance > stray { stray / distance } else { 1.0 }
}

/// Huber's mean of weighted values, started at the median, and its least-squares standard error with every
/// value's influence limited.
fn huber(values: &[(f64, f64)]) -> (f64, f64) {
    const ROUNDS: usize = 20;
    let off = |mean: f64| values.iter().map(move |(x, w)| w.sqrt() * (x - mean).abs());
    let mut mean = median(&mut values.iter().map(|v| v.0).collect::<Vec<f64>>());
    for _ in 0..ROUNDS {
        let stray = stray_beyond(off(mean));
        let (mut sum, mut total) = (0.0, 0.0);
        for ((x, w), distance) in values.iter().zip(off(mean)) {
            let w = w * held(distance, stray);
            sum += w * x;
            total += w;
        }
        mean = sum / total;
    }
    let stray = stray_beyond(off(mean));
    let (mut squares, mut total, mut trusted) = (0.0, 0.0, 0.0);
    for ((_, w), distance) in values.iter().zip(off(mean)) {
        squares += (held(distance, stray) * distance).powi(2);
        total += w;
        trusted += if distance > stray { 0.0 } else { *w };
    }
    let free = values.len() as f64 - 1.0;
    (mean, (squares / free * total).sqrt() / trusted)
}

/// Evidence, in nats, for a mean that differs from `expected`.
pub fn nats(m: &ViewMean, expected: f64) -> f64 {
    let t = (m.value - expected) / m.std_error.max(1e-9);
    student(0.5 * t * t, m.freedom + 1.0)
}

/// Mean variance of the first frames' high-passed residuals, px^2.
pub fn variance_px2(views: &[Structure]) -> f64 {
    ViewMean::of(views, |s| Some(s.variance_px2)).map_or(0.0, |m| m.value)
}

#[cfg(test)]
mod tests {
    use rand::Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::rng::{Seed, Stream};

    /// `n` views about `mean`, each with its own noise: 0.2 over the root of its size.
    fn views(mean: f64, n: usize, rng: &mut Stream) -> Vec<(f64, f64)> {
        let view = |_| {
            let (size, normal): (f64, f64) =
                (rng.random_range(1e3..2e4), StandardNormal.sample(rng));
            (mean + 0.2 * normal / size.sqrt(), size)
        };
        (0..n).map(view).collect()
    }

    #[test]
    fn clean_views_are_beyond_a_level_as_often_as_it_says() {
        let mut rng = Seed(4).stream("view-mean/null");
        let mut above = |n| {
            let p = |_| ViewMean::weighed(&views(0.0, n, &mut rng)).unwrap().p_above(0.0);
            (0..4000).map(p).filter(|p| *p < 0.01).count()
        };
        // Binomial: 40 of 4000 +- 6.3; views that scatter only by their noise make it fewer.
        for n in [5, 10, 20] {
            let above = above(n);
            assert!((10..=59).contains(&above), "{above} of 4000 with {n} views");
        }
    }

    /// A hundred further views gain what Gaussian ones with these errors would, and nothing where
    /// there is nothing to learn.
    #[test]
    fn further_views_are_predicted_by_what_was_learnt() {
        let mut rng = Seed(7).stream("view-mean/predicts");
        let mut brought = |mean| {
            let learnt_on = views(mean, 60, &mut rng);
            let further = views(mean, 100, &mut rng).into_iter();
            let nats: Vec<f64> =
                further.map(|v| ViewMean::predicts(&learnt_on, v).unwrap()).collect();
            nats.iter().sum::<f64>() / 100.0
        };
        // On average 0.5 (mean / error)^2: 0.5 * 0.005^2 * 1.05e4 / 0.2^2 = 3.3 nats each, +-
        // sqrt(2 * 3.3 / 100) = 0.26 for a hundred. Less a part, as large views weigh less than their size.
        let nats = brought(0.005);
        assert!((1.5..3.6).contains(&nats), "{nats}");
        // With a mean of zero, the error of the learnt mean costs 0.5 / 60 nats.
        let nats = brought(0.0);
        assert!(nats.abs() < 0.05, "{nats}");
    }

    /// Views without a pixel take no part, though more than the others.
    #[test]
    fn views_of_no_size_say_nothing() {
        let mut rng = Seed(6).stream("view-mean/none");
        let some = views(0.01, 4, &mut rng);
        let all: Vec<(f64, f64)> = some.iter().copied().chain([(0.0, 0.0); 12]).collect();
        let [a, b] = [&some, &all].map(|v| ViewMean::weighed(v).unwrap());
        assert_eq!((a.value, a.std_error, a.views), (b.value, b.std_error, b.views));
        let mostly_none = [[(0.0, 1e3); 9].as_slice(), &[(0.2, 1e3); 3]].concat();
        assert!(ViewMean::weighed(&mostly_none).unwrap().p_above(0.0) > 0.01);
        assert!(ViewMean::weighed(&[(1.0, 5.0), (2.0, 0.0)]).is_none());
    }

    /// One view with a constant error of its own neither hides what the others share nor is a finding alone.
    #[test]
    fn a_view_that_strays_moves_the_mean_by_little() {
        let mut rng = Seed(5).stream("view-mean/stray");
        for mean in [0.01, 0.0] {
            let mut all = views(mean, 20, &mut rng);
            all[7] = (0.34, 1.1e4);
            let m = ViewMean::weighed(&all).unwrap();
            assert!((m.value - mean).abs() < 0.002, "{m:?}");
            assert_eq!(m.p_above(0.0) < 1e-4, mean > 0.0, "{m:?}");
        }
    }
}
