//! Comparison with a simulated recording: the mean and the size of the noise, patch by patch.

use std::collections::{BTreeMap, HashMap};

use super::Baseline;
use crate::diagnose::finding::pixels::fixed_px2;
use crate::diagnose::views::blocks::BLOCK_TILES;
use crate::diagnose::views::layers::Survey;
use crate::diagnose::views::samples::ViewData;
use crate::diagnose::views::tiles::SIDE;
use crate::solve::{Left, left_by_fit};

/// Difference in log variance of one view between two runs, due to gross errors.
const ANOTHER_RUN: f64 = 0.12;

impl Baseline {
    /// Subtracts the simulated mean from the real one, tile by tile.
    pub fn means(&self, survey: &mut Survey) {
        survey.fixed_px2 += fixed_px2(&self.structure);
        for (real, twin) in survey.views.iter_mut().zip(&self.survey.views) {
            let theirs: HashMap<(u32, u32), f64> =
                twin.patches().map(|(p, t)| (patch(p.u, p.v, SIDE), t.mean)).collect();
            for (place, t) in real.tiles_mut() {
                let mean = theirs.get(&patch(place.u, place.v, SIDE)).copied();
                match mean.filter(|m| m.is_finite()) {
                    Some(m) => {
                        t.square += m * m - 2.0 * m * t.mean;
                        t.mean -= m;
                    }
                    // Seen in only one of them: nothing to compare.
                    None => (t.mean, t.pixels) = (f64::NAN, 0.0),
                }
            }
            real.inflation += twin.inflation;
        }
    }

    /// Replaces the model's variance by the simulated one, block by block. Returns `false` where the
    /// simulated views have hardly any.
    pub fn variances(&mut self, survey: &mut Survey) -> bool {
        // Noise that hardly changes between frames is measured in total, in both recordings or in neither.
        for (real, twin) in survey.views.iter_mut().zip(&mut self.survey.views) {
            if real.between_frame_factor.is_none() || twin.between_frame_factor.is_none() {
                (real.between_frame_factor, twin.between_frame_factor) = (None, None);
            }
        }
        let theirs = self.survey.variance_data();
        let count = |data: &[ViewData]| data.iter().map(|v| v.places.len()).sum::<usize>();
        if 2 * count(&theirs) < count(&survey.variance_data()) {
            self.remarks.push("the simulated recording has hardly any noise: the size of the noise was held against the model's sigma".into());
            return false;
        }
        for (real, twin) in survey.views.iter_mut().zip(&theirs) {
            let side = BLOCK_TILES * SIDE;
            let logs: BTreeMap<(u32, u32), f64> = twin
                .places
                .iter()
                .zip(&twin.response)
                .map(|(p, y)| (patch(p.u, p.v, side), *y))
                .collect();
            // Terms that depend on the variance itself must not contain the errors of the blocks, which the
            // response that they are fitted to contains.
            let smooth = logs.values().sum::<f64>() / logs.len().max(1) as f64;
            for (place, t) in real.patches_mut() {
                place.variance = t.noise_variance * smooth.exp();
                match logs.get(&patch(place.u, place.v, side)) {
                    Some(log) => t.noise_variance *= log.exp(),
                    None => (t.temporal, t.rough_square) = (f64::NAN, f64::NAN),
                }
            }
        }
        true
    }

    /// The simulated variances are as uncertain as the real ones, and both more than a Gaussian's
    /// where gross errors clump.
    pub fn inflate_log_variances(&self, survey: &mut Survey) {
        survey.tolerance = ANOTHER_RUN;
        let (ours, theirs) = (survey.variance_data(), self.survey.variance_data());
        let mean = |v: &ViewData| v.weight.iter().sum::<f64>() / v.weight.len().max(1) as f64;
        for (view, (ours, theirs)) in survey.views.iter_mut().zip(ours.iter().zip(&theirs)) {
            let (w, t) = (mean(ours), mean(theirs));
            if w > 0.0 && t > 0.0 {
                // What is compared scatters by the errors of both.
                let clumps = scatter(ours, t / (w + t)).max(scatter(theirs, 1.0));
                view.log_variance_inflation *= clumps * (w + t) / t;
            }
        }
    }
}

/// Scatter of a view's blocks about a plane in the picture relative to Gaussian noise, as a ratio of
/// variances of at least 1. The blocks' weights times `share` are their true ones.
fn scatter(view: &ViewData, share: f64) -> f64 {
    let n = view.places.len();
    if n < 6 {
        return 1.0;
    }
    let root: Vec<f64> = view.weight.iter().map(|w| (share * w).sqrt()).collect();
    let x = nalgebra::DMatrix::from_fn(n, 3, |i, k| {
        root[i] * [1.0, view.places[i].x, view.places[i].y][k]
    });
    let y = nalgebra::DVector::from_fn(n, |i, _| root[i] * view.response[i]);
    let Some(Left { squares: chi2, free }) = left_by_fit(&x, &y) else { return 1.0 };
    // Four standard deviations beyond chance.
    if chi2 > free + 4.0 * (2.0 * free).sqrt() { chi2 / free } else { 1.0 }
}

fn patch(u: f64, v: f64, side: usize) -> (u32, u32) {
    ((v / side as f64) as u32, (u / side as f64) as u32)
}
