//! The layers a mismatch may sit in: the mean, and the size of the noise.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::ablation::Ablation;
use super::bias;
use super::candidate::{Candidate, RECALIBRATE};
use super::evidence::{Gain, gain};
use super::field::Field;
use super::joint::{clustered, refit};
use super::outcome::{Chosen, Outcome, Rules};
use super::prepared::evidence_of_bases;
use super::replication::halves;
use super::samples::{ViewData, coarser};
use super::scatter::{Left, left_by_fit};
use super::search::{search, search_beside};
use super::smooth::{SMOOTH_PX, high_pass};
use super::tiles::{SIDE, Tile, tiles};
use super::variance;
use crate::camera::{Camera, Rays};
use crate::effects::Bounds;
use crate::model::SigmaModel;
use crate::rng::Seed;
use crate::stats::{Correlation, measure_correlation};
use crate::terms::{Basis, Extent, PixelContext};

/// The tiles of all views, with how much each view is worth.
pub struct Survey {
    pub views: Vec<SurveyedView>,
    pub reach: Extent,
    /// Variance of what each pixel errs by in every view alike, px^2.
    pub fixed_px2: f64,
    pub light: Light,
    /// How well the size of the noise is known from view to view beforehand, in log variance.
    pub tolerance: f64,
    /// Sigma was calibrated on these very views: it is refitted beside every hypothesis.
    pub refits_sigma: bool,
    /// Views that the model's bias, and its sigma, were learnt from, where these are others.
    pub learnt_from: [Option<f64>; 2],
    pub ablation: Ablation,
}

/// How infrared amplitudes become the light of surfaces.
#[derive(Debug, Clone, Copy)]
pub struct Light {
    /// Of the recording, in the image's own units; 0 where there is no infrared.
    median: f64,
    ambient_share: f64,
}

impl Light {
    /// Of a single pixel.
    pub fn of(&self, field: &Field, k: usize, p: &PixelContext) -> f64 {
        let Some(&light) = field.light.get(k) else { return 1.0 };
        let own = f64::from(light) / (1.0 + self.ambient_share * p.ambient * far(p));
        if self.median > 0.0 && own.is_finite() { own / self.median } else { 1.0 }
    }
}

#[derive(Clone)]
pub struct SurveyedView {
    pub name: String,
    /// Shared by the surveys of a part of the views.
    pub tiles: Arc<Vec<Tile>>,
    /// Variance of a pixel's mean in units of the model's, times pixels per independent sample.
    pub inflation: f64,
    pub correlation: Correlation,
    /// Independent frames a view's variance is worth.
    pub frames: f64,
    /// How many times more uncertain the logarithm of its variance is than by that.
    pub doubt: f64,
    /// What the variance between frames is to be multiplied by to be all of the noise's; `None`
    /// with a single frame.
    pub moving: Option<f64>,
    /// In the second of the halves that a finding must replicate in.
    pub second: bool,
}

/// No more terms than this are looked for in a layer.
const MOST_TERMS: usize = 10;
/// A bias smaller than this share of the noise is not told.
const LEAST_SIGMAS: f64 = 0.004;
/// A name that explains less than this share of what a nameless curve explains is not the cause.
const ADEQUATE: f64 = 0.6;
/// Precision of a coefficient of the bias: a few px at most.
const BIAS_PRIOR: f64 = 0.1;
/// Of one of log variance: a factor of e is already much.
pub const VARIANCE_PRIOR: f64 = 1.0;

impl Survey {
    pub fn of(fields: &[Field], camera: &Camera, rays: &Rays) -> Self {
        let start = fields.iter().map(|f| f.time_s).fold(f64::INFINITY, f64::min);
        let poses: Vec<(f64, f64)> =
            fields.iter().map(|f| (f.plane.distance(), f.plane.theta())).collect();
        let mut views: Vec<SurveyedView> = fields
            .par_iter()
            .zip(halves(&poses))
            .map(|(f, second)| {
                let (inflation, correlation) = inflation(f, &[]);
                let tiles = Arc::new(tiles(f, camera, rays, start));
                SurveyedView {
                    name: f.name.clone(),
                    tiles,
                    inflation,
                    correlation,
                    frames: independent_frames(f),
                    doubt: 1.0,
                    moving: None,
                    second,
                }
            })
            .collect();
        let light = relative_light(&mut views);
        let reach = Extent::of(views.iter().flat_map(|v| v.tiles.iter().map(|t| &t.place)));
        let (tolerance, ablation) = (MODEL_TOLERANCE, Ablation::None);
        Survey {
            views,
            reach,
            fixed_px2: 0.0,
            light,
            tolerance,
            refits_sigma: false,
            learnt_from: [None; 2],
            ablation,
        }
    }

