//! Baselines: what others would do with the same recording. All get the same tiles of the residuals and
//! learn the disparity error. None of them asks whether there is anything to find, and none names a cause.

mod clams;
mod gaussian;

use std::collections::BTreeMap;
use std::path::Path;

use kinoise::diagnose::{Field, KnownTerms};
use kinoise::error::{Error, Result};
use kinoise::io::{Assumed, open};
use kinoise::measure::{MeasureOptions, Workbench};
use kinoise::model::NoiseModel;
use kinoise::view::Sensor;
use rayon::prelude::*;

use crate::gain::Predictor;
use crate::predictor::{plane_of, scale_px_m};
use crate::raytraced::question::ExamView;

/// Fits a baseline to tiles.
type Method = fn(&Tiles) -> Learnt;

pub const METHODS: [(&str, Method); 2] =
    [("clams-grid", clams::fit), ("gaussian-process", gaussian::fit)];

/// Residuals of a patch of pixels about their view's plane.
#[derive(Debug, Clone, Copy, Default)]
pub struct Tile {
    pub view: usize,
    /// Position in the image, px, and the plane's disparity there, px: all that these methods use.
    pub at: [f64; 3],
    /// Mean residual, px of disparity.
    pub mean: f64,
    /// The model's variance of one pixel in one frame, px^2.
    pub variance: f64,
    /// Measurements: pixels times frames.
    pub count: f64,
}

/// Tiles of all views that show a plane.
pub struct Tiles {
    pub sensor: Sensor,
    pub scale_px_m: f64,
    pub tiles: Vec<Tile>,
}

/// Tiles across the image, 2 px of 160 to 8 px of 640. On a steep, near target the disparity changes by a
/// pixel in ten, and a ripple must not be smeared.
const ACROSS: usize = 80;

impl Tiles {
    /// Tiles of `recording/` in a folder, weighted by `model`, with its effects removed.
    pub fn of_folder(folder: &Path, model: &NoiseModel) -> Result<Self> {
        let recording = open(&folder.join("recording"), &Assumed::default())?;
        let sensor = recording.sensor.clone();
        let known = KnownTerms::of(model, &sensor.camera);
        let bench = Workbench::new(&sensor, MeasureOptions::default());
        let start = recording.start_s();
        let read = |view| Field::read(view, &bench, &model.sigma, &known, start).ok();
        let fields: Vec<Field> = recording.views.par_iter().filter_map(read).collect();
        let side = (sensor.camera.width / ACROSS).max(1);
        let rays = sensor.camera.rays();
        let thin = |(view, field): (usize, &Field)| {
            let pixels = field.pixels.iter().enumerate();
            let single = pixels.filter(|(k, _)| field.mean[*k].is_finite() && field.count[*k] > 0);
            merged(single.map(|(k, &i)| {
                let (u, v) = (i as usize % field.width, i as usize / field.width);
                let tile = Tile {
                    view,
                    at: [u as f64, v as f64, field.disparity(k, &rays)],
                    mean: f64::from(field.mean[k]),
                    variance: f64::from(field.sigma[k]).powi(2),
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
        let scale_px_m = scale_px_m(&sensor);
        Ok(Tiles { sensor, scale_px_m, tiles })
    }

    /// Merges the tiles into blocks, as small as possible with at most `max` of them.
    fn blocks(&self, max: usize) -> Vec<Tile> {
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

/// Merges tiles of the same key, weighted by their measurements.
fn merged(tiles: impl Iterator<Item = ([usize; 2], Tile)>) -> Vec<Tile> {
    let mut sums: BTreeMap<[usize; 2], Tile> = BTreeMap::new();
    for (key, t) in tiles {
        let sum = sums.entry(key).or_insert(Tile { view: t.view, ..Tile::default() });
        (0..3).for_each(|k| sum.at[k] += t.count * t.at[k]);
        sum.mean += t.count * t.mean;
        sum.variance += t.count * t.variance;
        sum.count += t.count;
    }
    let mean = |sum: Tile| Tile {
        at: sum.at.map(|x| x / sum.count),
        mean: sum.mean / sum.count,
        variance: sum.variance / sum.count,
        ..sum
    };
    sums.into_values().map(mean).collect()
}

/// Learnt disparity error, px, as a function of u and v, px, and the disparity, px.
pub struct Learnt {
    scale_px_m: f64,
    bias: Box<dyn Fn([f64; 3]) -> f64 + Send + Sync>,
    /// Evaluated every so many pixels in both directions and constant in between.
    stride: usize,
}

impl Predictor for Learnt {
    fn correct(&self, view: &ExamView, depth: &mut [f32]) -> Result<()> {
        let camera = &view.sensor.camera;
        let rays = camera.rays();
        let Some(plane) = plane_of(depth, camera, &rays) else { return Ok(()) };
        let blocks = camera.width.div_ceil(self.stride);
        let middle = |k: usize, size: usize| (k * self.stride + self.stride / 2).min(size - 1);
        let value = |block: usize| {
            let u = middle(block % blocks, camera.width);
            let v = middle(block / blocks, camera.height);
            let (x, y) = rays.at(v * camera.width + u);
            (self.bias)([u as f64, v as f64, self.scale_px_m * plane.inverse_depth(x, y)])
        };
        let all = blocks * camera.height.div_ceil(self.stride);
        let bias: Vec<f64> = (0..all).into_par_iter().map(value).collect();
        for (i, z) in depth.iter_mut().enumerate().filter(|(_, z)| z.is_finite()) {
            let (u, v) = (i % camera.width, i / camera.width);
            let b = bias[v / self.stride * blocks + u / self.stride];
            let d = self.scale_px_m / f64::from(*z) - if b.is_finite() { b } else { 0.0 };
            *z = if d > 0.0 { (self.scale_px_m / d) as f32 } else { f32::INFINITY };
        }
        Ok(())
    }
}
