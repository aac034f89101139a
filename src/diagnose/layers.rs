//! The layers a mismatch may sit in: the mean, and the size of the noise.

use rayon::prelude::*;

use super::bias;
use super::field::Field;
use super::reach::Reach;
use super::search::{Outcome, Rules, ViewData, search};
use super::smooth::{SMOOTH_PX, high_pass};
use super::tiles::{SIDE, Tile, tiles};
use super::variance;
use crate::camera::{Camera, Rays};
use crate::model::SigmaModel;
use crate::rng::Seed;
use crate::stats::{Correlation, measure_correlation};
use crate::terms::{Place, Term};

/// The tiles of all views, with how much each view is worth.
pub struct Survey {
    pub views: Vec<SurveyedView>,
    pub reach: Reach,
}

#[derive(Clone)]
pub struct SurveyedView {
    pub name: String,
    pub tiles: Vec<Tile>,
    /// Variance of a pixel's mean in units of the model's, times pixels per independent sample.
    pub inflation: f64,
    pub correlation: Correlation,
    /// Independent frames a view's variance is worth.
    pub frames: f64,
}

/// No more terms than this are looked for in a layer.
const MOST_TERMS: usize = 8;
/// A name that explains less than this share of what a nameless curve explains is not the cause.
const ADEQUATE: f64 = 0.6;
/// Precision of a coefficient of the bias: a few px at most.
pub const BIAS_PRIOR: f64 = 0.1;
/// Of one of log variance: a factor of e is already much.
pub const VARIANCE_PRIOR: f64 = 1.0;

impl Survey {
    pub fn of(fields: &[Field], camera: &Camera, rays: &Rays) -> Self {
        let start = fields.iter().map(|f| f.time_s).fold(f64::INFINITY, f64::min);
        let mut views: Vec<SurveyedView> = fields
            .par_iter()
            .map(|f| {
                let (inflation, correlation) = inflation(f);
                let tiles = tiles(f, camera, rays, start);
                SurveyedView {
                    name: f.name.clone(),
                    tiles,
                    inflation,
                    correlation,
                    frames: independent_frames(f),
                }
            })
            .collect();
        relative_light(&mut views);
        let reach = Reach::of(views.iter().flat_map(|v| v.tiles.iter()));
        Survey { views, reach }
    }

    /// The views' mean residuals, about a plane of their own each.
    pub fn mean_data(&self) -> Vec<ViewData> {
        self.views.par_iter().map(mean_data).collect()
    }

    pub fn search_bias(&self, camera: &Camera, level: f64, seed: Seed) -> Outcome {
        let rules =
            Rules { level, prior: BIAS_PRIOR, adequacy: ADEQUATE, most_terms: MOST_TERMS };
        let mut candidates = bias::families(camera, &self.reach);
        candidates.extend(bias::curves(camera, &self.reach));
        let fine = self.mean_data();
        let coarse: Vec<ViewData> = fine.par_iter().map(coarser).collect();
        search(&fine, &coarse, &candidates, &rules, seed)
    }

    /// The views at these places.
    pub fn subset(&self, which: &[usize]) -> Survey {
        let views: Vec<SurveyedView> = which.iter().map(|&n| self.views[n].clone()).collect();
        let reach = Reach::of(views.iter().flat_map(|v| v.tiles.iter()));
        Survey { views, reach }
    }

    /// Log variance over the model's, block by block, once the terms of the bias are taken out.
    pub fn variance_data(&self, bias: &[Term]) -> Vec<ViewData> {
        let blocks: Vec<Blocks> = self.views.par_iter().map(|v| Blocks::of(v, bias)).collect();
        let scatter = view_scatter(&blocks);
        blocks.into_iter().map(|b| b.data(scatter)).collect()
    }

    pub fn search_variance(
        &self,
        bias: &[Term],
        sigma: &SigmaModel,
        camera: &Camera,
        level: f64,
        seed: Seed,
    ) -> Outcome {
        let rules =
            Rules { level, prior: VARIANCE_PRIOR, adequacy: ADEQUATE, most_terms: MOST_TERMS };
        let mut candidates = variance::families(&self.reach, sigma);
        candidates.extend(variance::curves(camera, &self.reach));
        let data = self.variance_data(bias);
        search(&data, &data, &candidates, &rules, seed)
    }
}

/// Light in units of the recording's median.
fn relative_light(views: &mut [SurveyedView]) {
    let mut all: Vec<f32> = views
        .iter()
        .flat_map(|v| v.tiles.iter().map(|t| t.place.light as f32))
        .filter(|l| l.is_finite())
        .collect();
    let median = f64::from(crate::stats::median_in_place(&mut all));
    let usable = median > 0.0;
    for tile in views.iter_mut().flat_map(|v| &mut v.tiles) {
        let light = tile.place.light / median;
        tile.place.light = if usable && light.is_finite() { light } else { 1.0 };
    }
}

fn mean_data(view: &SurveyedView) -> ViewData {
    let tiles = &view.tiles;
    ViewData {
        places: tiles.iter().map(|t| t.place).collect(),
        response: tiles.iter().map(|t| finite(t.mean)).collect(),
        weight: tiles.iter().map(|t| finite(t.pixels / t.variance / view.inflation)).collect(),
        nuisance: tiles.iter().flat_map(|t| [1.0, t.place.x, t.place.y]).collect(),
        precision: vec![0.0; 3],
    }
}

