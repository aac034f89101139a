//! Simulation by formula: sigma(z, theta) and the effects, in light-path order.

use std::collections::HashMap;

use crate::camera::Rays;
use crate::effects::{Active, Exposure, Instant, ROOM_LUX, Stage, fill_normal};
use crate::frame::Frame;
use crate::model::SigmaModel;
use crate::rng::Seed;
use crate::scene::{Seen, World};
use crate::view::Sensor;

/// A sensor whose errors follow formulas.
pub struct FormulaSensor<'a> {
    pub sensor: &'a Sensor,
    pub rays: &'a Rays,
    pub sigma: &'a SigmaModel,
    pub effects: &'a [Active],
    pub seed: Seed,
}

/// The frames of one view, to be taken in order.
pub struct Shooting<'a> {
    camera: &'a FormulaSensor<'a>,
    /// In light-path order.
    effects: Vec<&'a Active>,
    seen: &'a Seen,
    /// Ambient light, lx: that of an office, or what the view states.
    pub ambient_lux: f64,
    /// Temperature, degrees Celsius, where known.
    pub temperature_c: Option<f64>,
    /// Standard deviation at the undisturbed depth, without rounding, m.
    sigma: Vec<f32>,
    light: Vec<f32>,
    pub(super) memory: HashMap<&'static str, Vec<f32>>,
    still: HashMap<&'static str, Vec<f32>>,
}

impl FormulaSensor<'_> {
    pub fn begin<'a>(&'a self, seen: &'a Seen) -> Shooting<'a> {
        self.begin_at(seen, sigma_of(seen, self.sigma), HashMap::new())
    }

    /// Like [`FormulaSensor::begin`], with sigma (m) and the effects' memory of earlier frames given: for a
    /// moving camera, which sees something else in every frame.
    pub(super) fn begin_at<'a>(
        &'a self,
        seen: &'a Seen,
        sigma: Vec<f32>,
        memory: HashMap<&'static str, Vec<f32>>,
    ) -> Shooting<'a> {
        Shooting {
            camera: self,
            effects: Active::in_light_path(self.effects),
            seen,
            ambient_lux: ROOM_LUX,
            temperature_c: None,
            sigma: without_rounding(sigma, seen, self.sensor),
            light: light_of(seen, self.rays),
            memory,
            still: HashMap::new(),
        }
    }
}

pub struct Shot {
    pub depth: Frame,
    /// Relative to a white surface at 1 m facing the sensor.
    pub light: Vec<f32>,
}

impl Shooting<'_> {
    pub fn shoot(&mut self, instant: Instant) -> Shot {
        let FormulaSensor { sensor, rays, seed, .. } = *self.camera;
        let mut exposure = Exposure {
            sensor,
            rays,
            seen: self.seen,
            instant,
            ambient_lux: self.ambient_lux,
            temperature_c: self.temperature_c,
            depth: self.seen.depth.clone(),
            light: self.light.clone(),
            sigma: self.sigma.clone(),
            noise: vec![0.0; self.seen.depth.len()],
            disparity: Vec::new(),
            memory: std::mem::take(&mut self.memory),
            still: std::mem::take(&mut self.still),
        };
        let mut rng = seed.stream(&format!("simulate/{}/{}", instant.view, instant.frame));
        fill_normal(&mut exposure.noise, &mut rng);
        for stage in Stage::ALL {
            match stage {
                Stage::Disparity => match_up(&mut exposure),
                Stage::Driver => read_out(&mut exposure),
                _ => {}
            }
            let due = self.effects.iter().filter(|a| a.effect.card().stage == stage);
            due.for_each(|active| active.act(&mut exposure, seed));
        }
        self.memory = std::mem::take(&mut exposure.memory);
        self.still = std::mem::take(&mut exposure.still);
        let words = exposure.depth.iter().map(|&z| sensor.code.raw(f64::from(z))).collect();
        let (width, height) = (sensor.camera.width, sensor.camera.height);
        Shot { depth: Frame { width, height, raw: words }, light: exposure.light }
    }
}

