//! Weight of a view's mean where its error seems larger, or more correlated, than the others'.
//!
//! A cause that only some views have correlates their errors from patch to patch, as correlated noise
//! would, so by its own measure such a view has little weight. It gets the weight of the others
//! instead, and each candidate is penalised for what it leaves.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use crate::diagnose::views::layers::Survey;
use crate::diagnose::views::samples::ViewData;
use crate::diagnose::views::surveyed_view::SurveyedView;
use crate::stats::quantile;
use crate::terms::{Basis, Term};

/// A view whose inflation is this many times the usual one may have a cause of its own. In the
/// ray-traced session this was read off, the eight views without one were within two fifths of their
/// median.
const OTHERWISE: f64 = 2.0;
/// Quantile of the views that shows the usual inflation: the median of those without a cause where
/// nearly half have one.
const USUAL: f64 = 0.25;
/// Minimum degrees of freedom; fewer patches say nothing of what is left.
const MIN_FREE: f64 = 8.0;
/// Patches below this share of the largest weight are left out.
const SLIGHT: f64 = 1e-6;

/// Factor on the weight of each view's mean for noise of the usual size, instead of its own measure,
/// which takes a cause that the others do not have for noise; 1 where the two agree. Noise that differs
/// between the view's frames is no such cause, nor are correlated errors of each frame's rows.
pub fn doubted(survey: &Survey) -> Vec<f64> {
    let of_noise = |v: &SurveyedView| {
        let of_rows = v.row_correlation.min(v.correlation.sum);
        of_rows * v.noise_by_frames().map_or(1.0, |r| r.max(1.0))
    };
    let beside_noise = |v: &SurveyedView| v.inflation / of_noise(v);
    doubts(&survey.views.iter().map(beside_noise).collect::<Vec<f64>>())
}

fn doubts(inflations: &[f64]) -> Vec<f64> {
    // A view without data says nothing about the others.
    let mut shown: Vec<f64> = inflations.iter().copied().filter(|i| i.is_finite()).collect();
    let usual = quantile(&mut shown, USUAL).unwrap_or(f64::INFINITY);
    let doubt = |i: &f64| if i.is_finite() { (i / (OTHERWISE * usual)).max(1.0) } else { 1.0 };
    inflations.iter().map(doubt).collect()
}

/// Reduced chi squared of what a candidate leaves of a view: the largest over patches of one, two, four
/// and eight samples across, so that correlated errors count in full. Infinite where too few patches of
/// any size are seen.
pub fn left_over(view: &ViewData, basis: &Basis, beta: &[f64]) -> f64 {
    let left = view.without(&[Term::bias(basis.clone(), beta.to_vec())]);
    let Some(plane) = view.plane_of(&left) else { return f64::INFINITY };
    let at_scale = |across: f64| {
        let mut patches: BTreeMap<[u32; 2], [f64; 2]> = BTreeMap::new();
        for ((p, y), w) in view.places.iter().zip(&left).zip(&view.weight) {
            let side = across * p.side.max(1.0);
            let sums = patches.entry([p.u, p.v].map(|at| (at / side) as u32)).or_default();
            sums[0] += w * (y - plane.dot(&Vector3::new(1.0, p.x, p.y)));
            sums[1] += w;
        }
        // Patches of negligible weight leave nothing, which is no evidence of a good fit.
        let most = patches.values().map(|p| p[1]).fold(0.0, f64::max);
        patches.retain(|_, p| p[1] > SLIGHT * most);
        let free = patches.len() as f64 - 3.0 - beta.len() as f64;
        let squares: f64 = patches.values().map(|[y, w]| y * y / w.max(f64::MIN_POSITIVE)).sum();
        (free >= MIN_FREE).then(|| squares / free)
    };
    let left = [1.0, 2.0, 4.0, 8.0].into_iter().filter_map(at_scale).reduce(f64::max);
    left.unwrap_or(f64::INFINITY)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::rng::Seed;
    use crate::terms::{Coordinate, Modulation, PixelContext};

    const ACROSS: usize = 32;
    const SIDE: f64 = 4.0;

    /// A view of unit noise with this error added.
    fn view(error: impl Fn(f64, f64) -> f64) -> ViewData {
        let mut rng = Seed(1).stream("worth");
        let mut data = ViewData::default();
        for i in 0..ACROSS * ACROSS {
            let [u, v] = [i % ACROSS, i / ACROSS].map(|k| SIDE * k as f64 + 2.0);
            let [x, y] = [u, v].map(|at| at / (0.5 * SIDE * ACROSS as f64) - 1.0);
            Arc::make_mut(&mut data.places).push(PixelContext {
                u,
                v,
                x,
                y,
                side: SIDE,
                radius: x.hypot(y),
                ..Default::default()
            });
            let noise: f64 = StandardNormal.sample(&mut rng);
            data.response.push(noise + 0.3 * x + error(x, y));
            data.weight.push(1.0);
        }
        data
    }

    /// Inflations of a session with a cause in its last three views; one view has no data.
    #[test]
    fn what_begins_late_is_doubted_where_it_began() {
        let views = [12.0, 14.0, 10.0, 13.0, f64::INFINITY, 110.0, 90.0, 200.0];
        let doubted = doubts(&views);
        assert_eq!(doubted[..5], [1.0; 5]);
        assert!(doubted[5..].iter().all(|d| *d > 3.0), "{doubted:?}");
        assert_eq!(doubts(&[f64::INFINITY; 2]), [1.0; 2]);
    }

    /// What a candidate explains leaves noise; what it does not explain counts as far as it is
    /// correlated.
    #[test]
    fn what_a_candidate_leaves_counts_against_it() {
        let bowl = Basis::powers(Coordinate::RadiusSquared, 1, Modulation::One);
        let left = |data: ViewData, height: f64| left_over(&data, &bowl, &[height]);
        for (size, height) in [(0.0, 0.0), (2.0, 2.0)] {
            let clean = left(view(|x, y| size * (x * x + y * y)), height);
            assert!(clean < 1.5, "{clean}");
        }
        let missed = left(view(|x, y| 2.0 * (x * x + y * y)), 0.0);
        assert!(missed > 5.0, "{missed}");
        let wave = left(view(|x, _| (9.0 * x).sin()), 0.0);
        assert!(wave > 5.0, "{wave}");
    }
}
