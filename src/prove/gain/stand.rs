//! Where the pixels of a view of a plane lie on every axis.

use nalgebra::Vector3;

use crate::camera::{Camera, Rays};
use crate::correct::Conditions;
use crate::plane::{NormalEquations, Plane};
use crate::scene::TargetFrame;
use crate::terms::{PixelContext, Pixels, edge_distances};

/// A plane before a camera.
pub struct Stand<'a> {
    pixels: Pixels<'a>,
    plane: Plane,
    board: TargetFrame,
    edge: Vec<f32>,
    conditions: Conditions,
}

impl<'a> Stand<'a> {
    /// `on_target` tells for every pixel whether it is the plane's.
    pub fn new(
        pixels: Pixels<'a>,
        plane: Plane,
        on_target: &[bool],
        conditions: Conditions,
    ) -> Self {
        let points = on_target.iter().enumerate().filter(|(_, on)| **on).map(|(i, _)| {
            let (x, y) = pixels.rays.at(i);
            Vector3::new(x, y, 1.0) * plane.depth(x, y)
        });
        let (sum, n) = points.fold((Vector3::zeros(), 0.0), |(s, n), p| (s + p, n + 1.0));
        let board = TargetFrame::on(&plane, sum / f64::max(n, 1.0));
        let edge = edge_distances(on_target, pixels.camera.width);
        Stand { pixels, plane, board, edge, conditions }
    }

    /// Of pixel `i`.
    pub fn place(&self, i: usize) -> PixelContext {
        let mut place = self.pixels.place(i);
        place.side = 1.0;
        place.edge = f64::from(self.edge[i]);
        place.at_disparity(
            self.pixels.scale_px_m * self.plane.inverse_depth(place.x, place.y),
            self.pixels.scale_px_m,
        );
        place.lean_on(&self.plane, &self.pixels);
        let point = Vector3::new(place.x, place.y, 1.0) * place.z;
        (place.right, place.down) = self.board.place(&point);
        place.session_s = self.conditions.session_s;
        place.temperature_c = self.conditions.temperature_c.unwrap_or(0.0);
        place.ambient = self.conditions.ambient_lux.unwrap_or(0.0);
        place
    }
}

/// The plane through a picture's depth (m, NaN where there is none), with weights that are even in
/// disparity; `None` where there is none.
pub fn plane_of(depth: &[f32], camera: &Camera, rays: &Rays) -> Option<Plane> {
    let mut sums = NormalEquations::default();
    for (i, z) in depth.iter().take(camera.pixels()).enumerate() {
        let z = f64::from(*z);
        if z > 0.0 && z.is_finite() {
            let (x, y) = rays.at(i);
            sums.add(&Vector3::new(x, y, 1.0), 1.0 / z, 1.0);
        }
    }
    sums.solve().map(Plane::new).filter(Plane::is_finite)
}