/// Takes a single frame of a world, with Gaussian noise of sigma(z, theta) and no effect.
pub fn shoot(
    sensor: &Sensor,
    rays: &Rays,
    world: &dyn World,
    sigma: &SigmaModel,
    seed: Seed,
) -> Frame {
    let seen = Seen::of(world, &sensor.camera, rays);
    let camera = FormulaSensor { sensor, rays, sigma, effects: &[], seed };
    let first = Instant { view: 0, frame: 0, session_s: 0.0, view_s: 0.0 };
    camera.begin(&seen).shoot(first).depth
}

/// Adds the noise to the depth and converts it to the disparity that a matcher would find.
fn match_up(exposure: &mut Exposure) {
    let scale = exposure.sensor.scale_px_m() as f32;
    exposure.disparity = exposure
        .depth
        .iter()
        .zip(exposure.sigma.iter().zip(&exposure.noise))
        .map(|(z, (sigma, noise))| {
            let measured = z + sigma * noise;
            if measured > 0.0 { scale / measured } else { f32::NAN }
        })
        .collect();
}

fn read_out(exposure: &mut Exposure) {
    let scale = exposure.sensor.scale_px_m() as f32;
    for (z, d) in exposure.depth.iter_mut().zip(&exposure.disparity) {
        *z = if *d > 0.0 { scale / d } else { f32::NAN };
    }
}

/// Light of every pixel: falls with the square of the distance and the cosine of the incidence angle.
fn light_of(seen: &Seen, rays: &Rays) -> Vec<f32> {
    (0..seen.depth.len())
        .map(|i| {
            let (x, y) = rays.at(i);
            let z = f64::from(seen.depth[i]);
            let square = z * z * (1.0 + x * x + y * y);
            let light = f64::from(seen.albedo[i]) * seen.cos_incidence(i, rays) / square;
            if light.is_finite() { light as f32 } else { 0.0 }
        })
        .collect()
}

/// Sigma at the true depth and tilt of every pixel, m. On a flat surface it depends on depth alone, and a
/// table saves a `powf` per pixel.
fn sigma_of(seen: &Seen, model: &SigmaModel) -> Vec<f32> {
    let tables: Vec<Option<SigmaByDepth>> = seen
        .surfaces
        .iter()
        .map(|s| s.theta_rad.map(|theta| SigmaByDepth::of(model, theta)))
        .collect();
    (0..seen.depth.len())
        .map(|i| {
            let z = f64::from(seen.depth[i]);
            if z.is_nan() {
                return 0.0;
            }
            match tables.get(usize::from(seen.surface[i])).and_then(Option::as_ref) {
                Some(table) => table.at(z) as f32,
                None => model.axial_sigma(z, seen.theta(i)) as f32,
            }
        })
        .collect()
}

/// Removes the rounding variance from sigma: the model's sigma was measured on stored values, and rounding
/// is applied again. The rounding error is uniform over a step: variance step^2 / 12.
fn without_rounding(mut sigma: Vec<f32>, seen: &Seen, sensor: &Sensor) -> Vec<f32> {
    for (sigma, &z) in sigma.iter_mut().zip(&seen.depth) {
        let z = f64::from(z);
        let step = sensor.code.step_inverse(z) * z * z;
        *sigma = (f64::from(*sigma).powi(2) - step * step / 12.0).max(0.0).sqrt() as f32;
    }
    sigma
}

/// Sigma over depth at one tilt, linear between nodes.
struct SigmaByDepth {
    low: f64,
    step: f64,
    nodes: Vec<f64>,
}

/// Over 4 m a step of 2 mm: with the curvature 2b of Eq. 1 the interpolation error is b step^2 / 4 = 2 nm.
const NODES: usize = 2048;

impl SigmaByDepth {
    fn of(model: &SigmaModel, theta: f64) -> Self {
        let [low, high] = model.domain.z_m;
        let step = (high - low).max(1e-9) / (NODES - 1) as f64;
        let nodes = (0..NODES).map(|k| model.axial_sigma(low + k as f64 * step, theta)).collect();
        SigmaByDepth { low, step, nodes }
    }

    fn at(&self, z: f64) -> f64 {
        let place = ((z - self.low) / self.step).clamp(0.0, (NODES - 1) as f64);
        let k = (place as usize).min(NODES - 2);
        let t = place - k as f64;
        self.nodes[k] * (1.0 - t) + self.nodes[k + 1] * t
    }
}
