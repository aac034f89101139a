//! The surface sigma(z, theta), with its domain and uncertainty.

use nalgebra::{DMatrix, DVector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::forms::{Form, MAX_PARAMETERS, PAPER_EQ1};
use super::rows::Rows;
use crate::stats::student_quantile;

/// Which distance sigma is the standard deviation of.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Direction {
    /// Along the optical axis: of depth.
    #[default]
    Axial,
    /// Across the plane: of the point-to-plane distance, as the paper takes it.
    Perpendicular,
}

/// Where a surface was measured.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Domain {
    pub z_m: [f64; 2],
    pub theta_rad: [f64; 2],
}

/// Degrees of freedom of a surface taken as exact: Student's t is then the normal distribution.
const EXACT: f64 = 1e9;

/// Distance of the domain from a form's pole, rad.
const POLE_MARGIN: f64 = 0.01;

impl Domain {
    pub(super) fn of(rows: &Rows, pole: Option<f64>) -> Self {
        let mut theta_rad = rows.range(|r| r.theta_rad);
        if let Some(pole) = pole {
            theta_rad[1] = theta_rad[1].min(pole - POLE_MARGIN).max(theta_rad[0]);
        }
        Domain { z_m: rows.range(|r| r.z_m), theta_rad }
    }

    pub fn clamp(&self, z: f64, theta: f64) -> (f64, f64) {
        (z.clamp(self.z_m[0], self.z_m[1]), theta.abs().clamp(self.theta_rad[0], self.theta_rad[1]))
    }

    pub fn contains(&self, z: f64, theta: f64) -> bool {
        self.clamp(z, theta) == (z, theta.abs())
    }
}

/// A surface sigma(z, theta) that can be evaluated anywhere without diverging.
#[derive(Debug, Clone, PartialEq)]
pub struct SigmaModel {
    pub form: Form,
    pub parameters: Vec<f64>,
    /// `None` for a parameter that was held fixed.
    pub std_errors: Vec<Option<f64>>,
    pub covariance: DMatrix<f64>,
    pub domain: Domain,
    pub degrees_of_freedom: f64,
    pub direction: Direction,
}

impl SigmaModel {
    /// A published surface, taken as exact, over the given domain.
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

    /// Khoshelham and Elberink 2012: half a step of disparity, measured on a plane at normal incidence.
    pub fn khoshelham() -> Self {
        // A target aligned by hand is within ten degrees of normal incidence.
        let domain = Domain { z_m: [0.5, 5.0], theta_rad: [0.0, 10f64.to_radians()] };
        Self::published(Form::Khoshelham, &[1.425e-3], domain)
    }

    /// Sigma, m, at depth `z` (m) and tilt `theta` (rad), in the model's own [`Direction`]; outside
    /// the domain, its value at the nearest edge.
    pub fn sigma(&self, z: f64, theta: f64) -> f64 {
        let (z, theta) = self.domain.clamp(z, theta);
        self.form.spec().sigma(&self.parameters, z, theta)
    }

    /// Standard deviation of *depth*, m, in whichever direction the model was fitted: for everything that
    /// adds noise along the optical axis or weights by it.
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

    /// Logarithm of the form extrapolated outside the domain over [`SigmaModel::axial_sigma`]: 0 inside, NaN
    /// where the extrapolation is not positive.
    pub fn ln_beyond_domain(&self, z: f64, theta: f64) -> f64 {
        let pole = self.form.spec().pole(&self.parameters);
        if pole.is_some_and(|pole| theta.abs() >= pole) {
            return f64::NAN;
        }
        if self.domain.contains(z, theta) {
            return 0.0;
        }
        let (_, held) = self.domain.clamp(z, theta);
        let continued = self.form.spec().sigma(&self.parameters, z, theta.abs());
        let leans = match self.direction {
            Direction::Axial => 1.0,
            Direction::Perpendicular => held.cos() / theta.cos(),
        };
        (continued / self.sigma(z, theta) * leans).ln()
    }

    /// Interval that covers sigma with probability `level`: Student's t on the logarithm, so that neither
    /// end is negative.
    pub fn interval(&self, z: f64, theta: f64, level: f64) -> [f64; 2] {
        let sigma = self.sigma(z, theta);
        let (z, theta) = self.domain.clamp(z, theta);
        let relative = self.std_error(z, theta) / sigma;
        let reach = (student_quantile(level, self.degrees_of_freedom) * relative).exp();
        [sigma / reach, sigma * reach]
    }

    /// Covariance of ln sigma at these (z, theta), each clamped to the domain.
    pub fn log_covariance(&self, places: &[(f64, f64)]) -> DMatrix<f64> {
        let p = self.parameters.len();
        let mut slopes = DMatrix::zeros(places.len(), p);
        for (row, &(z, theta)) in places.iter().enumerate() {
            let (z, theta) = self.domain.clamp(z, theta);
            let mut gradient = [0.0; MAX_PARAMETERS];
            self.form.spec().gradient(&self.parameters, z, theta, &mut gradient);
            let sigma = self.sigma(z, theta);
            (0..p).for_each(|k| slopes[(row, k)] = gradient[k] / sigma);
        }
        &slopes * &self.covariance * slopes.transpose()
    }

