//! A simulated bench where effects are switched on one at a time.

use kinoise::effects::{Active, Instant, ROOM_LUX};
use kinoise::model::Domain;
use kinoise::scene::{Bench, Board, Seen, Target};
use kinoise::simulate::{FormulaSensor, Shot, kinect_v1};
use kinoise::{DepthCode, Form, Plane, Seed, Sensor, SigmaModel};

/// Fine enough that the stored word hides nothing: 0.07 mm, up to 4.3 m.
pub const UNITS_PER_METRE: f64 = 15_000.0;
/// Largest rounding error of a stored depth, m.
pub const ROUNDING_M: f64 = 0.5 / UNITS_PER_METRE;
/// The least noise that the formula accepts: far below the stored word.
const SILENT_M: f64 = 1e-9;

#[derive(Clone)]
pub struct Laboratory {
    pub sensor: Sensor,
    pub bench: Bench,
    pub sigma_m: f64,
    pub effects: Vec<Active>,
    pub lux: f64,
    pub seed: u64,
}

impl Laboratory {
    /// A wall without noise, 320 x 240 px.
    pub fn wall(z: f64, theta_deg: f64, azimuth_deg: f64) -> Self {
        let mut sensor = kinect_v1(2);
        sensor.code = DepthCode::Metric { units_per_metre: UNITS_PER_METRE, invalid: 0 };
        let plane = Plane::tilted(z, theta_deg.to_radians(), azimuth_deg.to_radians());
        let bench = Bench::bare(plane, Target::Wall);
        Laboratory { sensor, bench, sigma_m: SILENT_M, effects: Vec::new(), lux: ROOM_LUX, seed: 5 }
    }

    /// A frontal board of 0.5 x 0.4 m at 1 m in front of a wall at `wall_m`.
    pub fn board(wall_m: Option<f64>) -> Self {
        let mut lab = Laboratory::wall(1.0, 0.0, 0.0);
        lab.bench.target = Target::Board(Board { width_m: 0.5, height_m: 0.4 });
        lab.bench.wall_m = wall_m;
        lab
    }

    /// Gaussian noise of the same size everywhere, m.
    pub fn noise(self, sigma_m: f64) -> Self {
        Laboratory { sigma_m, ..self }
    }

    pub fn with(mut self, effect: &str) -> Self {
        self.effects.push(Active::parse(effect).expect("an effect"));
        self
    }

    pub fn seen(&self) -> Seen {
        Seen::of(&self.bench, &self.sensor.camera, &self.sensor.camera.rays())
    }

    pub fn shots(&self, instants: &[Instant]) -> Vec<Shot> {
        let rays = self.sensor.camera.rays();
        let domain = Domain { z_m: [0.1, 20.0], theta_rad: [0.0, 1.45] };
        // Eq. 1 with only its constant; the pole lies beyond the domain.
        let flat = [self.sigma_m, 0.0, 0.0, 0.0, 1.0, 1.5];
        let camera = FormulaSensor {
            sensor: &self.sensor,
            rays: &rays,
            sigma: &SigmaModel::published(Form::Paper, &flat, domain),
            effects: &self.effects,
            seed: Seed(self.seed),
        };
        let seen = self.seen();
        let mut shooting = camera.begin(&seen);
        shooting.ambient_lux = self.lux;
        instants.iter().map(|&instant| shooting.shoot(instant)).collect()
    }

    /// Depths, m, at these instants; NaN where there is none.
    pub fn at(&self, instants: &[Instant]) -> Vec<Vec<f64>> {
        let metres = |word: &u16| self.sensor.code.metres(*word).unwrap_or(f64::NAN);
        let shots = self.shots(instants);
        shots.iter().map(|shot| shot.depth.raw.iter().map(metres).collect()).collect()
    }

    /// The first frames of view number `view`, at 30 Hz.
    pub fn view(&self, view: usize, frames: usize) -> Vec<Vec<f64>> {
        let instants: Vec<Instant> = (0..frames).map(|k| instant(view, k)).collect();
        self.at(&instants)
    }

    pub fn frame(&self) -> Vec<f64> {
        self.view(0, 1).remove(0)
    }

    /// True depths, m, by the plane's own formula.
    pub fn truth(&self) -> Vec<f64> {
        let rays = self.sensor.camera.rays();
        let depth = |i: usize| {
            let (x, y) = rays.at(i);
            self.bench.plane.depth(x, y)
        };
        (0..rays.x.len()).map(depth).collect()
    }

    /// Measured minus true disparity, px, of one frame of a wall.
    pub fn disparity_errors(&self, frame: &[f64]) -> Vec<f64> {
        let scale = self.sensor.disparity_px_m().expect("a baseline");
        frame.iter().zip(self.truth()).map(|(z, truth)| scale / z - scale / truth).collect()
    }

    /// Measured minus true depth, m, of one frame of a wall.
    pub fn depth_errors(&self, frame: &[f64]) -> Vec<f64> {
        frame.iter().zip(self.truth()).map(|(z, truth)| z - truth).collect()
    }

    pub fn width(&self) -> usize {
        self.sensor.camera.width
    }

    /// Offset of pixel `i` from the principal point in columns and rows, px.
    pub fn off_centre(&self, i: usize) -> (f64, f64) {
        let c = &self.sensor.camera;
        ((i % c.width) as f64 - c.cx, (i / c.width) as f64 - c.cy)
    }
}

/// Frame `k` of a view at 30 Hz; views start 30 s apart.
pub fn instant(view: usize, k: usize) -> Instant {
    let view_s = k as f64 / 30.0;
    Instant { view, frame: k, session_s: view as f64 * 30.0 + view_s, view_s }
}

pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

pub fn variance(values: &[f64]) -> f64 {
    let middle = mean(values);
    values.iter().map(|v| (v - middle).powi(2)).sum::<f64>() / (values.len() - 1) as f64
}

pub fn sd(values: &[f64]) -> f64 {
    variance(values).sqrt()
}

pub fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let (ma, mb) = (mean(a), mean(b));
    let product: f64 = a.iter().zip(b).map(|(a, b)| (a - ma) * (b - mb)).sum();
    product / ((a.len() - 1) as f64 * sd(a) * sd(b))
}

/// Slope and intercept of y over x by least squares.
pub fn line(x: &[f64], y: &[f64]) -> (f64, f64) {
    let slope = correlation(x, y) * sd(y) / sd(x);
    (slope, mean(y) - slope * mean(x))
}

pub fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// Column means and row means of an image.
pub fn column_and_row_means(picture: &[f64], width: usize) -> (Vec<f64>, Vec<f64>) {
    let rows: Vec<&[f64]> = picture.chunks_exact(width).collect();
    let column = |u: usize| mean(&rows.iter().map(|row| row[u]).collect::<Vec<_>>());
    ((0..width).map(column).collect(), rows.iter().map(|row| mean(row)).collect())
}

#[track_caller]
pub fn close(got: f64, expected: f64, tolerance: f64, what: &str) {
    assert!((got - expected).abs() <= tolerance, "{what}: {got}, not {expected} +- {tolerance}");
}
