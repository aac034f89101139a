//! The noise model: sigma(z, theta) with its domain and certainty, and the file it lives in.

mod file;
mod fit;
mod forms;
mod heldout;
mod local;
mod outliers;
mod rows;
mod tilt_search;

pub use file::{FitSummary, MODEL_FORMAT, NoiseModel, Provenance};
pub use fit::{DISTANCE_RATIO, Parameter, SigmaFit};
pub use forms::{Form, PAPER_EQ1, SigmaForm};
pub use heldout::{HeldOut, compare_forms, held_out};
pub use outliers::fit;

use nalgebra::{DMatrix, DVector};

use crate::stats::student_quantile;
use forms::MOST_PARAMETERS;
use rows::Rows;

/// Where a surface was measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Domain {
    pub z_m: [f64; 2],
    pub theta_rad: [f64; 2],
}

/// The domain keeps this far from a form's pole, rad.
const POLE_MARGIN: f64 = 0.01;

impl Domain {
    fn of(rows: &Rows, pole: Option<f64>) -> Self {
        let mut theta_rad = rows.range(|r| r.theta_rad);
        if let Some(pole) = pole {
            theta_rad[1] = theta_rad[1].min(pole - POLE_MARGIN).max(theta_rad[0]);
        }
        Domain { z_m: rows.range(|r| r.z_m), theta_rad }
    }

    /// The nearest point of the domain.
    pub fn clamp(&self, z: f64, theta: f64) -> (f64, f64) {
        (z.clamp(self.z_m[0], self.z_m[1]), theta.abs().clamp(self.theta_rad[0], self.theta_rad[1]))
    }

    pub fn contains(&self, z: f64, theta: f64) -> bool {
        self.clamp(z, theta) == (z, theta.abs())
    }
}

/// A surface sigma(z, theta) that can be evaluated anywhere and never blows up.
#[derive(Debug, Clone, PartialEq)]
pub struct SigmaModel {
    pub form: Form,
    pub parameters: Vec<f64>,
    /// `None` for a parameter that was held.
    pub std_errors: Vec<Option<f64>>,
    pub covariance: DMatrix<f64>,
    pub domain: Domain,
    pub degrees_of_freedom: f64,
}

impl SigmaModel {
    /// A published surface, taken as exact, over a domain of one's own.
    pub fn published(form: Form, parameters: &[f64], domain: Domain) -> Self {
        let p = parameters.len();
        SigmaModel {
            form,
            parameters: parameters.to_vec(),
            std_errors: vec![None; p],
            covariance: DMatrix::zeros(p, p),
            domain,
            degrees_of_freedom: 1e9,
        }
    }

    /// The paper's Eq. 1 over the paper's own range.
    pub fn paper() -> Self {
        let domain = Domain { z_m: [1.0, 4.0], theta_rad: [0.0, PAPER_EQ1[5] - POLE_MARGIN] };
        Self::published(Form::Paper, &PAPER_EQ1, domain)
    }

    /// Nguyen, Izadi and Lovell 2012, over the range they measured.
    pub fn nguyen() -> Self {
        // Their model is used below 80 degrees.
        let domain = Domain { z_m: [0.4, 4.0], theta_rad: [0.0, 80f64.to_radians()] };
        Self::published(Form::Nguyen, &[0.0012, 0.0019, 0.4, 0.0001], domain)
    }

    /// Khoshelham and Elberink 2012: half a step of disparity, measured on a plane faced squarely.
    pub fn khoshelham() -> Self {
        // A target that is faced by hand stands within ten degrees.
        let domain = Domain { z_m: [0.5, 5.0], theta_rad: [0.0, 10f64.to_radians()] };
        Self::published(Form::Khoshelham, &[1.425e-3], domain)
    }

    /// Sigma, m, at depth `z` (m) and tilt `theta` (rad); outside the domain, its value at the
    /// nearest edge.
    pub fn sigma(&self, z: f64, theta: f64) -> f64 {
        let (z, theta) = self.domain.clamp(z, theta);
        self.form.spec().sigma(&self.parameters, z, theta)
    }

    /// Lower and upper end of the interval that covers sigma with probability `level`: Student's
    /// t on the logarithm, so that neither end is negative.
    pub fn interval(&self, z: f64, theta: f64, level: f64) -> [f64; 2] {
        let sigma = self.sigma(z, theta);
        let (z, theta) = self.domain.clamp(z, theta);
        let mut gradient = [0.0; MOST_PARAMETERS];
        self.form.spec().gradient(&self.parameters, z, theta, &mut gradient);
        let g = DVector::from_column_slice(&gradient[..self.parameters.len()]);
        let std_error = g.dot(&(&self.covariance * &g)).max(0.0).sqrt();
        let reach = (student_quantile(level, self.degrees_of_freedom) * std_error / sigma).exp();
        [sigma / reach, sigma * reach]
    }

    /// Depth noise as disparity noise in px, given fx * baseline (px m), at z.
    pub fn disparity_sigma_px(&self, z: f64, disparity_px_m: f64) -> f64 {
        self.sigma(z, 0.0) * disparity_px_m / (z * z)
    }

    /// What is wrong with these numbers as a model, if anything.
    pub fn fault(&self) -> Option<String> {
        let spec = self.form.spec();
        let p = spec.parameters().len();
        if self.parameters.len() != p
            || self.covariance.shape() != (p, p)
            || self.std_errors.len() != p
        {
            return Some(format!(
                "the form \"{}\" has {p} parameters and a {p} x {p} covariance",
                self.form
            ));
        }
        if self.parameters.iter().chain(self.covariance.iter()).any(|v| !v.is_finite()) {
            return Some("a parameter or covariance is not finite".into());
        }
        let Domain { z_m, theta_rad } = self.domain;
        let range = |[low, high]: [f64; 2]| {
            low.is_finite() && high.is_finite() && low >= 0.0 && low <= high
        };
        if !range(z_m) || !range(theta_rad) || z_m[0] <= 0.0 {
            return Some("the valid range is empty or not positive".into());
        }
        if spec.pole(&self.parameters).is_some_and(|pole| pole <= theta_rad[1]) {
            return Some("the valid range of theta reaches the pole of the form".into());
        }
        let corners = z_m.into_iter().flat_map(|z| theta_rad.into_iter().map(move |t| (z, t)));
        for (z, theta) in corners {
            let sigma = self.sigma(z, theta);
            if !(sigma.is_finite() && sigma > 0.0) {
                return Some(format!("sigma({z}, {theta}) = {sigma} is not positive"));
            }
        }
        None
    }
}