    /// Root of the weighted harmonic mean of the model's variance, px.
    fn typical_sigma_px(&self) -> f64 {
        let (mut sum, mut n) = (0.0, 0.0);
        for t in self.views.iter().flat_map(|v| v.tiles.iter()).filter(|t| t.variance > 0.0) {
            sum += t.pixels / t.variance;
            n += t.pixels;
        }
        (n / sum).sqrt()
    }

    /// Pixels of the picture that any view's target covered.
    fn covered_px(&self, camera: &Camera) -> f64 {
        let across = camera.width.div_ceil(SIDE);
        let mut seen = vec![false; across * camera.height.div_ceil(SIDE)];
        for t in self.views.iter().flat_map(|v| v.tiles.iter()) {
            seen[t.place.v as usize / SIDE * across + t.place.u as usize / SIDE] = true;
        }
        (seen.iter().filter(|s| **s).count() * SIDE * SIDE) as f64
    }

    /// The views' mean residuals, about a plane of their own each.
    pub fn mean_data(&self) -> Vec<ViewData> {
        self.views.par_iter().map(mean_data).collect()
    }

    /// The same in larger patches.
    pub fn coarse_mean_data(&self) -> Vec<ViewData> {
        self.views.par_iter().map(|v| coarser(&mean_data(v))).collect()
    }

    /// What these views can show of an effect.
    pub fn bounds<'a>(&'a self, camera: &'a Camera) -> Bounds<'a> {
        Bounds { camera, reach: &self.reach, patch_px: SIDE as f64 }
    }

    /// How the search of the mean decides.
    pub fn bias_rules(&self, camera: &Camera, level: f64) -> Rules {
        self.ablation.rules(Rules {
            level,
            prior: BIAS_PRIOR,
            adequacy: ADEQUATE,
            most_terms: MOST_TERMS,
            fixed: (self.fixed_px2 > 0.0).then(|| (self.fixed_px2.sqrt(), self.covered_px(camera))),
            least: LEAST_SIGMAS * self.typical_sigma_px(),
            calibrated: true,
            learnt_from: self.learnt_from[0],
        })
    }

    pub fn search_bias(&self, camera: &Camera, level: f64, seed: Seed) -> Outcome {
        let rules = self.bias_rules(camera, level);
        let candidates = bias::candidates(&self.bounds(camera));
        let fine = self.mean_data();
        let coarse: Vec<ViewData> = fine.par_iter().map(coarser).collect();
        let candidates = self.ablation.candidates(candidates);
        let found = search(&fine, &coarse, &candidates, &rules, seed);
        let inflation: Vec<f64> = self.views.iter().map(|v| v.inflation).collect();
        let second = self.second();
        refit(&fine, &inflation, &second, camera, found.halved(&second, BIAS_PRIOR))
    }

    /// The views at these places.
    pub fn subset(&self, which: &[usize]) -> Survey {
        // A part of the views is asked for no replication.
        let alone = |&n: &usize| SurveyedView { second: false, ..self.views[n].clone() };
        let views: Vec<SurveyedView> = which.iter().map(alone).collect();
        let reach = Extent::of(views.iter().flat_map(|v| v.tiles.iter().map(|t| &t.place)));
        Survey {
            views,
            reach,
            fixed_px2: self.fixed_px2,
            light: self.light,
            tolerance: self.tolerance,
            refits_sigma: self.refits_sigma,
            learnt_from: self.learnt_from,
            ablation: self.ablation,
        }
    }

    /// Measure anew what the views' means are worth, with what was found of the bias taken out, px
    /// by view and pixel. `false`, and nothing is changed, where that changes little.
    pub fn reweigh(&mut self, fields: &[Field], bias: &[Vec<f32>]) -> bool {
        const LITTLE: f64 = 1.3;
        let views = fields.par_iter().zip(bias);
        let anew: Vec<(f64, Correlation)> = views.map(|(f, b)| inflation(f, b)).collect();
        let more = |(view, new): (&SurveyedView, &(f64, Correlation))| {
            new.0 > 0.0 && view.inflation > LITTLE * new.0
        };
        if !self.views.iter().zip(&anew).any(more) {
            return false;
        }
        for (view, (inflation, correlation)) in self.views.iter_mut().zip(anew) {
            if inflation < view.inflation {
                (view.inflation, view.correlation) = (inflation, correlation);
            }
        }
        true
    }

