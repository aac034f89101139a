//! Disparity errors of a speckle sensor in front of a bench.

use kinoise::effects::Instant;
use kinoise::scene::{Bench, Target, World};
use kinoise::simulate::kinect_v1;
use kinoise::simulate::speckle::{Causes, SpeckleSensor};
use kinoise::{Plane, Seed, Sensor};
use nalgebra::Vector3;

/// fx * baseline of a Kinect v1, px m.
pub const FB: f64 = 580.0 * 0.075;
const WIDTH: usize = 240;
const HEIGHT: usize = 180;
/// Margin within which no matching window crosses the image's edge, px.
const BORDER: usize = 9;
/// Errors from here on are wrong matches, px; the rest is noise.
const GROSS_PX: f64 = 1.5;

/// The central part of a Kinect's image.
pub fn kinect() -> Sensor {
    let mut sensor = kinect_v1(1);
    sensor.camera.width = WIDTH;
    sensor.camera.height = HEIGHT;
    sensor.camera.cx = (WIDTH as f64 - 1.0) / 2.0;
    sensor.camera.cy = (HEIGHT as f64 - 1.0) / 2.0;
    sensor
}

/// A wall at this depth in m, with tilt and direction of tilt in degrees.
pub fn wall(z_m: f64, theta_deg: f64, azimuth_deg: f64) -> Bench {
    let plane = Plane::tilted(z_m, theta_deg.to_radians(), azimuth_deg.to_radians());
    Bench::bare(plane, Target::Wall)
}

/// A wall perpendicular to the optical axis.
pub fn frontal(z_m: f64) -> Bench {
    wall(z_m, 0.0, 0.0)
}

/// Frames of one view.
pub struct Watch {
    /// Disparity error, px, per frame and pixel: infinite where nothing was measured, NaN where
    /// there was nothing to measure.
    pub errors: Vec<Vec<f64>>,
    /// Depths of all frames, m; NaN where nothing was measured.
    pub depths: Vec<f64>,
    infrared: Vec<u16>,
}

pub fn watch(causes: &Causes, bench: &Bench, frames: usize, seed: u64) -> Watch {
    let sensor = SpeckleSensor::new(&kinect(), causes.clone()).unwrap();
    let instants: Vec<Instant> = (0..frames)
        .map(|frame| Instant { view: 0, frame, session_s: 0.0, view_s: frame as f64 / 30.0 })
        .collect();
    Watch::take(&sensor, bench, &instants, Seed(seed))
}

fn variance(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let (n, sum) = values.clone().fold((0.0, 0.0), |(n, s), v| (n + 1.0, s + v));
    values.map(|v| (v - sum / n).powi(2)).sum::<f64>() / n
}

impl Watch {
    pub fn take(sensor: &SpeckleSensor, bench: &Bench, instants: &[Instant], seed: Seed) -> Self {
        let Sensor { camera, code, .. } = sensor.described();
        let truth: Vec<f64> = (0..camera.pixels())
            .map(|i| {
                let (x, y) = camera.ray((i % WIDTH) as f64, (i / WIDTH) as f64);
                let hit = bench.cast(&Vector3::zeros(), &Vector3::new(x, y, 1.0));
                // Inside the range that the matcher searches.
                hit.map_or(f64::NAN, |h| if (0.45..7.0).contains(&h.t) { h.t } else { f64::NAN })
            })
            .collect();
        let mut filming = sensor.begin(bench, seed);
        let mut watch = Watch { errors: Vec::new(), depths: Vec::new(), infrared: Vec::new() };
        for &instant in instants {
            let shot = filming.shoot(instant);
            let depth = |w: &u16| code.metres(*w).unwrap_or(f64::NAN);
            let depths: Vec<f64> = shot.depth.raw.iter().map(depth).collect();
            let error = |(i, (z, t)): (usize, (&f64, &f64))| match inside(i) && t.is_finite() {
                true if z.is_nan() => f64::INFINITY,
                true => FB / z - FB / t,
                false => f64::NAN,
            };
            watch.errors.push(depths.iter().zip(&truth).enumerate().map(error).collect());
            watch.depths.extend(depths);
            watch.infrared = shot.infrared.raw;
        }
        watch
    }

    /// Errors over the frames of the pixels that are sound in all frames.
    fn series(&self) -> Vec<Vec<f64>> {
        (0..WIDTH * HEIGHT)
            .map(|i| self.errors.iter().map(|frame| frame[i]).collect::<Vec<f64>>())
            .filter(|series| series.iter().all(|e| e.abs() < GROSS_PX))
            .collect()
    }

    /// Standard deviation of a pixel over the frames, px (root mean square over pixels).
    pub fn temporal_px(&self) -> f64 {
        let n = self.errors.len() as f64;
        let series = self.series();
        let sum: f64 = series.iter().map(|s| variance(s.iter().copied()) * n / (n - 1.0)).sum();
        (sum / series.len() as f64).sqrt()
    }

    /// Standard deviation over the pixels of the part that is constant in time, px.
    pub fn frozen_px(&self) -> f64 {
        let n = self.errors.len() as f64;
        let series = self.series();
        let means = series.iter().map(|s| s.iter().sum::<f64>() / n);
        (variance(means) - self.temporal_px().powi(2) / n).max(0.0).sqrt()
    }

