//! Residuals thinned to tiles: what all searches work on.

use nalgebra::Vector3;

use super::field::Field;
use super::smooth::{SMOOTH_PX, high_pass};
use crate::camera::{Camera, Rays};
use crate::scene::TargetFrame;
use crate::terms::{Place, corner_radius};

/// Mean residual of a patch of pixels.
#[derive(Debug, Clone, Copy)]
pub struct Tile {
    pub place: Place,
    /// Mean residual, px.
    pub mean: f64,
    /// Mean residual without what is smooth, and its mean square, px and px^2.
    pub rough: f64,
    pub rough_square: f64,
    /// Mean variance of a pixel over the frames, px^2.
    pub temporal: f64,
    /// Model's variance of a pixel, px^2.
    pub variance: f64,
    /// Pixels with a mean.
    pub pixels: f64,
    /// Share of pixel-frames without a measurement, and their number.
    pub missing: f64,
    pub asked: f64,
}

/// Side of a tile, px: small against a Kinect's window of 9 px, so that ripples of a few px are
/// still seen.
pub const SIDE: usize = 4;

/// The tiles of a view.
pub fn tiles(field: &Field, camera: &Camera, rays: &Rays, session_start: f64) -> Vec<Tile> {
    let edge = edge_distances(field, camera);
    let frame = board_frame(field, rays);
    let across = camera.width.div_ceil(SIDE);
    let rows = camera.height.div_ceil(SIDE);
    let mut sums = vec![Sums::default(); across * rows];
    let frames = field.frames.len() as f64;
    let rough = high_pass(&field.image(&field.mean), camera.width, camera.height, SMOOTH_PX);
    for (k, &i) in field.pixels.iter().enumerate() {
        let (u, v) = (i as usize % camera.width, i as usize / camera.width);
        let s = &mut sums[v / SIDE * across + u / SIDE];
        s.add(u, v, f64::from(edge[i as usize]));
        s.asked += frames;
        s.missing += frames - f64::from(field.measured[k]);
        let (mean, square) = (f64::from(field.mean[k]), f64::from(field.square[k]));
        if mean.is_finite() {
            s.n += 1.0;
            s.mean += mean;
            s.temporal += square - mean * mean;
            let rough = f64::from(rough[i as usize]);
            if rough.is_finite() {
                s.rough_n += 1.0;
                s.rough += rough;
                s.rough_square += rough * rough;
            }
            s.light += f64::from(field.light.get(k).copied().unwrap_or(1.0));
            s.variance += f64::from(field.sigma[k]).powi(2);
        }
    }
    let corner = corner_radius(camera);
    sums.iter()
        .filter(|s| s.pixels > 0.0)
        .map(|s| s.tile(field, camera, &frame, corner, session_start))
        .collect()
}

#[derive(Clone, Copy, Default)]
struct Sums {
    pixels: f64,
    u: f64,
    v: f64,
    edge: f64,
    n: f64,
    mean: f64,
    temporal: f64,
    rough_n: f64,
    rough: f64,
    rough_square: f64,
    light: f64,
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

    fn tile(
        &self,
        field: &Field,
        camera: &Camera,
        board: &TargetFrame,
        corner: f64,
        session_start: f64,
    ) -> Tile {
        let (u, v) = (self.u / self.pixels, self.v / self.pixels);
        let (x, y) = camera.ray(u, v);
        let plane = &field.plane;
        let z = plane.depth(x, y);
        let (right, down) = board.place(&(Vector3::new(x, y, 1.0) * z));
        let slope = |q: f64, f: f64| field.scale_px_m * q / f;
        Tile {
            place: Place {
                u,
                v,
                side: SIDE as f64,
                x,
                y,
                disparity: field.scale_px_m / z,
                z,
                slope: [slope(plane.q.x, camera.fx), slope(plane.q.y, camera.fy)],
                radius: f64::hypot(u - camera.cx, v - camera.cy) / corner,
                right,
                down,
                rho: plane.distance(),
                edge: self.edge / self.pixels,
                theta: plane.theta(),
                azimuth: plane.azimuth(),
                session_s: field.time_s - session_start,
                temperature_c: field.temperature_c.unwrap_or(0.0),
                light: self.light / self.n,
                ambient: field.ambient_lux.unwrap_or(0.0),
                variance: self.variance / self.n,
            },
            mean: self.mean / self.n,
            rough: self.rough / self.rough_n,
            rough_square: self.rough_square / self.rough_n,
            temporal: self.temporal / self.n,
            variance: self.variance / self.n,
            pixels: self.n,
            missing: self.missing / self.asked,
            asked: self.asked,
        }
    }
}

/// The target's own coordinates, begun at the centroid of its pixels.
fn board_frame(field: &Field, rays: &Rays) -> TargetFrame {
    const ENOUGH: usize = 5000;
    let stride = (field.pixels.len() / ENOUGH).max(1);
    let few: Vec<u32> = field.pixels.iter().copied().step_by(stride).collect();
    let sum = few.iter().fold(Vector3::zeros(), |sum, &i| {
        let (x, y) = rays.at(i as usize);
        sum + Vector3::new(x, y, 1.0) * field.plane.depth(x, y)
    });
    TargetFrame::on(&field.plane, sum / few.len() as f64)
}

/// Chessboard-and-diagonal distance (3-4 chamfer, Borgefors 1986) of each target pixel to the
/// nearest pixel that is not the target's, px. The picture's border is no edge.
fn edge_distances(field: &Field, camera: &Camera) -> Vec<f32> {
    let (w, h) = (camera.width, camera.height);
    let mut d = vec![0f32; w * h];
    for &i in &field.pixels {
        d[i as usize] = f32::INFINITY;
    }
    let (one, diagonal) = (1.0f32, 4.0 / 3.0f32);
    let relax = |d: &mut Vec<f32>, i: usize, u: usize, v: usize, back: bool| {
        let mut best = d[i];
        let mut look = |ok: bool, j: usize, step: f32| {
            if ok {
                best = best.min(d[j] + step);
            }
        };
        if back {
            look(u + 1 < w, i + 1, one);
            look(v + 1 < h, i + w, one);
            look(v + 1 < h && u + 1 < w, i + w + 1, diagonal);
            look(v + 1 < h && u > 0, (i + w).wrapping_sub(1), diagonal);
        } else {
            look(u > 0, i.wrapping_sub(1), one);
            look(v > 0, i.wrapping_sub(w), one);
            look(v > 0 && u > 0, i.wrapping_sub(w + 1), diagonal);
            look(v > 0 && u + 1 < w, (i + 1).wrapping_sub(w), diagonal);
        }
        d[i] = best;
    };
    for i in 0..w * h {
        relax(&mut d, i, i % w, i / w, false);
    }
    for i in (0..w * h).rev() {
        relax(&mut d, i, i % w, i / w, true);
    }
    let far = (w + h) as f32;
    d.iter_mut().for_each(|e| *e = e.min(far));
    d
}
