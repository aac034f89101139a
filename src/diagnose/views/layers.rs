//! The layers a mismatch may be in: the mean, and the size of the noise.

use std::sync::Arc;

use rayon::prelude::*;

use super::blocks::{BLOCK_TILES, block_tiles, blocks};
use super::field::Field;
use super::inflation::{independent_frames, inflations};
use super::learnt::Learnt;
use super::light::{Light, relative_light};
use super::samples::{COARSE_PX, ViewData, coarser};
use super::surveyed_view::{SurveyedView, mean_data};
use super::tiles::{Tile, roughen, tiles};
use crate::diagnose::checks::replication::halves;
use crate::diagnose::noise::lagged::{fading, of_any_two_frames};
use crate::diagnose::options::Ablation;
use crate::diagnose::search::view_levels::{MODEL_TOLERANCE, view_scatter};
use crate::diagnose::steps::lattice::Step;
use crate::diagnose::steps::rounding::Rounding;
use crate::effects::Flat;
use crate::measure::Workbench;
use crate::sensors::SensorKind;
use crate::stats::Correlation;
use crate::terms::{Extent, PixelContext, Term};

/// Whether each view is in the second half, by its target's distance and tilt.
pub fn second_half(fields: &[Field]) -> Vec<bool> {
    let pose = |f: &Field| (f.plane.distance(), f.plane.theta());
    halves(&fields.iter().map(pose).collect::<Vec<_>>())
}

/// The tiles of all views, with each view's weight.
pub struct Survey {
    pub views: Vec<SurveyedView>,
    pub reach: Extent,
    /// The least flat target, where every view states its target's flatness.
    pub flat: Option<Flat>,
    /// Kind of the camera.
    pub kind: Option<SensorKind>,
    /// Variance of the fixed-pattern noise: the error each pixel has in all views, px^2.
    pub fixed_px2: f64,
    pub light: Light,
    /// Side of the blocks on which the noise is measured, in tiles.
    pub block_tiles: usize,
    /// Whether blocks are split by light; not when two recordings are compared.
    pub by_light: bool,
    /// Prior standard deviation of the noise level from view to view, in log variance.
    pub tolerance: f64,
    /// Whether sigma was calibrated on these very views and is therefore refitted with every hypothesis.
    pub refits_sigma: bool,
    /// Views that the model's bias and its sigma were learnt from, where they differ from these.
    pub learnt_from: [Option<Learnt>; 2],
    /// Scatter of single views about the model, one standard deviation a term: of the mean, of the variance.
    pub between: Arc<[Vec<Term>; 2]>,
    /// Steps whose waves show in single views.
    pub rounding: Option<Rounding>,
    pub ablation: Ablation,
}

impl Survey {
    /// `step` is that of the stored words.
    pub fn of(fields: &[Field], bench: &Workbench<'_>, step: Option<Step>) -> Self {
        let camera = &bench.sensor.camera;
        let mut views: Vec<SurveyedView> = fields
            .par_iter()
            .zip(inflations(fields, &[]))
            .zip(second_half(fields))
            .map(|((f, (inflation, correlation)), in_second_half)| {
                let (places, tiles) = tiles(f, camera, &bench.rays);
                SurveyedView {
                    name: f.name.clone(),
                    places: Arc::new(places),
                    tiles: Arc::new(tiles),
                    inflation,
                    correlation,
                    frames: independent_frames(f),
                    log_variance_inflation: 1.0,
                    row_inflation: 1.0,
                    row_correlation: 1.0,
                    between_frame_factor: None,
                    in_second_half,
                }
            })
            .collect();
        let light = relative_light(&mut views);
        let reach = Extent::of(views.iter().flat_map(|v| v.places.iter()));
        let stated: Option<Vec<f64>> = fields.iter().map(|f| f.flatness_m).collect();
        let flat = stated.filter(|all| !all.is_empty()).map(|all| Flat {
            flatness_m: all.into_iter().fold(0.0, f64::max),
            right: reach.right,
            down: reach.down,
        });
        Survey {
            block_tiles: block_tiles(&views, camera.width),
            rounding: Rounding::of(step, views.iter().flat_map(|v| v.places.iter())),
            views,
            reach,
            flat,
            kind: bench.sensor.kind,
            fixed_px2: 0.0,
            light,
            by_light: true,
            tolerance: MODEL_TOLERANCE,
            refits_sigma: false,
            learnt_from: [None; 2],
            between: Arc::default(),
            ablation: Ablation::None,
        }
    }

    /// Prepares the comparison of two recordings: widest blocks, not split by light.
    pub fn compared(&mut self) {
        (self.block_tiles, self.by_light) = (BLOCK_TILES, false);
    }

    /// Disables a part of the engine, for tests that show what it is for.
    pub fn ablate(&mut self, ablation: Ablation, fields: &[Field]) {
        self.ablation = ablation;
        if ablation != Ablation::NoCorrelation {
            return;
        }
        for (view, field) in self.views.iter_mut().zip(fields) {
            view.inflation /= view.correlation.sum;
            (view.correlation.sum, view.correlation.sum_of_squares) = (1.0, 1.0);
            view.frames = field.frames.len() as f64;
        }
    }

    /// Mean residuals of the views, each about a plane of its own.
    pub fn mean_data(&self) -> Vec<ViewData> {
        self.views.par_iter().map(|v| self.mean_of(v).beside(&self.between[0])).collect()
    }

