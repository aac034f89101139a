//! Unexplained scatter of the views' own noise levels.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{Continuous, ContinuousCDF, Normal};

use crate::diagnose::views::samples::{ViewData, finite};
use crate::solve::{Left, fit_by_svd, left_by_fit};
use crate::stats::{median, range};
use crate::terms::{PixelContext, ROOM_LUX};

/// Assumed standard deviation of a model's sigma from view to view, in log variance, where too few
/// views show how they scatter.
pub const MODEL_TOLERANCE: f64 = 0.04;

/// Variance of the views' own levels beyond sampling (a moment estimate after DerSimonian and Laird),
/// about laws that explain part of it: the distance; from nine views on the tilt; from ten on
/// alternatively time and temperature; from twelve on all of these and ambient light. Enlarged for the
/// laws that so few views have to determine.
pub fn view_scatter(blocks: &[ViewData], tolerance: f64) -> f64 {
    let levels = Level::of(blocks);
    let choices: &[&[Law]] = match levels.len() {
        // The chance difference of two runs may follow any law of the distance.
        _ if tolerance > MODEL_TOLERANCE => &[&LAWS[..1]],
        12.. => &[&LAWS],
        // Level, distance, time, temperature.
        10.. => &[&LAWS[..4], &[LAWS[0], LAWS[1], LAWS[4], LAWS[5]]],
        9.. => &[&LAWS[..4]],
        _ => &[&LAWS[..2]],
    };
    let floor = tolerance * tolerance;
    let about = |among: &&[Law]| {
        if levels.len() < among.len() + 2 {
            return None;
        }
        // Views of one distance or one tilt make laws collinear.
        let Left { squares, free } = left_by_fit(&laws(&levels, among), &heights(&levels))?;
        let enlarged = if free > 3.0 { free / (free - 2.0) } else { 3.0 };
        let floor =
            if tolerance > MODEL_TOLERANCE { floor } else { unseen(&levels, free) * enlarged };
        Some(((squares / free - sampling(&levels)) * enlarged).max(floor))
    };
    let scatters = choices.iter().filter_map(about);
    let chosen = if choices.len() > 1 { CHOSEN } else { 1.0 };
    scatters.min_by(f64::total_cmp).map_or(floor, |scatter| chosen * scatter)
}

/// Correction for taking the smaller of two fits to ten or eleven levels (1.19 and 1.15, simulated).
const CHOSEN: f64 = 1.2;

/// The same where up to a third of the views may have a level of their own: least trimmed squares
/// (Rousseeuw 1984) about a law of the distance. Never more than `whole`, the scatter of all views.
pub fn scatter_of_most(blocks: &[ViewData], whole: f64) -> f64 {
    let levels = Level::of(blocks);
    let kept = levels.len() - levels.len() / 3;
    let among = &LAWS[..2];
    if kept < 2 * among.len() + 2 {
        return whole;
    }
    let (x, y) = (laws(&levels, among), heights(&levels));
    let middle = median(&mut y.as_slice().to_vec());
    let starts = [Some(y.map(|y| y - middle)), left_by(&x, &y, &(0..y.len()).collect::<Vec<_>>())];
    let trimmed = starts.into_iter().flatten().filter_map(|start| trimmed(&x, &y, start, kept));
    let Some(squares) = trimmed.min_by(f64::total_cmp) else { return whole };
    // Variance of a standard normal truncated to its middle `part`.
    let (normal, part) = (Normal::standard(), kept as f64 / levels.len() as f64);
    let end = normal.inverse_cdf(0.5 + 0.5 * part);
    let held = 1.0 - 2.0 * end * normal.pdf(end) / part;
    let free = (kept - among.len()) as f64;
    // Chosen so that its lowest 1 % is too small by no more than that of view_scatter (simulated, 10 to
    // 40 views).
    let enlarged = 1.0 + 12.0 / free;
    let scatter = (squares / held / free - sampling(&levels)) * enlarged;
    scatter.max(unseen(&levels, free) * enlarged).min(whole)
}

/// A view's noise level, and its sampling variance.
struct Level<'a> {
    place: &'a PixelContext,
    height: f64,
    variance: f64,
}

