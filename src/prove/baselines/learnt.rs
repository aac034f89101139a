//! A bias and a variance over places, put to use on a view.

use crate::camera::Camera;
use crate::error::Result;
use crate::prove::gain::{MAX_LOG_VARIANCE, Stand, plane_of};
use crate::prove::question::{ExamView, Predictor};
use crate::terms::{PixelContext, Pixels};

/// A number for each place.
pub type AtPlaces = Box<dyn Fn(&[PixelContext]) -> Vec<f64> + Send + Sync>;

/// Of each place by itself.
pub fn each(of: impl Fn(&PixelContext) -> f64 + Send + Sync + 'static) -> AtPlaces {
    Box::new(move |places| places.iter().map(&of).collect())
}

/// Places that are held at once.
const AT_ONCE: usize = 4096;

/// Functions of the place; a picture is predicted at every so many pixels, and linearly between.
pub struct Learnt {
    pub scale_px_m: f64,
    /// Error of the disparity, px.
    pub bias: Option<AtPlaces>,
    /// Logarithm of the variance over the model's.
    pub log_variance: Option<AtPlaces>,
    /// Pixels between two evaluations; 1 for all.
    pub stride: usize,
}

impl Learnt {
    /// Of every pixel with a depth; zero elsewhere.
    fn everywhere(&self, view: &ExamView, depth: &[f32], of: &AtPlaces) -> Vec<f64> {
        let camera = &view.sensor.camera;
        let rays = camera.rays();
        let on_target: Vec<bool> = view.depth.iter().map(|z| z.is_finite()).collect();
        let Some(plane) = plane_of(depth, camera, &rays) else { return vec![0.0; depth.len()] };
        let pixels = Pixels::new(camera, &rays, self.scale_px_m);
        let stand = Stand::new(pixels, plane, &on_target, view.conditions);
        let place = |i: usize| {
            let mut place = stand.place(i);
            place.variance =
                (f64::from(view.sigma_plain[i]) * self.scale_px_m / place.z.powi(2)).powi(2);
            place
        };
        let lattice = Lattice::new(camera, self.stride.max(1));
        let asked: Vec<usize> = match self.stride {
            0 | 1 => (0..depth.len()).filter(|&i| on_target[i]).collect(),
            _ => lattice.nodes(),
        };
        let mut values = Vec::with_capacity(asked.len());
        for some in asked.chunks(AT_ONCE) {
            values.extend(of(&some.iter().map(|&i| place(i)).collect::<Vec<_>>()));
        }
        values.iter_mut().filter(|v| !v.is_finite()).for_each(|v| *v = 0.0);
        if self.stride > 1 {
            return lattice.spread(&values);
        }
        let mut picture = vec![0.0; depth.len()];
        asked.iter().zip(values).for_each(|(&i, value)| picture[i] = value);
        picture
    }
}

impl Predictor for Learnt {
    fn correct(&self, view: &ExamView, depth: &mut [f32]) -> Result<()> {
        let Some(bias) = &self.bias else { return Ok(()) };
        let bias = self.everywhere(view, depth, bias);
        for (z, b) in depth.iter_mut().zip(bias) {
            let d = self.scale_px_m / f64::from(*z) - b;
            if z.is_finite() {
                *z = if d > 0.0 { (self.scale_px_m / d) as f32 } else { f32::INFINITY };
            }
        }
        Ok(())
    }

    fn sigma(&self, view: &ExamView, depth: &[f32]) -> Vec<f32> {
        let Some(log) = &self.log_variance else { return view.sigma_plain.clone() };
        let log = self.everywhere(view, depth, log);
        let limit = |l: f64| l.clamp(-MAX_LOG_VARIANCE, MAX_LOG_VARIANCE);
        let plain = view.sigma_plain.iter();
        plain.zip(log).map(|(s, l)| (f64::from(*s) * (0.5 * limit(l)).exp()) as f32).collect()
    }
}

/// Every so many pixels, the last row and column included.
struct Lattice<'a> {
    camera: &'a Camera,
    stride: usize,
    across: usize,
    down: usize,
}

impl<'a> Lattice<'a> {
    fn new(camera: &'a Camera, stride: usize) -> Self {
        let nodes = |n: usize| (n - 1).div_ceil(stride) + 1;
        let (across, down) = (nodes(camera.width), nodes(camera.height));
        Lattice { camera, stride, across, down }
    }

    /// The pixel of a node on an axis.
    fn pixel(&self, k: usize, size: usize) -> usize {
        (k * self.stride).min(size - 1)
    }

    fn nodes(&self) -> Vec<usize> {
        let Camera { width, height, .. } = *self.camera;
        let node = |k: usize| {
            let (i, j) = (k % self.across, k / self.across);
            self.pixel(j, height) * width + self.pixel(i, width)
        };
        (0..self.across * self.down).map(node).collect()
    }

    fn spread(&self, nodes: &[f64]) -> Vec<f64> {
        let Camera { width, height, .. } = *self.camera;
        let way = |at: usize, size: usize, count: usize| {
            let k = (at / self.stride).min(count.saturating_sub(2));
            let (from, to) = (self.pixel(k, size), self.pixel(k + 1, size));
            (k, (at - from) as f64 / (to - from).max(1) as f64)
        };
        let at =
            |i: usize, j: usize| nodes[j.min(self.down - 1) * self.across + i.min(self.across - 1)];
        let pixel = |p: usize| {
            let (i, s) = way(p % width, width, self.across);
            let (j, t) = way(p / width, height, self.down);
            (1.0 - t) * ((1.0 - s) * at(i, j) + s * at(i + 1, j))
                + t * ((1.0 - s) * at(i, j + 1) + s * at(i + 1, j + 1))
        };
        (0..width * height).map(pixel).collect()
    }
}
