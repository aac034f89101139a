//! One frame under way from the surface to the stored word.

use std::collections::HashMap;

use rand_distr::{Distribution, StandardNormal};

use crate::camera::Rays;
use crate::rng::{Seed, Stream};
use crate::scene::Seen;
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

/// A frame on its way. Arrays are per pixel, row-major; NaN means nothing there.
pub struct Exposure<'a> {
    pub sensor: &'a Sensor,
    pub rays: &'a Rays,
    /// What the pixels look at, undisturbed.
    pub seen: &'a Seen,
    pub instant: Instant,
    /// Depth along the optical axis, m: true until the noise is added, then measured.
    pub depth: Vec<f32>,
    /// Infrared light that comes back, relative to a white surface at 1 m facing the sensor.
    pub light: Vec<f32>,
    /// Standard deviation of the depth, m.
    pub sigma: Vec<f32>,
    /// Noise in units of sigma.
    pub noise: Vec<f32>,
    /// fx * baseline / z, px; between [`super::Stage::Disparity`] and the read-out.
    pub disparity: Vec<f32>,
    /// What an effect keeps from frame to frame of a view, by its id; frames come in order.
    pub memory: HashMap<&'static str, Vec<f32>>,
}

impl Exposure<'_> {
    pub fn pixels(&self) -> usize {
        self.depth.len()
    }

    /// fx * baseline, px m.
    pub fn disparity_px_m(&self) -> f64 {
        self.sensor.disparity_px_m().unwrap_or(self.sensor.camera.fx * KINECT_BASELINE_M)
    }

    /// Column and row of a pixel.
    pub fn at(&self, i: usize) -> (usize, usize) {
        (i % self.seen.width, i / self.seen.width)
    }

    /// Distance from the principal point over that of the farthest corner, 0 to 1.
    pub fn radius(&self, i: usize) -> f64 {
        let (u, v) = self.at(i);
        self.off_centre_px(u as f64, v as f64) / self.corner_radius_px()
    }

    fn off_centre_px(&self, u: f64, v: f64) -> f64 {
        let c = &self.sensor.camera;
        f64::hypot(u - c.cx, v - c.cy)
    }

    /// Of the farthest corner from the principal point, px.
    pub fn corner_radius_px(&self) -> f64 {
        let c = &self.sensor.camera;
        let (right, bottom) = (c.width as f64 - 1.0, c.height as f64 - 1.0);
        [(0.0, 0.0), (right, 0.0), (0.0, bottom), (right, bottom)]
            .into_iter()
            .map(|(u, v)| self.off_centre_px(u, v))
            .fold(0.0, f64::max)
    }
}

/// Of a Kinect v1; where a sensor without a given baseline is to have a disparity.
pub const KINECT_BASELINE_M: f64 = 0.075;

/// For how long a random number stays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scope {
    /// The unit's own: the same in every view.
    Sensor,
    /// Stands still while the scene does.
    View,
    /// Fresh in every frame.
    Frame,
}

/// Where an effect's random numbers come from: streams named after the effect alone.
#[derive(Debug, Clone, Copy)]
pub struct Draw<'a> {
    pub seed: Seed,
    pub id: &'a str,
    pub instant: Instant,
}

impl Draw<'_> {
    /// The stream for this scope and part of the effect.
    pub fn stream(&self, scope: Scope, part: &str) -> Stream {
        let Instant { view, frame, .. } = self.instant;
        let name = match scope {
            Scope::Sensor => format!("effect/{}/{part}", self.id),
            Scope::View => format!("effect/{}/{part}/{view}", self.id),
            Scope::Frame => format!("effect/{}/{part}/{view}/{frame}", self.id),
        };
        self.seed.stream(&name)
    }
}

/// Independent standard normal numbers.
pub fn fill_normal(out: &mut [f32], rng: &mut Stream) {
    out.fill_with(|| StandardNormal.sample(rng));
}