    /// Noise is what changes from frame to frame; `common` is the correlation of two frames of a
    /// view that comes from noise, by lag.
    pub fn compare_frames(&mut self, fields: &[Field], common: [f64; 3]) {
        for (view, field) in self.views.iter_mut().zip(fields) {
            let n = field.frames.len();
            if n < 2 {
                continue;
            }
            // Mean correlation of two different frames.
            let (mut sum, mut pairs) = (0.0, 0.0);
            for lag in 1..n {
                sum += (n - lag) as f64 * common[lag.min(3) - 1];
                pairs += (n - lag) as f64;
            }
            let mean = (sum / pairs).clamp(0.0, 0.9);
            view.moving = (mean < 0.9).then(|| n as f64 / (n as f64 - 1.0) / (1.0 - mean));
            view.frames = view.frames.min(n as f64 - 1.0);
        }
    }

    /// With what is known of the mean taken out of what the noise is measured on, view by view
    /// and pixel by pixel, px; and with variance that has another name already, px^2, or is
    /// stretched by a factor with the measurement itself.
    pub fn roughen(
        &mut self,
        fields: &[Field],
        bias: &[Vec<f32>],
        extra: impl Fn(&PixelContext) -> f64 + Sync,
        stretch: impl Fn(&PixelContext) -> f64 + Sync,
    ) {
        let width = fields.first().map_or(0, |f| f.width);
        self.views.par_iter_mut().zip(fields).enumerate().for_each(|(n, (view, field))| {
            let tiles = Arc::make_mut(&mut view.tiles);
            if let Some(bias) = bias.get(n) {
                super::tiles::roughen(tiles, field, bias, width);
            }
            for t in tiles {
                let (factor, more) = (stretch(&t.place), extra(&t.place));
                t.variance = t.variance * factor + more;
                t.place.variance = t.place.variance * factor + more;
            }
        });
    }

    /// Log variance over the model's, block by block.
    pub fn variance_data(&self) -> Vec<ViewData> {
        let blocks: Vec<Blocks> = self.views.par_iter().map(Blocks::of).collect();
        let scatter = view_scatter(&blocks, self.tolerance);
        blocks.into_iter().map(|b| b.data(scatter)).collect()
    }

    /// How the search of the variance decides.
    pub fn variance_rules(&self, level: f64) -> Rules {
        self.ablation.rules(Rules {
            level,
            prior: VARIANCE_PRIOR,
            adequacy: ADEQUATE,
            most_terms: MOST_TERMS,
            fixed: None,
            // What views differ by as wholes is mostly taken up by their own levels: small terms are
            // dropped when they are told, by their size on the axis.
            least: 0.0,
            calibrated: true,
            learnt_from: self.learnt_from[1],
        })
    }

    /// What is fitted beside every hypothesis of the variance.
    pub fn refitted(&self) -> Option<Candidate> {
        self.refits_sigma.then(|| variance::refit(&self.reach))
    }

    pub fn search_variance(
        &self,
        sigma: &SigmaModel,
        camera: &Camera,
        level: f64,
        seed: Seed,
    ) -> Outcome {
        let mut candidates = variance::candidates(&self.bounds(camera), sigma);
        let refit = self.refitted();
        if refit.is_some() {
            candidates.retain(variance::beyond_sigma);
        }
        let data = self.variance_data();
        let candidates = self.ablation.candidates(candidates);
        let refits = refit.is_some();
        let rules = self.variance_rules(level);
        let mut found = search_beside(&data, &data, &candidates, refit, &rules, seed);
        if refits {
            found = with_best_surface(&data, found, variance::surfaces(&self.reach));
        }
        cluster(&mut found);
        found.halved(&self.second(), VARIANCE_PRIOR)
    }

    /// Which half each view is in.
    pub fn second(&self) -> Vec<bool> {
        self.views.iter().map(|v| v.second).collect()
    }
}

