//! Places of single pixels, whatever they look at.

use super::modulation::DISPARITY_UNIT_PX;
use super::place::{PixelContext, corner_radius};
use crate::camera::{Camera, Rays};
use crate::plane::Plane;

/// A camera's pixels as places.
#[derive(Debug, Clone, Copy)]
pub struct Pixels<'a> {
    pub camera: &'a Camera,
    pub rays: &'a Rays,
    /// Disparity in px times depth in m.
    pub scale_px_m: f64,
    corner: f64,
}

impl<'a> Pixels<'a> {
    pub fn new(camera: &'a Camera, rays: &'a Rays, scale_px_m: f64) -> Self {
        Pixels { camera, rays, scale_px_m, corner: corner_radius(camera) }
    }

    /// Place of pixel `i` in the picture; nothing is known of what it looks at. A single pixel has no width
    /// over which a ripple would average out.
    pub fn place(&self, i: usize) -> PixelContext {
        let (u, v) = ((i % self.camera.width) as f64, (i / self.camera.width) as f64);
        let (x, y) = self.rays.at(i);
        let radius = f64::hypot(u - self.camera.cx, v - self.camera.cy) / self.corner;
        PixelContext {
            u,
            v,
            x,
            y,
            radius,
            light: 1.0,
            rho: 1.0,
            variance: 1.0,
            ..PixelContext::default()
        }
    }
}

/// Spacing of the sampled pixels.
const STRIDE: usize = 4;

impl Pixels<'_> {
    /// Pixels sampled over the whole picture, at the disparity where shapes that grow with it are in px.
    pub fn sampled(&self) -> impl Iterator<Item = PixelContext> + '_ {
        let (width, height) = (self.camera.width, self.camera.height);
        let row = move |v: usize| (STRIDE / 2..width).step_by(STRIDE).map(move |u| v * width + u);
        let all = (STRIDE / 2..height).step_by(STRIDE).flat_map(row);
        all.map(|i| PixelContext { disparity: DISPARITY_UNIT_PX, ..self.place(i) })
    }
}

impl PixelContext {
    /// Puts `self` on a surface of this disparity, px.
    pub fn at_disparity(&mut self, disparity: f64, scale_px_m: f64) {
        self.disparity = disparity;
        self.z = scale_px_m / disparity;
    }

    /// Puts `self` on a plane, with all that follows from its slope but not disparity and depth.
    pub fn lean_on(&mut self, plane: &Plane, pixels: &Pixels<'_>) {
        let slope = |q: f64, f: f64| pixels.scale_px_m * q / f;
        self.slope = [slope(plane.q.x, pixels.camera.fx), slope(plane.q.y, pixels.camera.fy)];
        self.rho = plane.distance();
        self.theta = plane.theta();
        self.azimuth = plane.azimuth();
    }
}
