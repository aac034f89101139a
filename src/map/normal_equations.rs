//! The normal equations of one linearisation, and the motions that they do not determine.

use std::fmt;

use nalgebra::{Matrix3, Matrix6, SVector, SymmetricEigen, Vector3, Vector6};

/// A unit motion that depth does not determine, in the frame of the alignment's target.
///
/// Displays as "shift along x" or "turn about z", with its dominant axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Direction {
    /// m.
    pub shift: Vector3<f64>,
    /// In units of the scene's radius, comparable with the shift.
    pub turn: Vector3<f64>,
    /// Mean square distance that it moves points along their normals, at most 1.
    pub information: f64,
}

impl fmt::Display for Direction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (verb, axis) = if self.shift.norm() >= self.turn.norm() {
            ("shift along", self.shift)
        } else {
            ("turn about", self.turn)
        };
        write!(f, "{verb} {}", ["x", "y", "z"][axis.iamax()])
    }
}

/// The upper triangle of a symmetric 6 x 6 matrix, row by row.
type Triangle = SVector<f64, 21>;

/// Weighted sums over the correspondences.
#[derive(Debug, Clone, Default)]
pub struct NormalEquations {
    /// J' W J; J = [n, p x n].
    pub h: Triangle,
    /// J' J, all correspondences weighted equally: what the geometry determines, regardless of noise.
    pub geometry: Triangle,
    /// J' W r.
    pub g: Vector6<f64>,
    pub cost: f64,
    pub weight: f64,
    pub place: Vector3<f64>,
    pub place_squared: f64,
    pub correspondences: usize,
    /// Sum of squared residuals, unweighted.
    pub squares_m2: f64,
    /// |residual| times weight of each correspondence; empty unless requested.
    pub sizes: Vec<f32>,
}

pub struct Solution {
    /// Shift, m, and turn, rad, about the target's origin.
    pub step: Vector6<f64>,
    pub covariance: Matrix6<f64>,
    pub degenerate_directions: Vec<Direction>,
    pub min_information: f64,
}

/// A motion with less [`Direction::information`] is undetermined; a fully determined one has 1. Normals are
/// uncertain by a few degrees, so a bare wall seems to determine a slide along itself with 0.001 to 0.004.
const MIN_INFORMATION: f64 = 0.005;
/// Median of |x| over sigma for a Gaussian.
const MEDIAN_OVER_SIGMA: f64 = 0.6745;

impl NormalEquations {
    pub fn plus(mut self, other: NormalEquations) -> NormalEquations {
        self.h += other.h;
        self.geometry += other.geometry;
        self.g += other.g;
        self.cost += other.cost;
        self.weight += other.weight;
        self.place += other.place;
        self.place_squared += other.place_squared;
        self.correspondences += other.correspondences;
        self.squares_m2 += other.squares_m2;
        self.sizes.extend(other.sizes);
        self
    }

    /// Robust sigma of the weighted residuals, from the median of their sizes.
    pub fn robust_sigma(&self) -> f64 {
        let median = f64::from(crate::stats::median_in_place(&mut self.sizes.clone()));
        // All may be exactly zero in a synthetic scene: any scale will do whose square does not underflow.
        (median / MEDIAN_OVER_SIGMA).max(f64::from(f32::MIN_POSITIVE.sqrt()))
    }

    /// The step that minimises the cost; `None` where the sums are not finite or have no weight.
    ///
    /// Solved about the centroid, with rotations scaled by the radius: the eigenvalues of J' W J are then
    /// comparable, and each is at most 1.
    pub fn solve(&self) -> Option<Solution> {
        if !(self.weight > 0.0 && self.weight.is_finite()) {
            return None;
        }
        let centre = self.place / self.weight;
        let radius = (self.place_squared / self.weight - centre.norm_squared()).max(0.0).sqrt();
        if radius.is_nan() || radius <= 0.0 {
            return None;
        }
        let n = self.correspondences as f64;
        let (h, g) = (symmetric(&self.h) / self.weight, self.g / self.weight);
        let mut about = Matrix6::identity();
        let turn = Matrix3::identity() / radius;
        about.fixed_view_mut::<3, 3>(3, 0).copy_from(&(-turn * centre.cross_matrix()));
        about.fixed_view_mut::<3, 3>(3, 3).copy_from(&turn);
        let eigen = SymmetricEigen::new(about * h * about.transpose());
        let geometry = about * symmetric(&self.geometry) * about.transpose() / n;
        let g = about * g;
        let scatter = self.cost / self.weight * n / (n - 6.0).max(1.0) / n;
        let (mut step, mut covariance) = (Vector6::zeros(), Matrix6::zeros());
        let (mut min_information, mut degenerate_directions) = (f64::INFINITY, Vec::new());
        for (k, &share) in eigen.eigenvalues.iter().enumerate() {
            let along = eigen.eigenvectors.column(k).into_owned();
            // Unweighted: a far corner among near walls has little weight, but it determines the
            // motion.
            let information = along.dot(&(geometry * along));
            min_information = min_information.min(information);
            // Undetermined motions keep their start value.
            if information >= MIN_INFORMATION && share > 0.0 {
                step -= along * (along.dot(&g) / share);
            } else {
                let half = |first| along.fixed_rows::<3>(first).into_owned();
                let (shift, turn) = (half(0), half(3));
                degenerate_directions.push(Direction { shift, turn, information });
            }
            covariance += along * along.transpose() * (scatter / share.max(1e-9));
        }
        let back = about.transpose();
        let step = back * step;
        let covariance = back * covariance * about;
        let finite = step.iter().all(|v| v.is_finite());
        finite.then_some(Solution { step, covariance, degenerate_directions, min_information })
    }
}

fn symmetric(triangle: &Triangle) -> Matrix6<f64> {
    let mut matrix = Matrix6::zeros();
    let mut k = 0;
    for a in 0..6 {
        for b in a..6 {
            matrix[(a, b)] = triangle[k];
            matrix[(b, a)] = triangle[k];
            k += 1;
        }
    }
    matrix
}
