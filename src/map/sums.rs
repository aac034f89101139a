//! The normal equations of one linearisation, and what they do not determine.

use nalgebra::{Matrix3, Matrix6, SymmetricEigen, Vector3, Vector6};

use super::direction::Direction;

/// Weighted sums over the pairs.
#[derive(Debug, Clone, Default)]
pub struct Sums {
    /// Upper triangle of J' W J, row by row; J = [n, p x n].
    h: [f64; 21],
    /// The same, every pair counting one: what the scene determines, whatever its noise.
    geometry: [f64; 21],
    /// J' W r.
    g: [f64; 6],
    cost: f64,
    weight: f64,
    place: Vector3<f64>,
    place_squared: f64,
    pub pairs: usize,
    /// Unweighted.
    pub squares_m2: f64,
    /// |residual| times weight, of every pair; empty where no kernel asks for them.
    pub sizes: Vec<f32>,
}

/// A step and how sure it is.
#[derive(Debug, Clone)]
pub struct Solution {
    /// Shift, m, and turn, rad, about the target's origin.
    pub step: Vector6<f64>,
    pub covariance: Matrix6<f64>,
    pub undetermined: Vec<Direction>,
    pub weakest: f64,
}

/// A motion is undetermined when it moves the points across their surfaces by less than this, as a
/// variance, where a fully determined one moves them by 1: normals are uncertain by a few degrees,
/// so that a bare wall seems to fix a slide along itself to 0.001 to 0.004.
const MIN_SHARE: f64 = 0.005;
/// Gaussian: median of |x| over sigma.
const MEDIAN_OVER_SIGMA: f64 = 0.6745;

impl Sums {
    /// None yet, with room for the sizes of `n` pairs.
    pub fn with_room(n: usize) -> Self {
        Sums { sizes: Vec::with_capacity(n), ..Sums::default() }
    }

    /// A pair: the moved point, the standing normal, the distance across, its weight.
    #[inline]
    pub fn add(&mut self, p: &Vector3<f32>, n: &Vector3<f32>, residual: f64, w2: f64) {
        let (p, n) = (p.map(f64::from), n.map(f64::from));
        let m = p.cross(&n);
        let j = [n.x, n.y, n.z, m.x, m.y, m.z];
        let mut k = 0;
        for a in 0..6 {
            let wa = w2 * j[a];
            self.g[a] += wa * residual;
            for &jb in &j[a..] {
                self.h[k] += wa * jb;
                self.geometry[k] += j[a] * jb;
                k += 1;
            }
        }
        self.cost += w2 * residual * residual;
        self.weight += w2;
        self.place += p * w2;
        self.place_squared += p.norm_squared() * w2;
        self.pairs += 1;
        self.squares_m2 += residual * residual;
    }

    /// Both together.
    pub fn plus(mut self, other: Sums) -> Sums {
        for (a, b) in self.h.iter_mut().zip(other.h) {
            *a += b;
        }
        for (a, b) in self.geometry.iter_mut().zip(other.geometry) {
            *a += b;
        }
        for (a, b) in self.g.iter_mut().zip(other.g) {
            *a += b;
        }
        self.cost += other.cost;
        self.weight += other.weight;
        self.place += other.place;
        self.place_squared += other.place_squared;
        self.pairs += other.pairs;
        self.squares_m2 += other.squares_m2;
        self.sizes.extend(other.sizes);
        self
    }

    /// Sigma of the weighted residuals that are no outliers, from their median.
    pub fn typical(&self) -> f64 {
        let median = f64::from(crate::stats::median_in_place(&mut self.sizes.clone()));
        // All exactly zero, as in a made-up scene: any scale will do.
        (median / MEDIAN_OVER_SIGMA).max(f64::from(f32::MIN_POSITIVE))
    }

    /// The step that makes the cost least; `None` where the sums are no numbers or weigh nothing.
    ///
    /// Solved about the points' middle, turns measured by how far they move the points: then the
    /// eigenvalues of J' W J compare, and each is at most 1.
    pub fn solve(&self) -> Option<Solution> {
        if !(self.weight > 0.0 && self.weight.is_finite()) {
            return None;
        }
        let middle = self.place / self.weight;
        let reach = (self.place_squared / self.weight - middle.norm_squared()).max(0.0).sqrt();
        if reach.is_nan() || reach <= 0.0 {
            return None;
        }
        let (h, g) = (full(&self.h) / self.weight, Vector6::from(self.g) / self.weight);
        let mut about = Matrix6::identity();
        let turn = Matrix3::identity() / reach;
        about.fixed_view_mut::<3, 3>(3, 0).copy_from(&(-turn * middle.cross_matrix()));
        about.fixed_view_mut::<3, 3>(3, 3).copy_from(&turn);
        let eigen = SymmetricEigen::new(about * h * about.transpose());
        let geometry = about * full(&self.geometry) * about.transpose() / self.pairs as f64;
        let mut weakest = f64::INFINITY;
        let g = about * g;
        let scatter = self.cost / self.weight * self.pairs as f64
            / (self.pairs as f64 - 6.0).max(1.0)
            / self.pairs as f64;
        let (mut step, mut covariance) = (Vector6::zeros(), Matrix6::zeros());
        let mut undetermined = Vec::new();
        for (k, &share) in eigen.eigenvalues.iter().enumerate() {
            let along = eigen.eigenvectors.column(k).into_owned();
            // Judged by all pairs alike: a far corner among near walls weighs little, but it tells.
            let told = along.dot(&(geometry * along));
            weakest = weakest.min(told);
            // What is not determined stays as it was, and is not known at all.
            if told >= MIN_SHARE && share > 0.0 {
                step -= along * (along.dot(&g) / share);
            } else {
                undetermined.push(Direction::of(&along, told));
            }
            covariance += along * along.transpose() * (scatter / share.max(1e-9));
        }
        let back = about.transpose();
        let step = back * step;
        step.iter().all(|v| v.is_finite()).then(|| Solution {
            step,
            covariance: back * covariance * about,
            undetermined,
            weakest,
        })
    }
}

/// The symmetric matrix of an upper triangle.
fn full(triangle: &[f64; 21]) -> Matrix6<f64> {
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