impl<'a> Level<'a> {
    fn of(blocks: &'a [ViewData]) -> Vec<Self> {
        let level = |b: &'a ViewData| {
            let (height, weight) = b.level()?;
            Some(Level { place: &b.places[0], height, variance: 1.0 / weight })
        };
        blocks.iter().filter_map(level).collect()
    }
}

/// A law that a view's noise level may follow.
type Law = fn(&PixelContext) -> f64;

/// Level, distance, tilt, direction of the tilt (noise along and across the pattern), time, temperature, and
/// ambient light over the pattern's, which falls with the square of the distance.
const LAWS: [Law; 7] = [
    |_| 1.0,
    |p| p.z.ln(),
    |p| p.theta.sin().powi(2),
    |p| p.theta.sin().powi(2) * (2.0 * p.azimuth).cos(),
    |p| finite(p.session_s / 3600.0),
    |p| finite(p.temperature_c / 10.0),
    |p| finite(p.ambient * p.pattern_fall_off() / ROOM_LUX),
];

fn laws(levels: &[Level<'_>], among: &[Law]) -> DMatrix<f64> {
    // With the same light in all views, a law of the light is one of the distance.
    let [dim, bright] = range(levels.iter().map(|l| l.place.ambient));
    let place = |l: &Level<'_>| match bright > dim {
        true => *l.place,
        false => PixelContext { ambient: 0.0, ..*l.place },
    };
    let places: Vec<PixelContext> = levels.iter().map(place).collect();
    DMatrix::from_fn(levels.len(), among.len(), |i, k| among[k](&places[i]))
}

