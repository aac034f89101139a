//! A real view as the causes of the first world see it: a plane, and what every pixel meets there.

use nalgebra::{Vector2, Vector3};

use crate::raytraced::{Board, Facts, Site, Stage, Unit};
use kinoise::camera::Rays;
use kinoise::effects::KINECT_BASELINE_M;
use kinoise::model::NoiseModel;
use kinoise::plane::Plane;
use kinoise::terms::{Pixels, Statistic, Term, corner_radius};
use kinoise::view::Sensor;

/// The sensor with what its full model says.
pub(super) struct Camera<'a> {
    pub sensor: &'a Sensor,
    pub model: &'a NoiseModel,
    pub rays: Rays,
    pub baseline_m: f64,
    corner_px: f64,
    /// Terms of the model that need no board to stand on.
    bias: Vec<&'a Term>,
    variance: Vec<&'a Term>,
}

impl<'a> Camera<'a> {
    pub fn new(sensor: &'a Sensor, model: &'a NoiseModel) -> Self {
        let terms = |statistic| {
            let all = model.effects.iter().flat_map(|e| &e.shape);
            all.filter(|t| t.statistic == statistic && !t.needs().board).collect()
        };
        Camera {
            sensor,
            model,
            rays: sensor.camera.rays(),
            baseline_m: sensor.baseline_m.unwrap_or(KINECT_BASELINE_M),
            corner_px: corner_radius(&sensor.camera),
            bias: terms(Statistic::Bias),
            variance: terms(Statistic::Variance),
        }
    }

    /// fx * baseline, px m.
    pub fn disparity_px_m(&self) -> f64 {
        self.sensor.camera.fx * self.baseline_m
    }

    pub fn unit(&self) -> Unit {
        let mut sigma = [0.0; 6];
        sigma.iter_mut().zip(&self.model.sigma.parameters).for_each(|(s, p)| *s = *p);
        Unit { sensor: self.sensor.clone(), baseline_m: self.baseline_m, sigma }
    }
}

/// A view's plane and time.
pub(super) struct Scene<'a> {
    pub camera: &'a Camera<'a>,
    pub plane: Plane,
    stage: Stage,
    pub session_s: f64,
}

impl<'a> Scene<'a> {
    pub fn new(camera: &'a Camera<'a>, plane: Plane, session_s: f64) -> Self {
        let (z, theta, azimuth) = (plane.depth(0.0, 0.0), plane.theta(), plane.azimuth());
        let board = Board::posed(z, [theta, azimuth], [0.0, 0.0], 0.0);
        let stage = Stage { board, wall: None, theta, azimuth };
        Scene { camera, plane, stage, session_s }
    }

    pub fn facts(&self) -> Facts<'_> {
        Facts {
            view: 0,
            stage: &self.stage,
            session_s: self.session_s,
            lux: 0.0,
            temperature_c: 22.0,
        }
    }

    /// Pixel `i`: on the plane, or on something else at depth `beside`, m.
    pub fn site(&self, i: usize, beside: Option<f64>) -> Site {
        let c = &self.camera.sensor.camera;
        let (u, v) = ((i % c.width) as f64, (i / c.width) as f64);
        let (x, y) = self.camera.rays.at(i);
        let z = beside.unwrap_or_else(|| self.plane.depth(x, y));
        let ray = Vector3::new(x, y, 1.0);
        let normal = if beside.is_none() { self.stage.board.normal } else { Vector3::z() };
        let point = ray * z;
        Site {
            u,
            v,
            x,
            y,
            z,
            point,
            radius: Vector2::new(u - c.cx, v - c.cy).norm() / self.camera.corner_px,
            disparity: self.camera.disparity_px_m() / z,
            on_board: beside.is_none(),
            place: self.stage.board.place(&point),
            theta: if beside.is_none() { self.stage.theta } else { 0.0 },
            facing: normal.dot(&ray) / ray.norm(),
            edge_px: f64::INFINITY,
            other_disparity: None,
            albedo: 0.8,
        }
    }

    /// By how much inverse depth changes from pixel to pixel, as disparity, px a px.
    pub fn slope(&self) -> f64 {
        let c = &self.camera.sensor.camera;
        let q = self.plane.q;
        self.camera.disparity_px_m() * (q.x / c.fx).hypot(q.y / c.fy)
    }

    /// What the full model expects there: mean error and standard deviation of the disparity, px.
    pub fn expected(&self, i: usize, site: &Site, row: &mut Vec<f64>) -> [f64; 2] {
        let camera = self.camera;
        let fb = camera.disparity_px_m();
        let pixels = Pixels::new(&camera.sensor.camera, &camera.rays, fb);
        let mut place = pixels.place(i);
        place.lean_on(&self.plane, &pixels);
        place.at_disparity(site.disparity, fb);
        place.session_s = self.session_s;
        let axial = camera.model.sigma.axial_sigma(site.z, site.theta);
        let plain = axial * fb / (site.z * site.z);
        place.variance = plain * plain;
        let mut sum = |terms: &[&Term]| terms.iter().map(|t| t.value(&place, row)).sum::<f64>();
        let bias = sum(&camera.bias);
        [bias, plain * (0.5 * sum(&camera.variance)).exp()]
    }
}
