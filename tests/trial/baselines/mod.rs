//! What others would do with the same recording: all get the same tiles of the residuals. None of
//! them asks whether there is anything to find, and none gives a name.

mod clams;
mod gaussian;

pub use clams::Clams;
pub use gaussian::GaussianProcess;

use std::collections::BTreeMap;
use std::path::Path;

use kinoise::diagnose::{Field, KnownTerms};
use kinoise::error::{Error, Result};
use kinoise::io::{Assumed, open};
use kinoise::measure::{MeasureOptions, Workbench};
use kinoise::model::NoiseModel;
use kinoise::view::{Recording, Sensor};
use rayon::prelude::*;

use crate::predictor::{MAX_LOG_VARIANCE, plane_of, scale_px_m};
use crate::raytraced::question::{ExamView, Predictor};

/// Residuals of a patch of pixels about their view's plane.
#[derive(Debug, Clone, Copy, Default)]
pub struct Tile {
    pub view: usize,
    /// Place in the picture, px, and the plane's disparity there, px: all that these methods look at.
    pub at: [f64; 3],
    /// Mean residual, px of disparity.
    pub mean: f64,
    /// Mean square of single frames' residuals over the model's variance.
    pub ratio: f64,
    /// Model's variance of a pixel in one frame, px^2.
    pub variance: f64,
    /// Measurements: pixels times frames.
    pub count: f64,
}

/// Of all views that show a plane.
pub struct Tiles {
    pub sensor: Sensor,
    pub scale_px_m: f64,
    pub tiles: Vec<Tile>,
}

/// Tiles across the picture, 2 px of 160 to 8 px of 640: over a steep and near target the disparity
/// changes by a pixel in ten, and a ripple must not be smeared.
const ACROSS: usize = 80;

impl Tiles {
    /// Of `recording/` in a folder, weighed by `model`, its effects taken out; what a `simulated/`
    /// recording beside it shows is taken out as well.
    pub fn of_folder(folder: &Path, model: &NoiseModel) -> Result<Self> {
        let open = |name: &str| open(&folder.join(name), &Assumed::default());
        let twin = if folder.join("simulated").is_dir() { Some(open("simulated")?) } else { None };
        let recording = open("recording")?;
        let known = match twin {
            // What it leaves in the twin it leaves in the recording.
            Some(_) => KnownTerms::default(),
            None => KnownTerms::of(model, &recording.sensor.camera),
        };
        let mut fields = fields(&recording, model, &known);
        if let Some(twin) = &twin {
            let twins = self::fields(twin, model, &known);
            for field in &mut fields {
                if let Some(twin) = twins.iter().find(|t| t.name == field.name) {
                    take_out(field, twin);
                }
            }
        }
        let sensor = recording.sensor.clone();
        let side = (sensor.camera.width / ACROSS).max(1);
        let rays = sensor.camera.rays();
        let thin = |(view, field): (usize, &Field)| {
            let pixels = field.pixels.iter().enumerate();
            let single = pixels.filter(|(k, _)| field.mean[*k].is_finite() && field.count[*k] > 0);
            merged(single.map(|(k, &i)| {
                let (u, v) = (i as usize % field.width, i as usize / field.width);
                let variance = f64::from(field.sigma[k]).powi(2);
                let tile = Tile {
                    view,
                    at: [u as f64, v as f64, field.disparity(k, &rays)],
                    mean: f64::from(field.mean[k]),
                    ratio: f64::from(field.square[k]) / variance,
                    variance,
                    count: f64::from(field.count[k]),
                };
                ([v / side, u / side], tile)
            }))
        };
        let tiles: Vec<Tile> = fields.iter().enumerate().flat_map(thin).collect();
        if tiles.is_empty() {
            return Err(Error::NotEnough {
                what: "no view shows a plane".into(),
                remedy: "record a flat target that fills the middle of the picture".into(),
            });
        }
        Ok(Tiles { scale_px_m: scale_px_m(&sensor), sensor, tiles })
    }

    /// Fewer and larger, in blocks as small as their number, at most `max`, allows.
    pub fn blocks(&self, max: usize) -> Vec<Tile> {
        let camera = &self.sensor.camera;
        let of = |across: usize| {
            let part = |x: f64, size: usize| (x / size as f64 * across as f64) as usize;
            let mut views: BTreeMap<usize, Vec<([usize; 2], Tile)>> = BTreeMap::new();
            for t in &self.tiles {
                let block = [part(t.at[1], camera.height), part(t.at[0], camera.width)];
                views.entry(t.view).or_default().push((block, *t));
            }
            views.into_values().flat_map(|view| merged(view.into_iter())).collect::<Vec<_>>()
        };
        (2..=ACROSS / 4).rev().map(of).find(|b| b.len() <= max).unwrap_or_else(|| of(2))
    }
}