/// Beside every hypothesis sigma was as free as can be; told is the surface that predicts views left
/// out best beside what was found, or none.
fn with_best_surface(data: &[ViewData], found: Outcome, surfaces: Vec<Candidate>) -> Outcome {
    let (refit, others): (Vec<Chosen>, Vec<Chosen>) =
        found.chosen.into_iter().partition(|c| c.candidate.family == Some(RECALIBRATE));
    let of = |surface: Option<&Candidate>| {
        let bases: Vec<&Basis> =
            others.iter().map(|c| &c.candidate).chain(surface).map(|c| &c.basis).collect();
        let evidence = evidence_of_bases(data, &bases);
        let fit = if bases.is_empty() { None } else { gain(&evidence, VARIANCE_PRIOR) };
        (evidence, fit)
    };
    let total = |fit: &Option<Gain>| fit.as_ref().map_or(0.0, |f| f.total);
    let mut best = (None, of(None));
    let alone = total(&best.1.1);
    for surface in surfaces {
        let with = of(Some(&surface));
        if total(&with.1) > total(&best.1.1) {
            best = (Some(surface), with);
        }
    }
    let (surface, (evidence, fit)) = best;
    let gain = total(&fit) - alone;
    let mut chosen = others;
    if let (Some(candidate), Some(old)) = (surface, refit.into_iter().next()) {
        chosen.push(Chosen { candidate, gain, ..old });
    }
    Outcome { chosen, fit, evidence, ..found }
}

/// The covariance of the terms, with the views as the sample.
fn cluster(found: &mut Outcome) {
    let Some(fit) = &mut found.fit else { return };
    let beyond: Vec<DVector<f64>> =
        found.evidence.iter().map(|e| &e.b - &e.a * &fit.beta).collect();
    fit.covariance = clustered(&fit.covariance, &beyond);
    let eigen = fit.covariance.clone().symmetric_eigen();
    let factor = |k: usize| eigen.eigenvectors.column(k) * eigen.eigenvalues[k].max(0.0).sqrt();
    found.covariance.factors =
        (0..eigen.eigenvalues.len()).map(|k| factor(k).as_slice().to_vec()).collect();
}

/// Light in units of the recording's median, what the room adds taken out.
fn relative_light(views: &mut [SurveyedView]) -> Light {
    let share = ambient_share(views);
    let mut all: Vec<f32> = Vec::new();
    for tile in views.iter_mut().flat_map(|v| Arc::make_mut(&mut v.tiles)) {
        let p = &mut tile.place;
        p.light /= 1.0 + share * p.ambient * far(p);
        if p.light.is_finite() {
            all.push(p.light as f32);
        }
    }
    let median = f64::from(crate::stats::median_in_place(&mut all));
    let usable = median > 0.0;
    for tile in views.iter_mut().flat_map(|v| Arc::make_mut(&mut v.tiles)) {
        let light = tile.place.light / median;
        tile.place.light = if usable && light.is_finite() { light } else { 1.0 };
    }
    Light { median: if usable { median } else { 0.0 }, ambient_share: share }
}

/// By this the pattern's light has fallen.
fn far(p: &PixelContext) -> f64 {
    p.z * p.z * (1.0 + p.x * p.x + p.y * p.y) / p.theta.cos().max(0.05)
}

/// Light of the room in the infrared image, a lux over the pattern at 1 m: amplitude times `far`
/// is a (1 + share lux far), a line through the views' medians.
fn ambient_share(views: &[SurveyedView]) -> f64 {
    let points: Vec<(f64, f64)> = views
        .iter()
        .filter_map(|v| {
            let mut light: Vec<f32> = v.tiles.iter().map(|t| t.place.light as f32).collect();
            light.retain(|l| l.is_finite());
            let middle = v.tiles.get(v.tiles.len() / 2)?.place;
            let x = middle.ambient * far(&middle);
            let y = f64::from(crate::stats::median_in_place(&mut light));
            (x > 0.0 && y > 0.0).then_some((x, y))
        })
        .collect();
    if points.len() < 4 {
        return 0.0;
    }
    // Errors are shares of the light.
    let n: f64 = points.iter().map(|p| p.1.powi(-2)).sum();
    let (x0, y0) = points.iter().fold((0.0, 0.0), |(x, y), p| {
        let w = p.1.powi(-2) / n;
        (x + w * p.0, y + w * p.1)
    });
    let (mut xx, mut xy) = (0.0, 0.0);
    for (x, y) in points {
        let w = y.powi(-2);
        xx += w * (x - x0).powi(2);
        xy += w * (x - x0) * (y - y0);
    }
    let slope = if xx > 0.0 { xy / xx } else { 0.0 };
    let level = y0 - slope * x0;
    if level > 0.0 { (slope / level).max(0.0) } else { 0.0 }
}

