//! What all baselines are given: the recording's residuals about each view's plane, thinned.

use std::ops::Range;
use std::path::Path;

use rayon::prelude::*;

use crate::correct::Conditions;
use crate::diagnose::{Field, KnownTerms};
use crate::error::{Error, Result};
use crate::io::{Assumed, open};
use crate::measure::{MeasureOptions, Workbench};
use crate::model::NoiseModel;
use crate::prove::gain::Stand;
use crate::stats::median_in_place;
use crate::terms::{PixelContext, Pixels};
use crate::view::{Recording, Sensor};

/// Mean residual of a patch of pixels.
#[derive(Debug, Clone, Copy)]
pub struct Tile {
    pub place: PixelContext,
    /// Mean residual, px of disparity.
    pub mean: f64,
    /// Mean square of single frames' residuals, px^2.
    pub square: f64,
    /// Model's variance of a pixel in one frame, px^2.
    pub variance: f64,
    /// Measurements: pixels times frames.
    pub count: f64,
}

impl Tile {
    /// Square of the mean's standard error were all measurements independent, px^2.
    pub fn error_px2(&self) -> f64 {
        self.variance / self.count
    }
}

/// Of all views that show a plane.
#[derive(Debug, Clone)]
pub struct Tiles {
    pub sensor: Sensor,
    pub scale_px_m: f64,
    pub tiles: Vec<Tile>,
    /// Which are of one view.
    pub views: Vec<Range<usize>>,
}

/// Tiles across the picture, 2 px of 160 to 8 px of 640: over a steep and near target the disparity
/// changes by a pixel in ten, and a ripple must not be smeared.
const ACROSS: usize = 80;

impl Tiles {
    /// Of `recording/` in a folder, weighed by `model`, its effects taken out; what a `simulated/`
    /// recording beside it shows is taken out as well.
    ///
    /// # Errors
    /// When there is no recording, or no view shows a plane.
    pub fn of_folder(folder: &Path, model: &NoiseModel) -> Result<Self> {
        let open = |name: &str| open(&folder.join(name), &Assumed::default());
        let simulated = folder.join("simulated").is_dir();
        let twin = if simulated { Some(open("simulated")?) } else { None };
        Self::of(&open("recording")?, twin.as_ref(), model)
    }

    /// # Errors
    /// When no view shows a plane.
    pub fn of(recording: &Recording, twin: Option<&Recording>, model: &NoiseModel) -> Result<Self> {
        let sensor = &recording.sensor;
        let bench = Workbench::new(sensor, MeasureOptions::default());
        let known = match twin {
            // What it leaves in the twin it leaves in the recording.
            Some(_) => KnownTerms::default(),
            None => KnownTerms::of(model, &sensor.camera),
        };
        let stamps = recording.views.iter().filter_map(|v| v.depth.first());
        let start = stamps.map(|f| f.timestamp).fold(f64::INFINITY, f64::min);
        let read = |view| Field::read(view, &bench, &model.sigma, &known, start).ok();
        let fields: Vec<Option<Field>> = recording.views.par_iter().map(read).collect();
        let mut fields: Vec<Field> = fields.into_iter().flatten().collect();
        if let Some(twin) = twin {
            let bench = Workbench::new(&twin.sensor, MeasureOptions::default());
            let read = |view| Field::read(view, &bench, &model.sigma, &known, start).ok();
            let twins: Vec<Option<Field>> = twin.views.par_iter().map(read).collect();
            for field in &mut fields {
                if let Some(twin) = twins.iter().flatten().find(|t| t.name == field.name) {
                    take_out(field, twin);
                }
            }
        }
        even_light(&mut fields);
        let all: Vec<Vec<Tile>> = fields.par_iter().map(|f| thin(f, &bench, start)).collect();
        Self::join(sensor, all)
    }

    /// Put together what is known of each view.
    ///
    /// # Errors
    /// When there is nothing.
    pub fn join(sensor: &Sensor, all: Vec<Vec<Tile>>) -> Result<Self> {
        let scale_px_m =
            sensor.disparity_px_m().unwrap_or(sensor.camera.fx * crate::effects::KINECT_BASELINE_M);
        let (mut tiles, mut views) = (Vec::new(), Vec::new());
        for view in all.into_iter().filter(|v| v.len() > 3) {
            views.push(tiles.len()..tiles.len() + view.len());
            tiles.extend(view);
        }
        if views.is_empty() {
            return Err(Error::NotEnough {
                what: "no view shows a plane".into(),
                remedy: "record a flat target that fills the middle of the picture".into(),
            });
        }
        Ok(Tiles { sensor: sensor.clone(), scale_px_m, tiles, views })
    }

    /// Fewer and larger, in blocks as small as their number, at most `most`, allows; four a view are
    /// kept.
    pub fn blocks(&self, most: usize) -> Self {
        let fits = |across: &usize| self.occupied(*across) <= most;
        self.coarser((2..=ACROSS).rev().find(fits).unwrap_or(2))
    }