    /// Same as [`Survey::mean_data`], in larger patches.
    pub fn coarse_mean_data(&self) -> Vec<ViewData> {
        let coarse = |v| coarser(&self.mean_of(v), COARSE_PX).beside(&self.between[0]);
        self.views.par_iter().map(coarse).collect()
    }

    /// Mean residuals of a view beside its plane and the waves of rounding.
    fn mean_of(&self, view: &SurveyedView) -> ViewData {
        let data = mean_data(view);
        let Some(rounding) = &self.rounding else { return data };
        data.beside_columns(Rounding::COLUMNS, |p| rounding.of_mean(p).to_vec())
    }

    /// Survey of the views with these indices. Its searches are not tested for significance or replication.
    pub fn subset(&self, which: &[usize]) -> Survey {
        let of = |n: &usize| SurveyedView { in_second_half: false, ..self.views[*n].clone() };
        let views: Vec<SurveyedView> = which.iter().map(of).collect();
        let reach = Extent::of(views.iter().flat_map(|v| v.places.iter()));
        Survey { views, reach, between: self.between.clone(), ..*self }
    }

    /// Measures the inflation of the views' means again with the bias found subtracted, px by view and pixel.
    /// Returns `false` and changes nothing where they would together weigh little more.
    pub fn reweigh(&mut self, fields: &[Field], bias: &[Vec<f32>]) -> bool {
        /// A tenth more information makes errors a twentieth smaller.
        const LITTLE: f64 = 1.1;
        let anew = inflations(fields, bias);
        let (mut before, mut after) = (0.0, 0.0);
        for (view, (inflation, _)) in self.views.iter().zip(&anew) {
            let weight = view.whole_weight();
            before += weight;
            after += weight * (view.inflation / inflation).max(1.0);
        }
        if after <= LITTLE * before {
            return false;
        }
        for (view, (inflation, correlation)) in self.views.iter_mut().zip(anew) {
            if inflation < view.inflation {
                (view.inflation, view.correlation) = (inflation, correlation);
            }
        }
        true
    }

    /// Total weight of each view's mean, 1/px^2, and the correlation of its pixels.
    pub fn weights(&self) -> Vec<(f64, Correlation)> {
        // The loss due to row noise is estimated again.
        let weight = |v: &SurveyedView| v.whole_weight() * v.row_inflation;
        self.views.iter().map(|v| (weight(v), v.correlation.clone())).collect()
    }

    /// Raises the views' weights to at least these.
    pub fn weigh_more(&mut self, weights: Vec<(f64, Correlation)>) {
        self.views.iter_mut().zip(weights).for_each(|(view, weight)| view.weigh_more(weight));
    }

    /// Measures the noise by the differences between frames. `common` is the noise correlation between two
    /// frames of a view, by lag.
    pub fn compare_frames(&mut self, fields: &[Field], common: [f64; 3]) {
        for (view, field) in self.views.iter_mut().zip(fields) {
            let n = field.frames.len();
            if n < 2 {
                continue;
            }
            let (mean, all) = (of_any_two_frames(common, n), n as f64);
            if mean >= 0.9 {
                view.between_frame_factor = None;
                view.frames = view.frames.min(all - 1.0);
                continue;
            }
            view.between_frame_factor = Some(all / (all - 1.0) / (1.0 - mean.max(0.0)));
            // What stands still takes no part; the noise behind a filter repeats itself.
            let rho = fading(common);
            let repeated = (1..n).map(|lag| rho.powi(2 * lag as i32) * (1.0 - lag as f64 / all));
            view.frames = (all - 1.0) / (1.0 + 2.0 * repeated.sum::<f64>());
        }
    }

    /// Subtracts the known bias (px, by view and pixel) before the noise is measured. Scales the expected
    /// variance by `stretch`, a factor on the measurement itself, and adds `extra`, the variance that has
    /// another cause, px^2.
    pub fn roughen(
        &mut self,
        fields: &[Field],
        bias: &[Vec<f32>],
        extra: impl Fn(&PixelContext) -> f64 + Sync,
        stretch: impl Fn(&PixelContext) -> f64 + Sync,
    ) {
        self.views.par_iter_mut().zip(fields).enumerate().for_each(|(n, (view, field))| {
            if let Some(bias) = bias.get(n) {
                let tiles: &mut Vec<Tile> = Arc::make_mut(&mut view.tiles);
                roughen(tiles, &view.places, field, bias);
            }
            for (place, t) in view.patches_mut() {
                let (factor, more) = (stretch(place), extra(place));
                t.noise_variance = t.noise_variance * factor + more;
                place.variance = place.variance * factor + more;
            }
        });
    }

    /// Log ratio of the measured variance to the model's, block by block.
    pub fn variance_data(&self) -> Vec<ViewData> {
        let of =
            |v: &SurveyedView| blocks(v, self.block_tiles, self.by_light, self.rounding.as_ref());
        let mut blocks: Vec<ViewData> = self.views.par_iter().map(of).collect();
        // The prior variance of a view's level is the scatter of the views.
        let level = 1.0 / view_scatter(&blocks, self.tolerance);
        blocks.iter_mut().for_each(|b| b.precision[0] = level);
        blocks.into_iter().map(|b| b.beside(&self.between[1])).collect()
    }

    /// Whether each view is in the second half.
    pub fn second(&self) -> Vec<bool> {
        self.views.iter().map(|v| v.in_second_half).collect()
    }
}
