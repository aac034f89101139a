//! Patches of a picture whose rays go nearly the same way, and which bodies they may meet.

use nalgebra::Vector3;

use super::body::Staged;
use crate::camera::{Camera, Rays};

/// Pixels a side of the large tiles and of the small ones in them.
const REGION: usize = 64;
const TILE: usize = 8;

/// A rectangle of pixels.
#[derive(Clone, Copy)]
pub struct Patch {
    /// Column and row of its first pixel, and how many there are.
    pub first: (usize, usize),
    pub size: (usize, usize),
}

impl Patch {
    /// Into squares of this side, smaller at the right and below.
    pub fn split(self, side: usize) -> impl Iterator<Item = Patch> {
        let ((left, top), (columns, rows)) = (self.first, self.size);
        let corners = (0..rows)
            .step_by(side)
            .flat_map(move |v| (0..columns).step_by(side).map(move |u| (u, v)));
        corners.map(move |(u, v)| Patch {
            first: (left + u, top + v),
            size: (side.min(columns - u), side.min(rows - v)),
        })
    }

    pub fn pixels(&self, width: usize) -> impl Iterator<Item = usize> + use<> {
        let ((u, v), (columns, rows)) = (self.first, self.size);
        (v..v + rows).flat_map(move |row| (u..u + columns).map(move |column| row * width + column))
    }
}

/// A large tile and its parts.
pub struct Region {
    pub tile: Tile,
    pub parts: Vec<Tile>,
}

impl Region {
    /// Of the whole picture.
    pub fn all(camera: &Camera, rays: &Rays) -> Vec<Region> {
        let whole = Patch { first: (0, 0), size: (camera.width, camera.height) };
        let region = |patch: Patch| Region {
            tile: Tile::new(camera, rays, patch),
            parts: patch.split(TILE).map(|part| Tile::new(camera, rays, part)).collect(),
        };
        whole.split(REGION).map(region).collect()
    }
}

/// A patch of the picture and the cone about its rays.
pub struct Tile {
    pub patch: Patch,
    axis: Vector3<f64>,
    cosine: f64,
    sine: f64,
}

impl Tile {
    pub fn new(camera: &Camera, rays: &Rays, patch: Patch) -> Self {
        let unit = |i: usize| direction(rays, i).normalize();
        let axis = patch.pixels(camera.width).map(unit).sum::<Vector3<f64>>().normalize();
        let widest = patch.pixels(camera.width).map(|i| unit(i).dot(&axis));
        let half = widest.fold(1.0, f64::min).acos();
        // The softened edges look half a pixel beyond the outermost rays.
        let (sine, cosine) = (half + 1.0 / camera.fx.min(camera.fy)).sin_cos();
        Tile { patch, axis, cosine, sine }
    }

    /// May a ray of the cone meet the body? Never wrong with a no.
    pub fn meets(&self, body: &Staged) -> bool {
        let along = self.axis.dot(&body.middle);
        let aside = (body.middle.norm_squared() - along * along).max(0.0).sqrt();
        // Distance of the middle from the cone's side (less than the true one behind the apex).
        aside * self.cosine - along * self.sine <= body.reach
            && body.is_near(&self.axis, self.sine / self.cosine)
    }
}

/// A pixel's ray in the camera's frame, its z one.
#[inline]
pub fn direction(rays: &Rays, i: usize) -> Vector3<f64> {
    let (x, y) = rays.at(i);
    Vector3::new(x, y, 1.0)
}
