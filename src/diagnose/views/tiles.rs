//! Residuals averaged over tiles, which all searches work on.

use nalgebra::Vector3;

use super::board::board_frame;
use super::field::Field;
use crate::camera::{Camera, Rays};
use crate::diagnose::noise::texture::high_passed;
use crate::scene::TargetFrame;
use crate::terms::{PixelContext, Pixels, corner_radius};

/// Measurements of a patch of pixels. Its place is stored separately so that it can be shared.
#[derive(Debug, Clone, Copy)]
pub struct Tile {
    /// Mean residual, px.
    pub mean: f64,
    /// Mean square of single frames' residuals, px^2.
    pub square: f64,
    /// Mean square of the high-passed mean residual, px^2.
    pub rough_square: f64,
    /// Mean variance of a pixel over the frames, px^2, as if measured in all of them.
    pub temporal: f64,
    /// Share of the differences between frames that were measured; below one where readings are lost.
    pub repeated: f64,
    /// Model's variance of a pixel, px^2.
    pub variance: f64,
    /// Expected variance of the noise, px^2: `variance` until the search of the noise adds named causes.
    pub noise_variance: f64,
    /// Pixels with a mean.
    pub pixels: f64,
    /// Share of pixel-frames without a measurement, and the number of all pixel-frames.
    pub missing: f64,
    pub asked: f64,
}

#[cfg(test)]
impl Tile {
    /// Tile of white noise of this variance, px^2, measured in every frame.
    pub fn of_noise(variance: f64, pixels: f64) -> Self {
        Tile {
            mean: 0.0,
            square: variance,
            rough_square: variance,
            temporal: variance,
            repeated: 1.0,
            variance,
            noise_variance: variance,
            pixels,
            missing: 0.0,
            asked: 1.0,
        }
    }
}

/// Side of a tile, px: small against a Kinect's window of 9 px, so that ripples of a few px are
/// still seen.
pub const SIDE: usize = 4;

/// Width of the rim along the target's edge that is treated separately, px: the reach of a matching window of
/// 9 px in 640, and at least a tile.
pub fn rim_px(camera: &Camera) -> f64 {
    (camera.width as f64 / 80.0).max(SIDE as f64)
}

/// Places of a view's pixels and patches.
pub struct Places<'a> {
    field: &'a Field,
    camera: &'a Camera,
    rays: &'a Rays,
    board: TargetFrame,
    corner: f64,
    /// Values common to the whole view.
    view: PixelContext,
}

impl<'a> Places<'a> {
    pub fn of(field: &'a Field, camera: &'a Camera, rays: &'a Rays) -> Self {
        let mut view = PixelContext {
            side: SIDE as f64,
            session_s: field.session_s,
            ambient: field.ambient_lux.unwrap_or(0.0),
            temperature_c: field.temperature_c.unwrap_or(0.0),
            light: 1.0,
            variance: 1.0,
            ..PixelContext::default()
        };
        view.lean_on(&field.plane, &Pixels::new(camera, rays, field.scale_px_m));
        Places {
            field,
            camera,
            rays,
            board: board_frame(field, camera, rays),
            corner: corner_radius(camera),
            view,
        }
    }

    /// Place of pixel number `k` of the target, with the field's variance.
    pub fn pixel(&self, k: usize) -> PixelContext {
        let i = self.field.pixels[k] as usize;
        let (u, v) = ((i % self.camera.width) as f64, (i / self.camera.width) as f64);
        let edge = f64::from(self.field.edge[k]);
        let (x, y) = self.rays.at(i);
        let place = self.at(u, v, (x, y), edge);
        let variance = self.field.sigma.get(k).map_or(1.0, |s| f64::from(*s).powi(2));
        PixelContext { side: 1.0, variance, ..place }
    }

    fn at(&self, u: f64, v: f64, (x, y): (f64, f64), edge: f64) -> PixelContext {
        let (field, camera) = (self.field, self.camera);
        let z = field.plane.depth(x, y);
        let (right, down) = self.board.place(&(Vector3::new(x, y, 1.0) * z));
        PixelContext {
            u,
            v,
            x,
            y,
            disparity: field.scale_px_m / z,
            z,
            radius: ((u - camera.cx).powi(2) + (v - camera.cy).powi(2)).sqrt() / self.corner,
            right,
            down,
            edge,
            ..self.view
        }
    }
}