fn mean_data(view: &SurveyedView) -> ViewData {
    let tiles = &view.tiles;
    ViewData {
        places: tiles.iter().map(|t| t.place).collect(),
        response: tiles.iter().map(|t| finite(t.mean)).collect(),
        weight: tiles.iter().map(|t| finite(t.pixels / t.variance / view.inflation)).collect(),
        nuisance: tiles.iter().flat_map(|t| [1.0, t.place.x, t.place.y]).collect(),
        precision: vec![0.0; 3],
        gathered: Vec::new(),
    }
}

fn finite(v: f64) -> f64 {
    if v.is_finite() { v } else { 0.0 }
}

/// Patches large enough for a variance.
struct Blocks {
    places: Vec<PixelContext>,
    /// Logarithm of the variance over the model's.
    response: Vec<f64>,
    weight: Vec<f64>,
}

/// Side of a block, in tiles: 24 px, seven independent samples under a Kinect's window.
pub const BLOCK_TILES: usize = 6;

impl Blocks {
    fn of(view: &SurveyedView) -> Self {
        let side = (BLOCK_TILES * SIDE) as f64;
        let mut sums: std::collections::BTreeMap<(u32, u32), Sum> = Default::default();
        for t in view.tiles.iter() {
            let key = ((t.place.v / side) as u32, (t.place.u / side) as u32);
            sums.entry(key).or_default().add(t, view.moving);
        }
        // What the box's mean took with it.
        let taken = view.correlation.sum / (SMOOTH_PX * SMOOTH_PX) as f64;
        let kept = if view.moving.is_some() { 1.0 } else { 1.0 - taken };
        let mut blocks = Blocks { places: Vec::new(), response: Vec::new(), weight: Vec::new() };
        for s in sums.values() {
            // Half a block at least: a few pixels at the rim give no variance.
            if s.n < 0.5 * side * side || s.ratio <= 0.0 {
                continue;
            }
            let worth = s.n * view.frames / view.correlation.sum_of_squares;
            blocks.places.push(s.place);
            // The mean of log chi^2 / n is about -1 / n.
            blocks.response.push((s.ratio / s.n / kept.max(0.5)).ln() + 1.0 / worth);
            blocks.weight.push(0.5 * worth / (1.0 + 1.0 / worth) / view.doubt);
        }
        blocks
    }

    /// With a level of its own for the view, as uncertain as views scatter.
    fn data(self, level_scatter: f64) -> ViewData {
        ViewData {
            nuisance: vec![1.0; self.places.len()],
            places: self.places,
            response: self.response,
            weight: self.weight,
            precision: vec![1.0 / level_scatter],
            gathered: Vec::new(),
        }
    }

    fn level(&self) -> Option<(f64, f64)> {
        let (mut sum, mut n) = (0.0, 0.0);
        for (y, w) in self.response.iter().zip(&self.weight) {
            sum += w * y;
            n += w;
        }
        (n > 0.0).then(|| (sum / n, 1.0 / n))
    }
}

#[derive(Default)]
struct Sum {
    place: PixelContext,
    n: f64,
    ratio: f64,
}

impl Sum {
    fn add(&mut self, t: &Tile, moving: Option<f64>) {
        // With frames to compare, only what changes is noise; its still part is put back by what
        // frames have in common.
        let square = match moving {
            Some(factor) => t.temporal * factor,
            None => t.temporal + t.rough_square,
        };
        if !square.is_finite() {
            return;
        }
        if self.n == 0.0 {
            self.place = t.place;
        }
        self.n += t.pixels;
        self.ratio += t.pixels * square / t.variance;
        // The block lies where its tiles do on average; what is one for the view stays.
        let share = t.pixels / self.n;
        let mix = |a: &mut f64, b: f64| *a += share * (b - *a);
        let p = &mut self.place;
        mix(&mut p.u, t.place.u);
        mix(&mut p.v, t.place.v);
        mix(&mut p.x, t.place.x);
        mix(&mut p.y, t.place.y);
        mix(&mut p.z, t.place.z);
        mix(&mut p.disparity, t.place.disparity);
        mix(&mut p.radius, t.place.radius);
        mix(&mut p.right, t.place.right);
        mix(&mut p.down, t.place.down);
        mix(&mut p.variance, t.place.variance);
        mix(&mut p.edge, t.place.edge);
        mix(&mut p.light, t.place.light);
    }
}

