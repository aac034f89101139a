//! Vectorised sums of correspondences into the normal equations, in SIMD lanes of single precision.
//!
//! A chunk of 2048 leaves a rounding error of 1e-6 of its sums, far below their noise; chunks are added
//! in double precision.

use nalgebra::Vector3;

use super::Kernel;
use super::normal_equations::NormalEquations;
use super::point::Point;
use crate::stats::TUKEY;

/// Two registers of plain x86-64 or aarch64, one of newer cores.
pub const LANES: usize = 8;
type Lanes = [f32; LANES];

/// Huber's threshold in sigmas: 95 % efficient where there are no outliers (Holland and Welsch 1977).
const HUBER: f32 = 1.345;

#[inline]
fn each(of: impl Fn(usize) -> f32) -> Lanes {
    std::array::from_fn(of)
}

/// Entries in the upper triangle of a symmetric 6 x 6 matrix.
const PAIRS: usize = 21;

/// Sums over correspondences by lane, as in [`NormalEquations`].
#[derive(Default)]
pub struct Batch {
    /// The moved points, the points they are matched with and their normals, and the variance of each
    /// distance.
    at: [Lanes; 3],
    to: [Lanes; 3],
    normal: [Lanes; 3],
    variance: Lanes,
    filled: usize,

    h: [Lanes; PAIRS],
    geometry: [Lanes; PAIRS],
    g: [Lanes; 6],
    cost: Lanes,
    weight: Lanes,
    place: [Lanes; 3],
    place_squared: Lanes,
    squares_m2: Lanes,
    correspondences: usize,
    /// `None` where sizes are not requested.
    sizes: Option<Vec<f32>>,
}

impl Batch {
    /// An empty batch; `sizes` is the number of points whose residual sizes to keep, if any.
    pub fn new(sizes: Option<usize>) -> Self {
        let sizes = sizes.map(|points| Vec::with_capacity(points + LANES));
        Batch { sizes, ..Batch::default() }
    }

    /// Adds a moved point, its neighbour, and the variance of the distance between them along the
    /// neighbour's normal.
    #[inline]
    pub fn push(&mut self, at: &Vector3<f32>, to: &Point, variance: f32, robust: &Robust) {
        let i = self.filled;
        for k in 0..3 {
            self.at[k][i] = at[k];
            self.to[k][i] = to.at[k];
            self.normal[k][i] = to.normal[k];
        }
        self.variance[i] = variance;
        self.filled += 1;
        if self.filled == LANES {
            self.add(robust);
        }
    }

    fn add(&mut self, robust: &Robust) {
        let (p, n) = (&self.at, &self.normal);
        let off: [Lanes; 3] = [0, 1, 2].map(|k| each(|i| p[k][i] - self.to[k][i]));
        let r = each(|i| off[0][i] * n[0][i] + off[1][i] * n[1][i] + off[2][i] * n[2][i]);
        let w2 = each(|i| 1.0 / self.variance[i]);
        let squared = each(|i| r[i] * r[i] * w2[i]);
        if let Some(sizes) = &mut self.sizes {
            sizes.extend(each(|i| squared[i].sqrt()));
        }
        let w2 = robust.weighted(&w2, &squared);
        let cross = |a: usize, b: usize| each(|i| p[a][i] * n[b][i] - p[b][i] * n[a][i]);
        let j = [n[0], n[1], n[2], cross(1, 2), cross(2, 0), cross(0, 1)];
        let mut k = 0;
        for a in 0..6 {
            let wj = each(|i| w2[i] * j[a][i]);
            plus(&mut self.g[a], |i| wj[i] * r[i]);
            for jb in &j[a..] {
                plus(&mut self.h[k], |i| wj[i] * jb[i]);
                plus(&mut self.geometry[k], |i| j[a][i] * jb[i]);
                k += 1;
            }
        }
        plus(&mut self.cost, |i| w2[i] * r[i] * r[i]);
        plus(&mut self.weight, |i| w2[i]);
        for (sum, p) in self.place.iter_mut().zip(p) {
            plus(sum, |i| p[i] * w2[i]);
        }
        let length2 = each(|i| p[0][i] * p[0][i] + p[1][i] * p[1][i] + p[2][i] * p[2][i]);
        plus(&mut self.place_squared, |i| length2[i] * w2[i]);
        plus(&mut self.squares_m2, |i| r[i] * r[i]);
        self.correspondences += self.filled;
        self.filled = 0;
    }