/// Places and tiles of a view.
pub fn tiles(field: &Field, camera: &Camera, rays: &Rays) -> (Vec<PixelContext>, Vec<Tile>) {
    let places = Places::of(field, camera, rays);
    let across = camera.width.div_ceil(SIDE);
    let rows = camera.height.div_ceil(SIDE);
    let mut sums = vec![Sums::default(); across * rows];
    let frames = field.frames.len() as f64;
    for (k, &i) in field.pixels.iter().enumerate() {
        let (u, v) = (i as usize % camera.width, i as usize / camera.width);
        let s = &mut sums[v / SIDE * across + u / SIDE];
        s.add(u, v, f64::from(field.edge[k]));
        s.asked += frames;
        s.missing += frames - f64::from(field.measured[k]);
        s.variance += f64::from(field.sigma[k]).powi(2);
        let (mean, square) = (f64::from(field.mean[k]), f64::from(field.square[k]));
        if mean.is_finite() {
            s.n += 1.0;
            s.mean += mean;
            s.square += square;
            let n = f64::from(field.count[k]);
            s.temporal += n * (square - mean * mean);
            s.repeats += n - 1.0;
            s.darkness += field.light.get(k).map_or(f64::NAN, |light| f64::from(*light).recip());
        }
    }
    let held = || sums.iter().filter(|s| s.pixels > 0.0);
    // Exact capacity: places and tiles are most of a survey's memory.
    let n = held().count();
    let mut patches: (Vec<PixelContext>, Vec<Tile>) =
        (Vec::with_capacity(n), Vec::with_capacity(n));
    patches.extend(held().map(|s| s.tile(&places, frames)));
    let (places, mut tiles) = patches;
    for (t, place) in tiles.iter_mut().zip(&places) {
        t.temporal -= field.moved_px2(place.disparity);
    }
    roughen(&mut tiles, &places, field, &[]);
    (places, tiles)
}

#[derive(Clone, Copy, Default)]
struct Sums {
    pixels: f64,
    u: f64,
    v: f64,
    edge: f64,
    n: f64,
    mean: f64,
    square: f64,
    /// Sum of squares over the frames, and its degrees of freedom.
    temporal: f64,
    repeats: f64,
    /// Sum of 1 / light; the noise scales with it.
    darkness: f64,
    variance: f64,
    asked: f64,
    missing: f64,
}

impl Sums {
    fn add(&mut self, u: usize, v: usize, edge: f64) {
        self.pixels += 1.0;
        self.u += u as f64;
        self.v += v as f64;
        self.edge += edge;
    }

    fn tile(&self, places: &Places<'_>, frames: f64) -> (PixelContext, Tile) {
        let (u, v) = (self.u / self.pixels, self.v / self.pixels);
        let place = places.at(u, v, places.camera.ray(u, v), self.edge / self.pixels);
        let variance = self.variance / self.pixels;
        // A single reading has no differences.
        let asked = frames - 1.0;
        let (temporal, repeated) = if self.repeats > 0.0 {
            (self.temporal / self.repeats * asked / frames, self.repeats / (self.n * asked))
        } else {
            (0.0, if asked > 0.0 { 0.0 } else { 1.0 })
        };
        let tile = Tile {
            mean: self.mean / self.n,
            square: self.square / self.n,
            rough_square: f64::NAN,
            temporal,
            repeated,
            variance,
            noise_variance: variance,
            pixels: self.n,
            missing: self.missing / self.asked,
            asked: self.asked,
        };
        (PixelContext { light: self.n / self.darkness, variance, ..place }, tile)
    }
}

/// Measures the high-passed mean, with the known bias subtracted (px by pixel, or empty).
pub fn roughen(tiles: &mut [Tile], places: &[PixelContext], field: &Field, bias: &[f32]) {
    let rough = high_passed(field, &field.mean, bias);
    let across = field.width.div_ceil(SIDE);
    let mut sums = vec![(0.0, 0.0); across * field.height.div_ceil(SIDE)];
    for &i in &field.pixels {
        let (u, v) = (i as usize % field.width, i as usize / field.width);
        let r = f64::from(rough[i as usize]);
        if r.is_finite() {
            let s = &mut sums[v / SIDE * across + u / SIDE];
            s.0 += r * r;
            s.1 += 1.0;
        }
    }
    for (t, place) in tiles.iter_mut().zip(places) {
        let s = sums[place.v as usize / SIDE * across + place.u as usize / SIDE];
        t.rough_square = s.0 / s.1;
    }
}

#[cfg(test)]
#[path = "tiles_tests.rs"]
mod tests;
