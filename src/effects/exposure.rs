//! One frame on its way from the surface to the stored raw value.

use std::collections::HashMap;

use nalgebra::Vector3;

use crate::camera::Rays;
use crate::scene::Seen;
use crate::terms::corner_radius;
use crate::view::Sensor;

/// When a frame is taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instant {
    /// Views and frames are counted from zero, in the order they are taken.
    pub view: usize,
    pub frame: usize,
    /// Since the session began, s.
    pub session_s: f64,
    /// Since the view's first frame, s.
    pub view_s: f64,
}

/// A frame in progress. Arrays are per pixel, row-major; NaN means no value.
pub struct Exposure<'a> {
    pub sensor: &'a Sensor,
    pub rays: &'a Rays,
    /// What the pixels look at, undisturbed.
    pub seen: &'a Seen,
    pub instant: Instant,
    /// Ambient light on the target, lx.
    pub ambient_lux: f64,
    /// Degrees Celsius, where measured.
    pub temperature_c: Option<f64>,
    /// Depth along the optical axis, m: true until the noise is added, then measured.
    pub depth: Vec<f32>,
    /// Returned infrared light, relative to a white surface at 1 m facing the sensor.
    pub light: Vec<f32>,
    /// Standard deviation of the depth, m.
    pub sigma: Vec<f32>,
    /// Noise in units of sigma.
    pub noise: Vec<f32>,
    /// fx * baseline / z, px; between [`super::Stage::Disparity`] and the read-out.
    pub disparity: Vec<f32>,
    /// State that an effect keeps from frame to frame of a view, by its id; frames come in order.
    pub memory: HashMap<&'static str, Vec<f32>>,
    /// Values that an effect derived from `seen` alone, by its id; dropped when something else is seen.
    pub still: HashMap<&'static str, Vec<f32>>,
}

impl Exposure<'_> {
    pub fn pixels(&self) -> usize {
        self.depth.len()
    }

    /// Column and row of a pixel.
    pub fn at(&self, i: usize) -> (usize, usize) {
        (i % self.seen.width, i / self.seen.width)
    }

    /// What pixel `i` looks at, m.
    pub fn point(&self, i: usize) -> Vector3<f64> {
        let (x, y) = self.rays.at(i);
        Vector3::new(x, y, 1.0) * f64::from(self.depth[i])
    }

    /// Distance of pixels from the principal point over that of the farthest corner, 0 to 1.
    pub fn radius(&self) -> impl Fn(usize) -> f64 + use<> {
        let camera = &self.sensor.camera;
        let (width, cx, cy) = (self.seen.width, camera.cx, camera.cy);
        let corner = corner_radius(camera);
        move |i| f64::hypot((i % width) as f64 - cx, (i / width) as f64 - cy) / corner
    }

    /// Depth, m, at which `ray` meets the surface at pixel `i`, taken as flat there and lifted by
    /// `lift_m` along its normal, towards the sensor.
    pub fn meet(&self, i: usize, ray: (f64, f64), lift_m: f64) -> f64 {
        let [a, b, c] = self.seen.normal[i].map(f64::from);
        let along = |(x, y): (f64, f64)| a * x + b * y + c;
        // n . X is negative on the surface: the normal points back at the camera.
        let level = f64::from(self.depth[i]) * along(self.rays.at(i));
        (level + lift_m) / along(ray)
    }

    /// Adds `shift(i)`, px, to the disparity of every pixel `i`.
    pub fn shift_disparity(&mut self, shift: impl Fn(usize) -> f64) {
        for (i, d) in self.disparity.iter_mut().enumerate() {
            *d += shift(i) as f32;
        }
    }

    /// Calls `act` with what `make` returned when the sensor first saw what it sees now.
    pub fn with_kept(
        &mut self,
        id: &'static str,
        make: impl FnOnce(&Self) -> Vec<f32>,
        act: impl FnOnce(&mut Self, &[f32]),
    ) {
        let kept = self.still.remove(id).unwrap_or_else(|| make(self));
        act(self, &kept);
        self.still.insert(id, kept);
    }
}
