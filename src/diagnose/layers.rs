//! The layers a mismatch may sit in, searched in order: the mean, then the size of the noise.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::bias::{self, Reach};
use super::evidence::Rows;
use super::field::Field;
use super::search::{Found, Rules, ViewRows, step};
use super::tiles::{Place, Tile, tiles};
use super::variance::{self, Sensible};
use crate::camera::{Camera, Rays};
use crate::rng::Seed;
use crate::stats::{Correlation, measure_correlation};

/// The tiles of all views, with how much each view is worth.
pub struct Layers {
    pub views: Vec<ViewTiles>,
    pub reach: Reach,
    pub camera: Camera,
    pub sensible: Sensible,
    /// What the bias layer explains of each tile, px.
    pub bias: Vec<Vec<f64>>,
}

pub struct ViewTiles {
    pub places: Vec<Place>,
    pub tiles: Vec<Tile>,
    /// Variance of a pixel's mean in units of the model's, times pixels per independent sample.
    pub inflation: f64,
    pub correlation: Correlation,
    /// Independent frames a view's variance is worth.
    pub frames: f64,
}

/// No more terms than this are looked for in a layer.
const MOST_TERMS: usize = 8;

impl Layers {
    pub fn of(fields: &[Field], camera: &Camera, rays: &Rays) -> Self {
        let start = fields.iter().map(|f| f.time_s).fold(f64::INFINITY, f64::min);
        let views: Vec<ViewTiles> = fields
            .par_iter()
            .map(|f| {
                let (inflation, correlation) = inflation(f, camera);
                let tiles = tiles(f, camera, rays, start);
                ViewTiles {
                    places: tiles.iter().map(|t| t.place).collect(),
                    tiles,
                    inflation,
                    correlation,
                    frames: independent_frames(f, camera),
                }
            })
            .collect();
        let reach = reach(&views);
        let bias = views.iter().map(|v| vec![0.0; v.tiles.len()]).collect();
        let sensible = Sensible {
            light: false,
            ambient: fields.iter().any(|f| f.ambient_lux.is_some_and(|a| a > 0.0)),
        };
        Layers { views, reach, camera: camera.clone(), sensible, bias }
    }

    /// Terms of the mean, best first; what they explain is kept in `bias`.
    pub fn search_bias(&mut self, level: f64, seed: Seed) -> Vec<Found> {
        // A coefficient nothing is known about is a few px at most.
        let rules = Rules { level, prior: 0.1, adequacy: ADEQUATE };
        let mut found = Vec::new();
        while found.len() < MOST_TERMS {
            let views = self.mean_rows();
            let mut candidates = bias::families(&self.camera, &self.reach);
            candidates.extend(bias::curves(&self.camera, &self.reach));
            let Some(term) = step(&views, candidates, &rules, seed) else { break };
            add(&term, &self.views, &mut self.bias);
            self.level();
            found.push(term);
        }
        found
    }

    /// Take each view's plane out of what is left: the first fit had bent it towards the bias.
    fn level(&mut self) {
        let planes: Vec<Option<[f64; 3]>> = self.mean_rows_of(|rows| rows.nuisances());
        for ((view, fitted), plane) in self.views.iter().zip(&mut self.bias).zip(planes) {
            let Some([c, a, b]) = plane else { continue };
            for (p, f) in view.places.iter().zip(fitted) {
                *f += c + a * p.x + b * p.y;
            }
        }
    }