    /// Share of pixels without an answer.
    pub fn missing(&self) -> f64 {
        let asked = self.errors.iter().flatten().filter(|e| !e.is_nan());
        let (n, none) =
            asked.fold((0.0, 0.0), |(n, none), e| (n + 1.0, none + f64::from(e.is_infinite())));
        none / n
    }

    /// Missing pixels between two columns, per row.
    pub fn missing_per_row(&self, columns: (f64, f64), rows: (usize, usize)) -> f64 {
        let none = (0..WIDTH * HEIGHT).filter(|i| {
            let (u, v) = ((i % WIDTH) as f64, i / WIDTH);
            (rows.0..rows.1).contains(&v)
                && (columns.0..columns.1).contains(&u)
                && self.errors[0][*i].is_infinite()
        });
        none.count() as f64 / (rows.1 - rows.0) as f64
    }

    /// Correlation of the first frame's errors with themselves shifted by (du, dv) px.
    pub fn autocorrelation(&self, du: usize, dv: usize) -> f64 {
        let frame = &self.errors[0];
        let pairs = (0..WIDTH * (HEIGHT - dv) - du).map(|i| (frame[i], frame[i + dv * WIDTH + du]));
        correlation(pairs)
    }

    /// Correlation of one frame with one of another view.
    pub fn frame_likeness(&self, other: &Watch, frame: usize, others: usize) -> f64 {
        let pairs = self.errors[frame].iter().zip(&other.errors[others]);
        correlation(pairs.map(|(a, b)| (*a, *b)))
    }

    fn sound(&self) -> impl Iterator<Item = (f64, f64)> + Clone + '_ {
        let frame = self.errors[0].iter().enumerate();
        frame.filter(|(_, e)| e.abs() < GROSS_PX).map(|(i, e)| ((i % WIDTH) as f64, *e))
    }

    pub fn mean_px(&self) -> f64 {
        let (n, sum) = self.sound().fold((0.0, 0.0), |(n, s), (_, e)| (n + 1.0, s + e));
        sum / n
    }

    /// Slope of the error over the columns, px per px.
    pub fn slope_per_px(&self) -> f64 {
        let columns = variance(self.sound().map(|(u, _)| u));
        let middle = (WIDTH as f64 - 1.0) / 2.0;
        let (n, sum) =
            self.sound().fold((0.0, 0.0), |(n, s), (u, e)| (n + 1.0, s + (u - middle) * e));
        sum / n / columns
    }

    /// Root mean square of the error averaged over blocks of 20 x 20 px, px: the smooth part.
    pub fn smooth_px(&self) -> f64 {
        const SIDE: usize = 20;
        let mut blocks = vec![(0.0, 0.0); (WIDTH / SIDE) * (HEIGHT / SIDE)];
        for (i, e) in self.errors[0].iter().enumerate().filter(|(_, e)| e.abs() < 5.0) {
            let block = &mut blocks[i / WIDTH / SIDE * (WIDTH / SIDE) + i % WIDTH / SIDE];
            *block = (block.0 + 1.0, block.1 + e);
        }
        let squares: f64 = blocks.iter().map(|(n, s)| (s / n).powi(2)).sum();
        (squares / blocks.len() as f64).sqrt()
    }

    /// Number of columns in this range without light: less than a tenth of the first six's mean.
    pub fn dark_columns(&self, columns: (f64, f64)) -> f64 {
        let black = f64::from(self.infrared.iter().copied().min().unwrap_or(0));
        let light: Vec<f64> = (columns.0.ceil() as usize..columns.1 as usize)
            .map(|u| {
                let column = self.infrared[u..].iter().step_by(WIDTH);
                column.map(|dn| f64::from(*dn) - black).sum::<f64>() / HEIGHT as f64
            })
            .collect();
        let wall = light[..6].iter().sum::<f64>() / 6.0;
        light.iter().filter(|l| **l < 0.1 * wall).count() as f64
    }

    /// Mean infrared light in the middle of the image above the darkest pixel there, DN.
    pub fn middle_light_dn(&self) -> f64 {
        let middle: Vec<f64> = (0..WIDTH * HEIGHT)
            .filter(|i| (i % WIDTH).abs_diff(120) < 40 && (i / WIDTH).abs_diff(90) < 60)
            .map(|i| f64::from(self.infrared[i]))
            .collect();
        let dark = middle.iter().copied().fold(f64::MAX, f64::min);
        middle.iter().map(|dn| dn - dark).sum::<f64>() / middle.len() as f64
    }
}

fn inside(i: usize) -> bool {
    let (u, v) = (i % WIDTH, i / WIDTH);
    (BORDER..WIDTH - BORDER).contains(&u) && (BORDER..HEIGHT - BORDER).contains(&v)
}

fn correlation(pairs: impl Iterator<Item = (f64, f64)>) -> f64 {
    let sound: Vec<(f64, f64)> =
        pairs.filter(|(a, b)| a.abs() < GROSS_PX && b.abs() < GROSS_PX).collect();
    let n = sound.len() as f64;
    let (ma, mb) = sound.iter().fold((0.0, 0.0), |(x, y), (a, b)| (x + a / n, y + b / n));
    let covariance = sound.iter().map(|(a, b)| (a - ma) * (b - mb)).sum::<f64>() / n;
    let [va, vb] = [variance(sound.iter().map(|p| p.0)), variance(sound.iter().map(|p| p.1))];
    covariance / (va * vb).sqrt()
}