/// Two tiles by two made one.
pub fn coarser(fine: &ViewData) -> ViewData {
    let side = (2 * SIDE) as f64;
    let p = fine.precision.len();
    let mut groups: std::collections::BTreeMap<(u32, u32), Vec<usize>> = Default::default();
    for (i, place) in fine.places.iter().enumerate() {
        let key = ((place.v / side) as u32, (place.u / side) as u32);
        groups.entry(key).or_default().push(i);
    }
    let mut coarse = ViewData {
        places: Vec::with_capacity(groups.len()),
        response: Vec::with_capacity(groups.len()),
        weight: Vec::with_capacity(groups.len()),
        nuisance: Vec::with_capacity(groups.len() * p),
        precision: fine.precision.clone(),
    };
    for members in groups.values() {
        let weight: f64 = members.iter().map(|&i| fine.weight[i]).sum();
        let mean = |of: &dyn Fn(usize) -> f64| {
            if weight > 0.0 {
                members.iter().map(|&i| fine.weight[i] * of(i)).sum::<f64>() / weight
            } else {
                of(members[0])
            }
        };
        let mut place = fine.places[members[0]];
        place.average(&fine.places, &mean);
        place.side = side;
        coarse.places.push(place);
        coarse.response.push(mean(&|i| fine.response[i]));
        coarse.weight.push(weight);
        coarse.nuisance.extend((0..p).map(|q| mean(&|i| fine.nuisance[i * p + q])));
    }
    coarse
}

fn finite(v: f64) -> f64 {
    if v.is_finite() { v } else { 0.0 }
}

/// Patches large enough for a variance.
struct Blocks {
    places: Vec<Place>,
    /// Logarithm of the variance over the model's.
    response: Vec<f64>,
    weight: Vec<f64>,
}

/// Side of a block, in tiles: 24 px, seven independent samples under a Kinect's window.
const BLOCK_TILES: usize = 6;

impl Blocks {
    fn of(view: &SurveyedView, bias: &[Term]) -> Self {
        let fitted = rough_bias(&view.tiles, bias);
        let side = (BLOCK_TILES * SIDE) as f64;
        let mut sums: std::collections::BTreeMap<(u32, u32), Sum> = Default::default();
        for (t, bias) in view.tiles.iter().zip(&fitted) {
            let key = ((t.place.v / side) as u32, (t.place.u / side) as u32);
            sums.entry(key).or_default().add(t, *bias);
        }
        // What the box's mean took with it.
        let kept = 1.0 - view.correlation.sum / (SMOOTH_PX * SMOOTH_PX) as f64;
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
            blocks.weight.push(0.5 * worth / (1.0 + 1.0 / worth));
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
    place: Place,
    n: f64,
    ratio: f64,
}

impl Sum {
    fn add(&mut self, t: &Tile, bias: f64) {
        // The rough part of the mean without the rough part of the bias.
        let rough = t.rough_square - 2.0 * bias * t.rough + bias * bias;
        let square = t.temporal + rough;
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

/// The bias at the tiles, without what is smooth, px.
fn rough_bias(tiles: &[Tile], bias: &[Term]) -> Vec<f64> {
    if bias.is_empty() {
        return vec![0.0; tiles.len()];
    }
    let side = SIDE as f64;
    let across = tiles.iter().map(|t| (t.place.u / side) as usize + 1).max().unwrap_or(1);
    let down = tiles.iter().map(|t| (t.place.v / side) as usize + 1).max().unwrap_or(1);
    let at = |t: &Tile| (t.place.v / side) as usize * across + (t.place.u / side) as usize;
    let mut image = vec![f32::NAN; across * down];
    let mut row = Vec::new();
    for t in tiles {
        image[at(t)] = bias.iter().map(|b| b.value(&t.place, &mut row)).sum::<f64>() as f32;
    }
    let rough = high_pass(&image, across, down, SMOOTH_PX / SIDE);
    tiles.iter().map(|t| f64::from(rough[at(t)])).collect()
}

/// A model's sigma is not known better than this from view to view, in log variance.
const MODEL_TOLERANCE: f64 = 0.05;

/// Variance of the views' own levels beyond what their samples explain (DerSimonian and Laird's
/// moment estimate), about a line in log z: what a law of the distance explains is no scatter.
fn view_scatter(blocks: &[Blocks]) -> f64 {
    let levels: Vec<(f64, f64, f64)> = blocks
        .iter()
        .filter_map(|b| b.level().map(|(y, v)| (b.places[0].z.ln(), y, v)))
        .collect();
    let floor = MODEL_TOLERANCE * MODEL_TOLERANCE;
    let n = levels.len() as f64;
    if n < 4.0 {
        return floor;
    }
    let (x0, y0) = levels.iter().fold((0.0, 0.0), |(x, y), l| (x + l.0 / n, y + l.1 / n));
    let (mut xx, mut xy) = (1e-9, 0.0);
    for l in &levels {
        xx += (l.0 - x0).powi(2);
        xy += (l.0 - x0) * (l.1 - y0);
    }
    let slope = xy / xx;
    let scatter =
        levels.iter().map(|l| (l.1 - y0 - slope * (l.0 - x0)).powi(2)).sum::<f64>() / (n - 2.0);
    let sampling = levels.iter().map(|l| l.2).sum::<f64>() / n;
    (scatter - sampling).max(floor)
}

/// How much less a pixel's mean is worth than the model says: its variance relative to the
/// model's, and how many pixels make one independent sample. Measured on what is left after a
/// smooth error is taken out.
fn inflation(field: &Field) -> (f64, Correlation) {
    let rough = rough(&field.mean, field);
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
    let rho = super::structure::same_pixel(&rough(first, field), &rough(second, field));
    let rho = if rho.is_finite() { rho.clamp(0.0, 1.0) } else { 0.0 };
    let frames = field.frames.len() as f64;
    1.0 / (rho * rho + (1.0 - rho * rho) / frames)
}