    /// The views' mean residuals minus the bias found, about a plane of their own each.
    fn mean_rows(&self) -> Vec<ViewRows<'_>> {
        self.views
            .par_iter()
            .zip(&self.bias)
            .filter_map(|(view, fitted)| {
                let rows = mean_rows(view, fitted)?;
                Some(ViewRows { places: &view.places, rows })
            })
            .collect()
    }

    fn mean_rows_of<T>(&self, of: impl Fn(&Rows) -> T) -> Vec<Option<T>> {
        let views = self.views.iter().zip(&self.bias);
        views.map(|(view, fitted)| mean_rows(view, fitted).map(|rows| of(&rows))).collect()
    }

    /// Terms of the variance, best first.
    pub fn search_variance(&self, level: f64, seed: Seed) -> Vec<Found> {
        // Logarithms of a variance: a factor of e is already much.
        let rules = Rules { level, prior: 1.0, adequacy: ADEQUATE };
        let blocks: Vec<Blocks> =
            self.views.iter().zip(&self.bias).map(|(v, f)| Blocks::of(v, f)).collect();
        let mut fitted: Vec<Vec<f64>> = blocks.iter().map(|b| vec![0.0; b.places.len()]).collect();
        let mut found = Vec::new();
        while found.len() < MOST_TERMS {
            let level_scatter = view_scatter(&blocks, &fitted);
            let views: Vec<ViewRows<'_>> =
                blocks.iter().zip(&fitted).filter_map(|(b, f)| b.rows(f, level_scatter)).collect();
            let mut candidates = variance::families(&self.sensible);
            candidates.extend(variance::curves(&self.camera, &self.reach));
            let Some(term) = step(&views, candidates, &rules, seed) else { break };
            let mut row = Vec::new();
            let beta: Vec<f64> = term.gain.beta.iter().copied().collect();
            for (b, f) in blocks.iter().zip(&mut fitted) {
                for (p, f) in b.places.iter().zip(f) {
                    *f += term.candidate.value(&beta, p, &mut row);
                }
            }
            found.push(term);
        }
        found
    }
}

/// A name that explains less than this share of what a nameless curve explains is not the cause.
const ADEQUATE: f64 = 0.6;

fn add(term: &Found, views: &[ViewTiles], fitted: &mut [Vec<f64>]) {
    let beta: Vec<f64> = term.gain.beta.iter().copied().collect();
    let mut row = Vec::new();
    for (view, fitted) in views.iter().zip(fitted) {
        for (p, f) in view.places.iter().zip(fitted) {
            *f += term.candidate.value(&beta, p, &mut row);
        }
    }
}

fn mean_rows(view: &ViewTiles, fitted: &[f64]) -> Option<Rows> {
    let response = view.tiles.iter().zip(fitted).map(|(t, f)| finite(t.mean - f));
    let weight = |t: &Tile| finite(t.pixels / t.variance / view.inflation);
    let nuisance = DMatrix::from_fn(view.tiles.len(), 3, |i, q| {
        let p = &view.places[i];
        [1.0, p.x, p.y][q]
    });
    let weights = view.tiles.iter().map(weight).collect();
    Rows::new(response.collect(), weights, nuisance, &[0.0; 3])
}

fn finite(v: f64) -> f64 {
    if v.is_finite() { v } else { 0.0 }
}

fn reach(views: &[ViewTiles]) -> Reach {
    let all = || views.iter().flat_map(|v| v.places.iter());
    let range = |value: fn(&Place) -> f64| {
        all().map(value).fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)])
    };
    Reach {
        disparity: range(|p| p.disparity),
        right: range(|p| p.right),
        down: range(|p| p.down),
        edge: range(|p| p.edge)[1],
        z: range(|p| p.z),
        theta: range(|p| p.theta),
        session: range(|p| p.session_s),
        light: range(|p| p.light),
    }
}

/// Patches large enough for a variance.
struct Blocks {
    places: Vec<Place>,
    /// Logarithm of the variance over the model's.
    response: Vec<f64>,
    weight: Vec<f64>,
}

/// Side of a block, in tiles: 24 px, seven independent samples under a Kinect's window.
const BLOCK_TILES: f64 = 6.0;

impl Blocks {
    fn of(view: &ViewTiles, bias: &[f64]) -> Self {
        let mut sums: std::collections::BTreeMap<(u32, u32), Sum> = Default::default();
        let side = BLOCK_TILES * super::tiles::SIDE as f64;
        for (t, bias) in view.tiles.iter().zip(bias) {
            if !t.mean.is_finite() {
                continue;
            }
            let key = ((t.place.v / side) as u32, (t.place.u / side) as u32);
            sums.entry(key).or_default().add(t, *bias);
        }
        let mut blocks = Blocks { places: Vec::new(), response: Vec::new(), weight: Vec::new() };
        for s in sums.values() {
            // Half a block at least: a few pixels at the rim give no variance.
            if s.n < 0.5 * side * side || s.ratio <= 0.0 {
                continue;
            }
            let worth = s.n * view.frames / view.correlation.sum_of_squares;
            blocks.places.push(s.place);
            // The mean of log chi^2 / n is about -1 / n.
            blocks.response.push((s.ratio / s.n).ln() + 1.0 / worth);
            blocks.weight.push(0.5 * worth / (1.0 + 1.0 / worth));
        }
        blocks
    }

