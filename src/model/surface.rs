//! The surface sigma(z, theta) with where it holds and how sure it is.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::forms::{Form, MAX_PARAMETERS, PAPER_EQ1};
use super::rows::Rows;
use crate::stats::student_quantile;

/// Which distance sigma is the standard deviation of.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Direction {
    /// Along the optical axis: of depth.
    #[default]
    Axial,
    /// Across the plane: of the point-to-plane distance, as the paper takes it.
    Perpendicular,
}

/// Where a surface was measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Domain {
    pub z_m: [f64; 2],
    pub theta_rad: [f64; 2],
}

/// Degrees of freedom of what is taken as exact: Student's t is the normal there.
const EXACT: f64 = 1e9;

/// The domain keeps this far from a form's pole, rad.
const POLE_MARGIN: f64 = 0.01;

impl Domain {
    pub(super) fn of(rows: &Rows, pole: Option<f64>) -> Self {
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
    pub direction: Direction,
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
            degrees_of_freedom: EXACT,
            direction: Direction::Axial,
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

    /// Sigma, m, at depth `z` (m) and tilt `theta` (rad), in the model's own [`Direction`]; outside
    /// the domain, its value at the nearest edge.
    pub fn sigma(&self, z: f64, theta: f64) -> f64 {
        let (z, theta) = self.domain.clamp(z, theta);
        self.form.spec().sigma(&self.parameters, z, theta)
    }

    /// Standard deviation of *depth*, m, whatever the model was fitted to: what everything that
    /// adds or weighs noise along the optical axis asks for.
    ///
    /// A depth error e moves the point by e cos(theta) across the plane on the optical axis (see
    /// [`crate::residual`]; off the axis the factor differs by the field's half angle at most), so
    /// a perpendicular sigma is divided by cos(theta).
    pub fn axial_sigma(&self, z: f64, theta: f64) -> f64 {
        let sigma = self.sigma(z, theta);
        match self.direction {
            Direction::Axial => sigma,
            Direction::Perpendicular => sigma / self.domain.clamp(z, theta).1.cos(),
        }
    }

    /// Lower and upper end of the interval that covers sigma with probability `level`: Student's
    /// t on the logarithm, so that neither end is negative.
    pub fn interval(&self, z: f64, theta: f64, level: f64) -> [f64; 2] {
        let sigma = self.sigma(z, theta);
        let (z, theta) = self.domain.clamp(z, theta);
        let relative = self.std_error(z, theta) / sigma;
        let reach = (student_quantile(level, self.degrees_of_freedom) * relative).exp();
        [sigma / reach, sigma * reach]
    }

    /// Standard error of the form at `z` and `theta`, m, also outside the domain: root of g' C g
    /// with g the derivatives of sigma by the parameters.
    pub(super) fn std_error(&self, z: f64, theta: f64) -> f64 {
        let mut gradient = [0.0; MAX_PARAMETERS];
        self.form.spec().gradient(&self.parameters, z, theta, &mut gradient);
        let g = DVector::from_column_slice(&gradient[..self.parameters.len()]);
        g.dot(&(&self.covariance * &g)).max(0.0).sqrt()
    }

    /// Depth noise as disparity noise in px, given fx * baseline (px m), at z.
    pub fn disparity_sigma_px(&self, z: f64, disparity_px_m: f64) -> f64 {
        self.axial_sigma(z, 0.0) * disparity_px_m / (z * z)
    }
}
