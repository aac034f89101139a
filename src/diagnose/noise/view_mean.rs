//! The mean of a statistic over the views, which no single view moves far.

use super::structure::Structure;
use crate::diagnose::search::null::student;
use crate::stats::{MAD_TO_SIGMA, mean, median, student_upper};

/// Mean of a statistic over the views, and its standard error.
#[derive(Debug, Clone, Copy)]
pub struct ViewMean {
    pub value: f64,
    pub std_error: f64,
    pub views: f64,
}

impl ViewMean {
    /// Of a statistic that some of the views have.
    pub fn of(views: &[Structure], value: impl Fn(&Structure) -> Option<f64>) -> Option<Self> {
        let values: Vec<(f64, f64)> = views
            .iter()
            .filter_map(|s| Some((value(s).filter(|v| v.is_finite())?, s.pixels)))
            .collect();
        ViewMean::weighed(&values)
    }

    /// Of the variance that rows share (columns: 1), px^2: a view counts by what it errs by, as the pairs in a line grow
    /// with its length squared.
    pub fn of_lines(views: &[Structure], axis: usize) -> Option<Self> {
        let variance = variance_px2(views);
        let of = |s: &Structure| {
            let px2 = [s.row_px2, s.column_px2][axis].filter(|px2| px2.is_finite());
            Some((px2?, s.line_size(axis, variance)))
        };
        ViewMean::weighed(&views.iter().filter_map(of).collect::<Vec<_>>())
    }

    /// Of what each view shares with all the others: a pair of views counts in two of the values, so
    /// that these scatter less than their mean errs.
    pub fn of_pairs(
        views: &[Structure],
        value: impl Fn(&Structure) -> Option<f64>,
    ) -> Option<Self> {
        let m = ViewMean::of(views, value)?;
        let std_error = m.std_error * (2.0 * (m.views - 1.0) / (m.views - 2.0)).sqrt();
        (m.views > 2.0).then_some(ViewMean { std_error, ..m })
    }

    /// Of values, each with how much there is of what it was measured on.
    pub fn weighed(values: &[(f64, f64)]) -> Option<Self> {
        let weighted = Weight::of(values).each(values);
        if weighted.len() < 2 {
            return None;
        }
        let (value, std_error) = huber(&weighted);
        Some(ViewMean { value, std_error, views: weighted.len() as f64 })
    }

    /// Of how many pixels a mean over the views is, each of so many that lie within those of all that have more.
    pub fn common_size(views: &[Structure], pixels: impl Fn(&Structure) -> f64) -> f64 {
        let values: Vec<(f64, f64)> = views.iter().map(|s| (pixels(s), s.pixels)).collect();
        let weighted = Weight::of(&values).each(&values);
        let total: f64 = weighted.iter().map(|v| v.1).sum();
        let shared = weighted.iter().flat_map(|(a, at)| {
            weighted.iter().map(move |(b, weight)| at * weight / a.max(*b).max(1.0))
        });
        total * total / shared.sum::<f64>().max(f64::MIN_POSITIVE)
    }

    /// Nats by which the `value` of one more view, of this size, is likelier about the mean of these values than
    /// about none: by Student's t of their scatter.
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

    /// The same that errs by so much in all views alike, too.
    pub fn and_error(self, common: f64) -> Self {
        ViewMean { std_error: self.std_error.hypot(common), ..self }
    }

    /// Chance of a mean this far above `expected`, one-sided, by Student's t.
    pub fn p_above(&self, expected: f64) -> f64 {
        let t = (self.value - expected) / self.std_error.max(1e-12 * self.value.abs()).max(1e-300);
        student_upper(t, self.views - 1.0).max(1e-300)
    }

    /// The same below it.
    pub fn p_below(&self, expected: f64) -> f64 {
        ViewMean { value: -self.value, ..*self }.p_above(-expected)
    }
}

/// What values count by the sizes of what they were measured on.
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

    /// A small one says little; views differ for reasons of their own, so that a large one does not say all.
    pub fn at(&self, size: f64) -> f64 {
        if self.sized { size / (size + ERROR_OVER_OWN * self.middle) } else { 1.0 }
    }

    /// The values with their weights. Of nothing there is nothing to tell.
    fn each(&self, values: &[(f64, f64)]) -> Vec<(f64, f64)> {
        let used = values.iter().filter(|v| v.1 > 0.0 || !self.sized);
        used.map(|v| (v.0, self.at(v.1))).collect()
    }
}

/// What a view of middling size errs by over what views differ by for reasons of their own, in squares. Of
/// clean sessions 5 to 12 in 10,000 are then beyond a level of 9 in 10,000, whatever views differ by up to
/// a middling one's error (simulated, 11 to 20 views of 1,000 to 19,000 pixels).
const ERROR_OVER_OWN: f64 = 2.0;
/// Fewer views do not tell which of them strays.
const MIN_FOR_STRAYS: usize = 8;
/// Standard deviations from where on a view strays: of Gaussian ones one in 80 does, which costs 0.2 % of
/// the information (Huber, Robust Statistics, 1981).
const STRAY: f64 = 2.5;

/// Where distances from the middle, each over what its view errs by, are a stray's; nowhere if most of them
/// are none at all, as counts of what is rare are.
fn stray_beyond(distances: impl Iterator<Item = f64>) -> f64 {
    let mut all: Vec<f64> = distances.collect();
    let stray = STRAY * MAD_TO_SIGMA * median(&mut all);
    if all.len() < MIN_FOR_STRAYS || stray == 0.0 { f64::INFINITY } else { stray }
}

/// What is left of a view's weight at this distance: a stray moves no mean farther than one that lies where
/// strays begin.
fn held(distance: f64, stray: f64) -> f64 {
    if distance > stray { stray / distance } else { 1.0 }
}

/// Huber's mean of values with their weights, begun at the median, and its standard error by least squares
/// with the influence of every value on it.
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

/// What a mean off `expected` is worth.
pub fn nats(m: &ViewMean, expected: f64) -> f64 {
    let t = (m.value - expected) / m.std_error.max(1e-9);
    student(0.5 * t * t, m.views)
}

/// Of the first frame's rough residual, px^2.
pub fn variance_px2(views: &[Structure]) -> f64 {
    ViewMean::of(views, |s| Some(s.variance_px2)).map_or(0.0, |m| m.value)
}

#[cfg(test)]
mod tests {
    use rand::Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::rng::{Seed, Stream};

    /// Values of so many views about `mean`, each off by its own noise: 0.2 over the root of its size.
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
        // Binomial of 4000 at .01: 40, give or take 6.3; that views have no more than their noise's
        // scatter makes it fewer.
        for n in [5, 10, 20] {
            let above = above(n);
            assert!((10..=59).contains(&above), "{above} of 4000 with {n} views");
        }
    }

    /// Of a hundred further views: by as much as Gaussian ones with these errors bring, and by nothing where there
    /// is nothing to learn.
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
        // 0.5 (mean / error)^2 on average: 0.5 * 0.005^2 * 1.05e4 / 0.2^2 = 3.3 nats each, and of a hundred the
        // root of 2 * 3.3 / 100 = 0.26 more or less. That large views count by less than their size costs a part.
        let nats = brought(0.005);
        assert!((1.5..3.6).contains(&nats), "{nats}");
        // Of nothing the learnt mean's own error costs half of one in sixty.
        let nats = brought(0.0);
        assert!(nats.abs() < 0.05, "{nats}");
    }

    /// Views without a pixel, more than there are others, take no part.
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

    /// One view with a still error of its own does not hide what the others share, and is no finding alone.
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