    /// With a level of its own for the view, as uncertain as views scatter.
    fn rows(&self, fitted: &[f64], level_scatter: f64) -> Option<ViewRows<'_>> {
        let response = self.response.iter().zip(fitted).map(|(y, f)| y - f).collect();
        let nuisance = DMatrix::from_element(self.places.len(), 1, 1.0);
        let precision = 1.0 / level_scatter.max(1e-9);
        let rows = Rows::new(response, self.weight.clone(), nuisance, &[precision])?;
        Some(ViewRows { places: &self.places, rows })
    }

    fn level(&self, fitted: &[f64]) -> Option<(f64, f64)> {
        let (mut sum, mut n) = (0.0, 0.0);
        for ((y, f), w) in self.response.iter().zip(fitted).zip(&self.weight) {
            sum += w * (y - f);
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
        if self.n == 0.0 {
            self.place = t.place;
        }
        let square = t.square - 2.0 * bias * t.mean + bias * bias;
        self.n += t.pixels;
        self.ratio += t.pixels * square / t.variance;
        // The block lies where its middle tile does; a running mean of the places that matter.
        let share = t.pixels / self.n;
        let mix = |a: f64, b: f64| a + share * (b - a);
        let p = &mut self.place;
        p.u = mix(p.u, t.place.u);
        p.v = mix(p.v, t.place.v);
        p.z = mix(p.z, t.place.z);
        p.disparity = mix(p.disparity, t.place.disparity);
        p.radius = mix(p.radius, t.place.radius);
        p.variance = mix(p.variance, t.place.variance);
        p.edge = mix(p.edge, t.place.edge);
        p.light = mix(p.light, t.place.light);
    }
}

/// Variance of the views' own levels beyond what their samples explain (DerSimonian and Laird's
/// moment estimate).
fn view_scatter(blocks: &[Blocks], fitted: &[Vec<f64>]) -> f64 {
    let levels: Vec<(f64, f64)> =
        blocks.iter().zip(fitted).filter_map(|(b, f)| b.level(f)).collect();
    let n = levels.len() as f64;
    if n < 3.0 {
        return 0.0;
    }
    let mean = levels.iter().map(|l| l.0).sum::<f64>() / n;
    let scatter = levels.iter().map(|l| (l.0 - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let sampling = levels.iter().map(|l| l.1).sum::<f64>() / n;
    (scatter - sampling).max(0.0)
}

/// How much less a pixel's mean is worth than the model says: its variance relative to the
/// model's, and how many pixels make one independent sample. Measured on what is left after a
/// smooth error is taken out.
fn inflation(field: &Field, camera: &Camera) -> (f64, Correlation) {
    let rough = rough(&field.mean, field, camera);
    let (mut sum, mut n) = (0.0, 0.0);
    for r in rough.iter().filter(|r| r.is_finite()) {
        sum += f64::from(*r).powi(2);
        n += 1.0;
    }
    let correlation = measure_correlation(&rough, camera.width);
    let inflation = if n > 0.0 { (sum / n * correlation.sum).max(1e-6) } else { f64::INFINITY };
    (inflation, correlation)
}

/// Whitened residuals as an image, without what is smooth.
fn rough(residuals: &[f32], field: &Field, camera: &Camera) -> Vec<f32> {
    let mut image = vec![f32::NAN; camera.pixels()];
    for (k, &i) in field.pixels.iter().enumerate() {
        image[i as usize] = residuals[k] / field.sigma[k];
    }
    super::smooth::high_pass(&image, camera.width, camera.height)
}

/// F frames whose noise is the same by a share rho are worth 1 / (rho^2 + (1 - rho^2) / F).
fn independent_frames(field: &Field, camera: &Camera) -> f64 {
    let [first, second, ..] = field.first.as_slice() else { return 1.0 };
    let (a, b) = (rough(first, field, camera), rough(second, field, camera));
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (&a, &b) in a.iter().zip(&b) {
        let (a, b) = (f64::from(a), f64::from(b));
        if (a * b).is_finite() {
            ab += a * b;
            aa += a * a;
            bb += b * b;
        }
    }
    let rho = if aa * bb > 0.0 { (ab / (aa * bb).sqrt()).clamp(0.0, 1.0) } else { 0.0 };
    let frames = field.frames.len() as f64;
    1.0 / (rho * rho + (1.0 - rho * rho) / frames)
}