    /// Which of `across` x `across` blocks of the picture a tile lies in.
    fn block(&self, tile: &Tile, across: usize) -> usize {
        let camera = &self.sensor.camera;
        let part =
            |x: f64, size: usize| ((x / size as f64 * across as f64) as usize).min(across - 1);
        part(tile.place.v, camera.height) * across + part(tile.place.u, camera.width)
    }

    fn occupied(&self, across: usize) -> usize {
        let mut seen = vec![false; across * across];
        let mut count = 0;
        for range in &self.views {
            seen.fill(false);
            for t in &self.tiles[range.clone()] {
                let k = self.block(t, across);
                count += usize::from(!seen[k]);
                seen[k] = true;
            }
        }
        count
    }

    fn coarser(&self, across: usize) -> Self {
        let (mut tiles, mut views) = (Vec::new(), Vec::new());
        for range in &self.views {
            let mut blocks: Vec<Vec<&Tile>> = vec![Vec::new(); across * across];
            for t in &self.tiles[range.clone()] {
                blocks[self.block(t, across)].push(t);
            }
            let start = tiles.len();
            tiles.extend(blocks.iter().filter(|b| !b.is_empty()).map(|b| merged(b)));
            views.push(start..tiles.len());
        }
        Tiles { sensor: self.sensor.clone(), scale_px_m: self.scale_px_m, tiles, views }
    }

    /// The same places with noise alone: mean squares over the model's variance, and no mean.
    pub fn of_ratios(&self, ratios: &[f64]) -> Self {
        let mut noise = self.clone();
        for (t, ratio) in noise.tiles.iter_mut().zip(ratios) {
            t.mean = 0.0;
            t.square = ratio * t.variance;
        }
        noise
    }

    /// Ends of what the tiles span on an axis.
    pub fn span(&self, of: impl Fn(&PixelContext) -> f64) -> [f64; 2] {
        crate::stats::range(self.tiles.iter().map(|t| of(&t.place)))
    }
}

fn merged(tiles: &[&Tile]) -> Tile {
    let count: f64 = tiles.iter().map(|t| t.count).sum();
    let mean =
        |of: &dyn Fn(&Tile) -> f64| tiles.iter().map(|t| t.count * of(t)).sum::<f64>() / count;
    let places: Vec<PixelContext> = tiles.iter().map(|t| t.place).collect();
    let mut place = places[0];
    let weigh = |of: &dyn Fn(usize) -> f64| {
        tiles.iter().enumerate().map(|(i, t)| t.count * of(i)).sum::<f64>() / count
    };
    place.average(&places, &weigh);
    place.side *= (tiles.len() as f64).sqrt();
    Tile {
        place,
        mean: mean(&|t| t.mean),
        square: mean(&|t| t.square),
        variance: mean(&|t| t.variance),
        count,
    }
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

/// Light over the recording's median.
fn even_light(fields: &mut [Field]) {
    let mut all: Vec<f32> =
        fields.iter().flat_map(|f| f.light.iter().step_by(7)).copied().collect();
    let median = median_in_place(&mut all);
    if median > 0.0 {
        fields.iter_mut().flat_map(|f| &mut f.light).for_each(|l| *l /= median);
    }
}

fn thin(field: &Field, bench: &Workbench<'_>, start: f64) -> Vec<Tile> {
    let camera = &bench.sensor.camera;
    let side = (camera.width / ACROSS).max(1);
    let mut on_target = vec![false; camera.pixels()];
    field.pixels.iter().for_each(|&i| on_target[i as usize] = true);
    let conditions = Conditions {
        session_s: field.time_s - start,
        temperature_c: field.temperature_c,
        ambient_lux: field.ambient_lux,
    };
    let pixels = Pixels::new(camera, &bench.rays, field.scale_px_m);
    let stand = Stand::new(pixels, field.plane, &on_target, conditions);
    let across = camera.width.div_ceil(side);
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); across * camera.height.div_ceil(side)];
    for (k, &i) in field.pixels.iter().enumerate() {
        let i = i as usize;
        if field.mean[k].is_finite() && field.count[k] > 0 {
            members[i / camera.width / side * across + i % camera.width / side].push(k);
        }
    }
    let tile = |members: &Vec<usize>| {
        let one = |&k: &usize| {
            let mut place = stand.place(field.pixels[k] as usize);
            place.light = field.light.get(k).copied().map_or(1.0, f64::from);
            let variance = f64::from(field.sigma[k]).powi(2);
            place.variance = variance;
            let [mean, square] = [field.mean[k], field.square[k]].map(f64::from);
            Tile { place, mean, square, variance, count: f64::from(field.count[k]) }
        };
        let all: Vec<Tile> = members.iter().map(one).collect();
        merged(&all.iter().collect::<Vec<_>>())
    };
    members.iter().filter(|m| !m.is_empty()).map(tile).collect()
}