/// A model's sigma is not known better than this from view to view, in log variance, where the views
/// are too few to show how they scatter.
const MODEL_TOLERANCE: f64 = 0.04;
/// And where they show it: the blocks of a view tell its level to about this. On 60 clean ray-traced
/// sets and 24 pairs of speckle runs one was called a mismatch with this floor (the
/// same with the larger one), and of causes worth 50 nats a third more were seen.
const LEVEL_SCATTER: f64 = 0.01;

/// Variance of the views' own levels beyond what their samples explain (a moment estimate after
/// DerSimonian and Laird), about laws of the distance and of the tilt: what a law explains is no
/// scatter. Enlarged for the laws that so few views have to settle.
fn view_scatter(blocks: &[Blocks], tolerance: f64) -> f64 {
    let floor = tolerance * tolerance;
    let levels: Vec<(&PixelContext, f64, f64)> = blocks
        .iter()
        .filter_map(|b| b.level().map(|(level, variance)| (&b.places[0], level, variance)))
        .collect();
    let n = levels.len();
    let laws = |p: &PixelContext| {
        let steep = p.theta.sin().powi(2);
        [1.0, p.z.ln(), steep, steep * (2.0 * p.azimuth).cos()]
    };
    let orders = match n {
        // By how much two runs differ by chance may follow any law of the distance.
        _ if tolerance > MODEL_TOLERANCE => 1,
        9.. => 4,
        _ => 2,
    };
    if n < orders + 2 {
        return floor;
    }
    let x = DMatrix::from_fn(n, orders, |i, k| laws(levels[i].0)[k]);
    let y = DVector::from_fn(n, |i, _| levels[i].1);
    // Views of one distance or one tilt leave laws without a meaning.
    let Some(Left { squares, free }) = left_by_fit(x, &y) else { return floor };
    let left = squares / free;
    let sampling = levels.iter().map(|l| l.2).sum::<f64>() / n as f64;
    let enlarged = if free > 3.0 { free / (free - 2.0) } else { 3.0 };
    let floor = if tolerance > MODEL_TOLERANCE { floor } else { LEVEL_SCATTER * LEVEL_SCATTER };
    ((left - sampling) * enlarged).max(floor)
}

/// How much less a pixel's mean is worth than the model says: its variance relative to the
/// model's, and how many pixels make one independent sample. Measured on what is left after a
/// smooth error, and what is known of the bias (px, by pixel, or empty), is taken out.
fn inflation(field: &Field, bias: &[f32]) -> (f64, Correlation) {
    let rough = if bias.is_empty() {
        rough(&field.mean, field)
    } else {
        let left: Vec<f32> = field.mean.iter().zip(bias).map(|(m, b)| m - b).collect();
        rough(&left, field)
    };
    let (mut sum, mut n) = (0.0, 0.0);
    for r in rough.iter().filter(|r| r.is_finite()) {
        sum += f64::from(*r).powi(2);
        n += 1.0;
    }
    let correlation = measure_correlation(&rough, field.width);
    let inflation = if n > 0.0 { (sum / n * correlation.sum).max(1e-6) } else { f64::INFINITY };
    (inflation, correlation)
}

/// Whitened residuals as an image, without what is smooth.
fn rough(residuals: &[f32], field: &Field) -> Vec<f32> {
    let whitened: Vec<f32> = residuals.iter().zip(&field.sigma).map(|(r, s)| r / s).collect();
    high_pass(&field.image(&whitened), field.width, field.height, SMOOTH_PX)
}

/// F frames whose noise is the same by a share rho are worth 1 / (rho^2 + (1 - rho^2) / F).
fn independent_frames(field: &Field) -> f64 {
    let [first, second, ..] = field.first.as_slice() else { return 1.0 };
    let rho = super::texture::same_pixel(&rough(first, field), &rough(second, field));
    let rho = if rho.is_finite() { rho.clamp(0.0, 1.0) } else { 0.0 };
    let frames = field.frames.len() as f64;
    1.0 / (rho * rho + (1.0 - rho * rho) / frames)
}