    pub fn finish(mut self, robust: &Robust) -> NormalEquations {
        let left = self.filled;
        for i in left..LANES {
            // Padding that adds nothing.
            [self.normal[0][i], self.normal[1][i], self.normal[2][i]] = [0.0; 3];
            self.variance[i] = f32::INFINITY;
        }
        if left > 0 {
            self.add(robust);
            if let Some(sizes) = &mut self.sizes {
                sizes.truncate(self.correspondences);
            }
        }
        let total = |lanes: &Lanes| lanes.iter().map(|&v| f64::from(v)).sum::<f64>();
        NormalEquations {
            h: self.h.each_ref().map(total).into(),
            geometry: self.geometry.each_ref().map(total).into(),
            g: self.g.each_ref().map(total).into(),
            cost: total(&self.cost),
            weight: total(&self.weight),
            place: self.place.each_ref().map(total).into(),
            place_squared: total(&self.place_squared),
            correspondences: self.correspondences,
            squares_m2: total(&self.squares_m2),
            sizes: self.sizes.unwrap_or_default(),
        }
    }
}

#[inline]
fn plus(sum: &mut Lanes, of: impl Fn(usize) -> f32) {
    for (i, sum) in sum.iter_mut().enumerate() {
        *sum += of(i);
    }
}

/// Robust weighting of outliers.
pub struct Robust {
    pub kernel: Kernel,
    /// Sigma of the inliers' weighted residuals.
    pub scale: f32,
}

impl Robust {
    /// The weights `w2` times those of the kernel, for the given squared weighted residuals.
    #[inline]
    fn weighted(&self, w2: &Lanes, squared: &Lanes) -> Lanes {
        let limit = |sigmas: f32| (sigmas * self.scale) * (sigmas * self.scale);
        match self.kernel {
            Kernel::Square => *w2,
            Kernel::Huber => {
                let limit = limit(HUBER);
                each(|i| w2[i] * (limit / squared[i]).min(1.0).sqrt())
            }
            Kernel::Tukey => {
                let limit = limit(TUKEY as f32);
                let left = each(|i| (1.0 - squared[i] / limit).max(0.0));
                each(|i| w2[i] * left[i] * left[i])
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix6, Vector6};

    use super::*;

    /// Compares with scalar sums in double precision, for two full batches and three more.
    #[test]
    fn side_by_side_is_as_one_by_one() {
        let wave = |i: usize, k: f32| (i as f32 * k).sin();
        let robust = Robust { kernel: Kernel::Huber, scale: 0.5 };
        let mut batch = Batch::new(Some(19));
        let (mut h, mut g) = (Matrix6::<f64>::zeros(), Vector6::<f64>::zeros());
        let mut sizes = Vec::new();
        for i in 1..20 {
            let at = Vector3::new(wave(i, 1.3), wave(i, 0.7), 2.0 + wave(i, 2.1));
            let normal = Vector3::new(wave(i, 0.9), wave(i, 1.9), -1.5).normalize();
            let to = at + Vector3::new(wave(i, 3.1), wave(i, 2.3), wave(i, 4.1)) * 0.01;
            let point = Point { at: to, normal, sigma_axial: 0.0, sigma_normal: 0.0, pixel: 0 };
            let variance = 1e-5 * (2.0 + wave(i, 5.3));
            batch.push(&at, &point, variance, &robust);
            let (p, n) = (at.cast::<f64>(), normal.cast::<f64>());
            let (r, m) = ((p - to.cast::<f64>()).dot(&n), p.cross(&n));
            let size = r.abs() / f64::from(variance).sqrt();
            let w2 = (f64::from(HUBER) * 0.5 / size).min(1.0) / f64::from(variance);
            let j = Vector6::new(n.x, n.y, n.z, m.x, m.y, m.z);
            h += w2 * j * j.transpose();
            g += w2 * r * j;
            sizes.push(size);
        }
        let sums = batch.finish(&robust);
        assert_eq!((sums.correspondences, sums.sizes.len()), (19, 19));
        assert!((sums.g - g).amax() < 1e-5 * h.amax());
        let pairs = (0..6).flat_map(|a| (a..6).map(move |b| (a, b)));
        for (found, place) in sums.h.iter().zip(pairs) {
            assert!((found - h[place]).abs() < 1e-5 * h.amax(), "{place:?}");
        }
        for (found, size) in sums.sizes.iter().zip(&sizes) {
            assert!((f64::from(*found) - size).abs() < 1e-3, "{found} {size}");
        }
    }
}