    /// Standard error of the form at `z` and `theta`, m, also outside the domain: the root of g' C g,
    /// with g the derivatives of sigma by the parameters.
    pub(super) fn std_error(&self, z: f64, theta: f64) -> f64 {
        let mut gradient = [0.0; MAX_PARAMETERS];
        self.form.spec().gradient(&self.parameters, z, theta, &mut gradient);
        let g = DVector::from_column_slice(&gradient[..self.parameters.len()]);
        g.dot(&(&self.covariance * &g)).max(0.0).sqrt()
    }
}

/// Table of [`SigmaModel::axial_sigma`], bilinear between nodes and held at the edge outside the domain.
#[derive(Debug, Clone)]
pub struct SigmaLookup {
    domain: Domain,
    /// m, in rows of constant tilt.
    nodes: Vec<f32>,
}

/// Nodes over depth: 8 mm apart over 4 m, where the curvature 2b of Eq. 1 errs by b step^2 / 4 = 40 nm.
const DEPTHS: usize = 512;
/// Nodes over tilt. Eq. 1 grows as 1 / (f - theta)^2, so nodes crowd quadratically towards the steepest
/// tilt; the error is 0.6 % at 0.01 rad from the pole and 0.06 % at 0.1 rad.
const TILTS: usize = 256;

impl SigmaLookup {
    pub fn of(model: &SigmaModel) -> Self {
        let domain = model.domain;
        let ([z0, z1], steepest) = (domain.z_m, domain.theta_rad[1]);
        let mut nodes = Vec::with_capacity(DEPTHS * TILTS);
        for j in 0..TILTS {
            let left = 1.0 - j as f64 / (TILTS - 1) as f64;
            for i in 0..DEPTHS {
                let z = z0 + (z1 - z0) * i as f64 / (DEPTHS - 1) as f64;
                nodes.push(model.axial_sigma(z, steepest * (1.0 - left * left)) as f32);
            }
        }
        SigmaLookup { domain, nodes }
    }

    /// Standard deviation of depth, m, at depth `z` (m) and tilt `theta` (rad).
    #[inline]
    pub fn at(&self, z: f32, theta: f32) -> f32 {
        let [z0, z1] = self.domain.z_m.map(|v| v as f32);
        let steepest = (self.domain.theta_rad[1] as f32).max(f32::MIN_POSITIVE);
        let (i, s) = cell((z - z0) / (z1 - z0).max(f32::MIN_POSITIVE), DEPTHS);
        let share = (theta / steepest).clamp(0.0, 1.0);
        let (j, t) = cell(1.0 - (1.0 - share).sqrt(), TILTS);
        let node = |i: usize, j: usize| self.nodes[j * DEPTHS + i];
        let near = node(i, j) + t * (node(i, j + 1) - node(i, j));
        let far = node(i + 1, j) + t * (node(i + 1, j + 1) - node(i + 1, j));
        near + s * (far - near)
    }
}

/// Node below a share (0 to 1) of the table's length, and the fraction to the next node.
#[inline]
fn cell(share: f32, nodes: usize) -> (usize, f32) {
    let place = share.clamp(0.0, 1.0) * (nodes - 1) as f32;
    let below = (place as usize).min(nodes - 2);
    (below, place - below as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half a metre, outside the domain of 1 to 4 m, gives the ratio of Eq. 1 there to its edge value. For a
    /// perpendicular sigma the cosines count, too; beyond the pole it is NaN.
    #[test]
    fn what_the_form_goes_on_to_is_told_beside_what_is_held() {
        let mut model = SigmaModel::paper();
        for (z, theta) in [(1.0, 0.0), (2.7, 1.0), (4.0, PAPER_EQ1[5] - POLE_MARGIN)] {
            assert_eq!(model.ln_beyond_domain(z, theta), 0.0);
        }
        let eq1 = |z: f64| 0.00151 + 0.00215 * (z - 0.483f64).powi(2);
        let near = (eq1(0.5) / eq1(1.0)).ln();
        approx::assert_relative_eq!(model.ln_beyond_domain(0.5, 0.0), near, max_relative = 1e-9);
        model.domain.theta_rad[1] = 0.5;
        let [axial, across] = [Direction::Axial, Direction::Perpendicular]
            .map(|direction| SigmaModel { direction, ..model.clone() }.ln_beyond_domain(2.0, 1.0));
        let cosines = (0.5f64.cos() / 1f64.cos()).ln();
        approx::assert_relative_eq!(across - axial, cosines, max_relative = 1e-9);
        let pole = PAPER_EQ1[5];
        assert!([pole, pole + 0.0104].iter().all(|t| model.ln_beyond_domain(2.0, *t).is_nan()));
    }

    #[test]
    fn the_table_is_the_model_inside_its_range_and_at_its_edge() {
        let across = SigmaModel { direction: Direction::Perpendicular, ..SigmaModel::paper() };
        for model in [SigmaModel::paper(), SigmaModel::nguyen(), SigmaModel::khoshelham(), across] {
            let table = SigmaLookup::of(&model);
            for i in 0..=60 {
                for j in 0..=157 {
                    let (z, theta) = (0.1 * f64::from(i), 0.01 * f64::from(j));
                    let (found, truth) =
                        (f64::from(table.at(z as f32, theta as f32)), model.axial_sigma(z, theta));
                    assert!((found / truth - 1.0).abs() < 0.01, "{z} {theta}: {found} {truth}");
                }
            }
        }
    }
}