fn heights(levels: &[Level<'_>]) -> DVector<f64> {
    DVector::from_iterator(levels.len(), levels.iter().map(|l| l.height))
}

fn sampling(levels: &[Level<'_>]) -> f64 {
    levels.iter().map(|l| l.variance).sum::<f64>() / levels.len() as f64
}

/// Scatter that sampling can hide where there is none: one standard error of its estimate.
fn unseen(levels: &[Level<'_>], free: f64) -> f64 {
    sampling(levels) * (2.0 / free).sqrt()
}

/// Residuals of all rows about a fit to some of them.
fn left_by(x: &DMatrix<f64>, y: &DVector<f64>, rows: &[usize]) -> Option<DVector<f64>> {
    let (beta, _) = fit_by_svd(&x.select_rows(rows), &y.select_rows(rows))?;
    Some(y - x * beta)
}

/// Sum of the `kept` smallest squared residuals about a fit to those rows alone.
fn trimmed(x: &DMatrix<f64>, y: &DVector<f64>, start: DVector<f64>, kept: usize) -> Option<f64> {
    const MAX_STEPS: usize = 20;
    let mut left = start;
    let mut rows: Vec<usize> = Vec::new();
    for _ in 0..MAX_STEPS {
        let mut order: Vec<usize> = (0..y.len()).collect();
        order.sort_by(|&i, &j| left[i].abs().total_cmp(&left[j].abs()));
        order.truncate(kept);
        order.sort_unstable();
        if order == rows {
            break;
        }
        left = left_by(x, y, &order)?;
        rows = order;
    }
    Some(rows.iter().map(|&i| left[i] * left[i]).sum())
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use rand::Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::rng::{Seed, Stream};

    /// A session whose levels follow a law of the distance, scatter by `sd`, and are raised by `more`
    /// in `odd` views.
    fn session(views: usize, sd: f64, odd: usize, more: f64, rng: &mut Stream) -> Vec<ViewData> {
        let view = |n: usize| {
            let z = rng.random_range(0.8..3.3);
            let place = PixelContext { z, theta: rng.random_range(0.0..1.0), ..Default::default() };
            let normal: f64 = StandardNormal.sample(rng);
            let level = 0.2 * z.ln() + sd * normal + if n < odd { more } else { 0.0 };
            ViewData {
                places: Arc::new(vec![place]),
                response: vec![level],
                weight: vec![1e8],
                ..Default::default()
            }
        };
        (0..views).map(view).collect()
    }

    #[test]
    fn views_with_a_level_of_their_own_are_no_scatter_of_the_others() {
        let mut rng = Seed(3).stream("levels");
        for views in [12, 18, 24] {
            for _ in 0..20 {
                let odd = session(views, 0.02, views / 4, 0.5, &mut rng);
                let whole = view_scatter(&odd, MODEL_TOLERANCE);
                let most = scatter_of_most(&odd, whole);
                assert!(whole > 0.1f64.powi(2) && most < 0.25 * whole, "{whole} {most}");
            }
        }
    }

    /// One in a hundred may be as small as a quarter of the true one.
    #[test]
    fn levels_that_all_scatter_are_not_believed_steadier() {
        let mut rng = Seed(4).stream("levels");
        for views in [12, 18, 24] {
            let steady = (0..200)
                .map(|_| scatter_of_most(&session(views, 0.1, 0, 0.0, &mut rng), f64::INFINITY))
                .filter(|scatter| *scatter < 0.05f64.powi(2))
                .count();
            assert!(steady <= 6, "{steady} of 200 with {views} views");
        }
    }

    /// Levels that differ by sampling alone may hide a scatter of one standard error, whatever the
    /// image size.
    #[test]
    fn the_scatter_that_is_not_seen_goes_with_what_a_view_is_worth() {
        let mut rng = Seed(6).stream("levels");
        for sd in [0.02, 0.005] {
            let median = |rng: &mut Stream| {
                let mut all: Vec<f64> = (0..40)
                    .map(|_| {
                        let mut views = session(20, sd, 0, 0.0, rng);
                        views.iter_mut().for_each(|v| v.weight[0] = 1.0 / (sd * sd));
                        view_scatter(&views, MODEL_TOLERANCE)
                    })
                    .collect();
                crate::stats::median(&mut all)
            };
            let hidden = median(&mut rng) / (sd * sd);
            assert!((0.35..0.55).contains(&hidden), "{hidden} of the sampling's variance");
        }
    }

    /// A dependence on ambient light is no scatter where the views' light differs; in constant light it
    /// is.
    #[test]
    fn the_light_of_the_room_is_a_law_where_it_differs() {
        let mut rng = Seed(8).stream("levels");
        let mut scatter = |lit: &dyn Fn(usize) -> f64| {
            let mut views = session(18, 0.02, 0, 0.0, &mut rng);
            for (n, view) in views.iter_mut().enumerate() {
                let place = &mut Arc::make_mut(&mut view.places)[0];
                place.ambient = lit(n);
                view.response[0] += 0.1 * place.pattern_fall_off() * place.ambient / ROOM_LUX;
            }
            view_scatter(&views, MODEL_TOLERANCE).sqrt()
        };
        let (differs, same) = (scatter(&|n| 800.0 * (n % 3) as f64), scatter(&|_| 800.0));
        assert!(differs < 0.04 && same > 0.06, "{differs} {same}");
    }

    /// Adds a trend of `rise` over a session whose views were taken at random times.
    fn with_trend(mut views: Vec<ViewData>, rise: f64, rng: &mut Stream) -> Vec<ViewData> {
        for view in &mut views {
            let session_s = rng.random_range(0.0..1800.0);
            Arc::make_mut(&mut view.places)[0].session_s = session_s;
            view.response[0] += rise * session_s / 1800.0;
        }
        views
    }

    #[test]
    fn a_trend_over_the_session_is_no_scatter() {
        let mut rng = Seed(7).stream("levels");
        for views in [10, 12, 17, 24] {
            let mut ratio = |rise: f64| {
                let mut all: Vec<f64> = (0..60)
                    .map(|_| {
                        let views = session(views, 0.1, 0, 0.0, &mut rng);
                        let views = with_trend(views, rise, &mut rng);
                        view_scatter(&views, MODEL_TOLERANCE) / 0.1f64.powi(2)
                    })
                    .collect();
                crate::stats::median(&mut all)
            };
            let (steady, rising) = (ratio(0.0), ratio(2.0));
            assert!((rising / steady - 1.0).abs() < 0.35, "{views} views: {steady} {rising}");
        }
    }

    #[test]
    fn of_too_few_views_all_count() {
        let mut rng = Seed(5).stream("levels");
        assert_eq!(scatter_of_most(&session(7, 0.1, 0, 0.0, &mut rng), 0.3), 0.3);
        assert_eq!(scatter_of_most(&[], 0.3), 0.3);
    }
}
