//! A unit: its camera and its noise.

use rand::Rng;

use kinoise::camera::Camera;
use kinoise::error::Result;
use kinoise::frame::DepthCode;
use kinoise::model::{Domain, Effect, FitSummary, Form, NoiseModel, Provenance, SigmaModel};
use kinoise::rng::Stream;
use kinoise::view::{RecordingFile, Sensor};

/// Yamaguchi et al. 2016, Eq. 1, m and rad.
const PAPER: [f64; 6] = [0.00151, 0.00215, 0.483, 1.88e-6, 2.01, 1.39];
/// Relative spread between units.
const SPREAD: f64 = 0.2;
/// Range where sigma is given, m and rad: short of the pole.
const VALID_M: [f64; 2] = [0.3, 6.5];
const VALID_RAD: [f64; 2] = [0.0, 1.34];

/// One sensor.
#[derive(Debug, Clone)]
pub struct Unit {
    pub sensor: Sensor,
    pub baseline_m: f64,
    /// a to f of sigma(z, theta).
    pub sigma: [f64; 6],
}

impl Unit {
    /// Draws a unit at random, with images `width` px wide and three quarters as high.
    pub fn draw(width: usize, units_per_metre: f64, rng: &mut Stream) -> Self {
        let (shrink, height) = (width as f64 / 640.0, width * 3 / 4);
        let fx = shrink * rng.random_range(540.0..600.0);
        let off = |n: usize, rng: &mut Stream| {
            (n as f64 - 1.0) / 2.0 + shrink * rng.random_range(-6.0..6.0)
        };
        let camera = Camera {
            width,
            height,
            fx,
            fy: fx * rng.random_range(0.998..1.002),
            cx: off(width, rng),
            cy: off(height, rng),
            distortion: None,
        };
        let baseline_m = rng.random_range(0.07..0.08);
        let mut sigma = PAPER;
        sigma[..4].iter_mut().for_each(|c| *c *= rng.random_range(1.0 - SPREAD..1.0 + SPREAD));
        let code = DepthCode::Metric { units_per_metre, invalid: 0 };
        let name = "structured-light depth camera".into();
        let sensor = Sensor {
            name,
            serial: None,
            mode: None,
            camera,
            baseline_m: Some(baseline_m),
            code,
            intrinsics_uncertainty: None,
            kind: None,
        };
        Unit { sensor, baseline_m, sigma }
    }

    /// Standard deviation of depth, m.
    pub fn sigma(&self, z: f64, theta: f64) -> f64 {
        let [a, b, c, d, e, f] = self.sigma;
        let z = z.clamp(VALID_M[0], VALID_M[1]);
        let theta = theta.clamp(VALID_RAD[0], VALID_RAD[1]);
        a + b * (z - c).powi(2) + d * z.powf(e) * (theta / (f - theta)).powi(2)
    }

    /// Factor on errors in px for images smaller than 640 px wide.
    pub fn scale(&self) -> f64 {
        self.sensor.camera.width as f64 / 640.0
    }

    /// Units of the stored depth, 1/m.
    pub fn units_per_metre(&self) -> f64 {
        match self.sensor.code {
            DepthCode::Metric { units_per_metre, .. } => units_per_metre,
            DepthCode::Disparity { .. } => f64::NAN,
        }
    }

    /// fx times the baseline, px m.
    pub fn disparity_px_m(&self) -> f64 {
        self.sensor.camera.fx * self.baseline_m
    }

    /// Content of the model file: what is known of this unit.
    pub fn model(&self, effects: Vec<Effect>) -> Result<NoiseModel> {
        let domain = Domain { z_m: VALID_M, theta_rad: VALID_RAD };
        Ok(NoiseModel {
            sensor: Some(RecordingFile::of(&self.sensor)),
            sigma: SigmaModel::published(Form::Paper, &self.sigma, domain),
            effects,
            uncertainty: None,
            fit: FitSummary::default(),
            // The same bytes whenever it is written.
            provenance: Provenance::at(None, std::time::SystemTime::UNIX_EPOCH),
        })
    }
}