/// Tiles of the same key as one, weighed by their measurements.
fn merged(tiles: impl Iterator<Item = ([usize; 2], Tile)>) -> Vec<Tile> {
    let mut sums: BTreeMap<[usize; 2], Tile> = BTreeMap::new();
    for (key, t) in tiles {
        let sum = sums.entry(key).or_insert(Tile { view: t.view, ..Tile::default() });
        (0..3).for_each(|k| sum.at[k] += t.count * t.at[k]);
        sum.mean += t.count * t.mean;
        sum.ratio += t.count * t.ratio;
        sum.variance += t.count * t.variance;
        sum.count += t.count;
    }
    let mean = |sum: Tile| Tile {
        at: sum.at.map(|x| x / sum.count),
        mean: sum.mean / sum.count,
        ratio: sum.ratio / sum.count,
        variance: sum.variance / sum.count,
        ..sum
    };
    sums.into_values().map(mean).collect()
}

fn fields(recording: &Recording, model: &NoiseModel, known: &KnownTerms) -> Vec<Field> {
    let bench = Workbench::new(&recording.sensor, MeasureOptions::default());
    let stamps = recording.views.iter().filter_map(|v| v.depth.first());
    let start = stamps.map(|f| f.timestamp).fold(f64::INFINITY, f64::min);
    let read = |view| Field::read(view, &bench, &model.sigma, known, start).ok();
    let fields: Vec<Option<Field>> = recording.views.par_iter().map(read).collect();
    fields.into_iter().flatten().collect()
}

/// Take the simulated twin's mean residual out of a view.
fn take_out(field: &mut Field, twin: &Field) {
    let theirs = twin.image(&twin.mean);
    for k in 0..field.pixels.len() {
        let simulated = theirs.get(field.pixels[k] as usize).copied().unwrap_or(f32::NAN);
        let mean = field.mean[k];
        field.square[k] += simulated * (simulated - 2.0 * mean);
        field.mean[k] = mean - simulated;
    }
}

/// A number for a place: u and v, px, and the disparity, px.
pub type AtPlace = Box<dyn Fn([f64; 3]) -> f64 + Send + Sync>;

/// Functions of the place, put to use on a view.
pub struct Learnt {
    pub scale_px_m: f64,
    /// Error of the disparity, px.
    pub bias: AtPlace,
    /// Logarithm of the variance over the model's.
    pub log_variance: Option<AtPlace>,
    /// Evaluated at every so many pixels each way, and held between.
    pub stride: usize,
}

impl Learnt {
    /// Of every pixel of the view, on the plane that its depth shows.
    fn everywhere(&self, view: &ExamView, depth: &[f32], of: &AtPlace) -> Vec<f64> {
        let camera = &view.sensor.camera;
        let rays = camera.rays();
        let Some(plane) = plane_of(depth, camera, &rays) else { return vec![0.0; depth.len()] };
        let blocks = camera.width.div_ceil(self.stride);
        let middle = |k: usize, size: usize| (k * self.stride + self.stride / 2).min(size - 1);
        let value = |block: usize| {
            let u = middle(block % blocks, camera.width);
            let v = middle(block / blocks, camera.height);
            let (x, y) = rays.at(v * camera.width + u);
            of([u as f64, v as f64, self.scale_px_m * plane.inverse_depth(x, y)])
        };
        let all: Vec<f64> =
            (0..blocks * camera.height.div_ceil(self.stride)).into_par_iter().map(value).collect();
        let at = |i: usize| {
            let (u, v) = (i % camera.width, i / camera.width);
            let value = all[v / self.stride * blocks + u / self.stride];
            if value.is_finite() { value } else { 0.0 }
        };
        (0..depth.len()).map(at).collect()
    }
}

impl Predictor for Learnt {
    fn correct(&self, view: &ExamView, depth: &mut [f32]) -> Result<()> {
        let bias = self.everywhere(view, depth, &self.bias);
        for (z, b) in depth.iter_mut().zip(bias).filter(|(z, _)| z.is_finite()) {
            let d = self.scale_px_m / f64::from(*z) - b;
            *z = if d > 0.0 { (self.scale_px_m / d) as f32 } else { f32::INFINITY };
        }
        Ok(())
    }

    fn sigma(&self, view: &ExamView, depth: &[f32]) -> Vec<f32> {
        let Some(log) = &self.log_variance else { return view.sigma_plain.clone() };
        let log = self.everywhere(view, depth, log);
        let limit = |l: f64| l.clamp(-MAX_LOG_VARIANCE, MAX_LOG_VARIANCE);
        let plain = view.sigma_plain.iter();
        plain.zip(log).map(|(s, l)| (f64::from(*s) * (0.5 * limit(l)).exp()) as f32).collect()
    }
}
