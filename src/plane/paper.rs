//! The paper's plane: RANSAC with three-point hypotheses on 3-D points, then total least squares.

use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use rand::seq::index::sample;

use super::Plane;
use super::ransac::{RansacOptions, ransac};
use crate::rng::Stream;

/// Points in the optical frame, m, by coordinate.
#[derive(Debug, Clone, Default)]
pub struct Points {
    pub x: Vec<f32>,
    pub y: Vec<f32>,
    pub z: Vec<f32>,
}

impl Points {
    pub fn push(&mut self, x: f32, y: f32, z: f32) {
        self.x.push(x);
        self.y.push(y);
        self.z.push(z);
    }

    pub fn at(&self, i: usize) -> Vector3<f64> {
        Vector3::new(f64::from(self.x[i]), f64::from(self.y[i]), f64::from(self.z[i]))
    }
}

/// n . X = rho, n of unit length.
type NormalForm = (Vector3<f64>, f64);

/// The paper's plane and the statistics of its inliers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RansacPlane {
    /// Total least squares over the inliers.
    pub plane: Plane,
    /// Mean depth of the inliers, m.
    pub z_m: f64,
    /// Angle between the optical axis and the plane's normal, rad.
    pub theta_rad: f64,
    /// Standard deviation of the inliers' point-to-plane distances, m.
    pub sigma_m: f64,
    pub inliers: usize,
}

/// Hypotheses are judged on this many points: the standard error of an inlier share is then at most one
/// percent, and the cost does not grow with the image.
const JURY: usize = 2500;

/// Fits a plane by RANSAC and then twice by total least squares on the inliers, so that the inlier set
/// belongs to the refitted plane (Yamaguchi et al. 2016, section II).
///
/// `None` when the points contain no plane.
pub fn ransac_plane(
    points: &Points,
    options: &RansacOptions,
    rng: &mut Stream,
) -> Option<RansacPlane> {
    let n = points.x.len();
    let jury: Vec<usize> =
        if n <= JURY { (0..n).collect() } else { sample(rng, n, JURY).into_vec() };
    let through = |three: [usize; 3]| {
        let [a, b, c] = three.map(|i| points.at(i));
        let normal = (b - a).cross(&(c - a));
        let (length, n) = (normal.norm(), normal / normal.norm());
        (length > 1e-9).then(|| (n, n.dot(&a)))
    };
    let distance = |(n, rho): &NormalForm, i: usize| (n.dot(&points.at(i)) - rho).abs();
    let mut model = ransac(n, options, rng, &jury, through, distance)?;
    for _ in 0..REFITS {
        model = Moments::of_inliers(points, &model, options.threshold_m).total_least_squares()?;
    }
    let last = Moments::of_inliers(points, &model, options.threshold_m);
    let plane = Plane::from_normal(model.0, model.1);
    plane.is_finite().then_some(RansacPlane {
        plane,
        z_m: last.centroid().z,
        theta_rad: plane.theta(),
        sigma_m: last.spread_along(&model.0),
        inliers: last.n as usize,
    })
}

const REFITS: usize = 2;

/// First and second moments of the inliers, about a point near them to keep precision.
#[derive(Debug, Clone, Default)]
struct Moments {
    n: f64,
    origin: Vector3<f64>,
    first: [f64; 3],
    second: [f64; 6],
}

/// Points summed in single precision before they are added to the double-precision total: enough to use
/// vector registers, few enough to lose nothing (256 terms of similar size: 1e-5 relative).
const BLOCK: usize = 256;

impl Moments {
    fn of_inliers(points: &Points, (n, rho): &NormalForm, threshold: f64) -> Self {
        let origin = n * *rho;
        let mut moments = Moments { origin, ..Moments::default() };
        let (nx, ny, nz) = (n.x as f32, n.y as f32, n.z as f32);
        let (ox, oy, oz) = (origin.x as f32, origin.y as f32, origin.z as f32);
        let threshold = threshold as f32;
        let blocks = points.x.chunks(BLOCK).zip(points.y.chunks(BLOCK)).zip(points.z.chunks(BLOCK));
        for ((xs, ys), zs) in blocks {
            let mut s = [[0f32; LANES]; 10];
            for ((x, y), z) in xs.chunks(LANES).zip(ys.chunks(LANES)).zip(zs.chunks(LANES)) {
                for lane in 0..x.len() {
                    let (px, py, pz) = (x[lane] - ox, y[lane] - oy, z[lane] - oz);
                    let d = nx * px + ny * py + nz * pz;
                    let w = if d.abs() < threshold { 1.0f32 } else { 0.0 };
                    let terms = [
                        w,
                        w * px,
                        w * py,
                        w * pz,
                        w * px * px,
                        w * px * py,
                        w * px * pz,
                        w * py * py,
                        w * py * pz,
                        w * pz * pz,
                    ];
                    for (sum, term) in s.iter_mut().zip(terms) {
                        sum[lane] += term;
                    }
                }
            }
            moments.add(&s);
        }
        moments
    }

    fn add(&mut self, s: &[[f32; LANES]; 10]) {
        let total = |k: usize| s[k].iter().map(|&v| f64::from(v)).sum::<f64>();
        self.n += total(0);
        for (k, sum) in self.first.iter_mut().enumerate() {
            *sum += total(1 + k);
        }
        for (k, sum) in self.second.iter_mut().enumerate() {
            *sum += total(4 + k);
        }
    }

    fn mean(&self) -> Vector3<f64> {
        Vector3::from(self.first) / self.n
    }

    fn centroid(&self) -> Vector3<f64> {
        self.origin + self.mean()
    }

    fn covariance(&self) -> Matrix3<f64> {
        let [xx, xy, xz, yy, yz, zz] = self.second;
        let m = self.mean();
        Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz) / self.n - m * m.transpose()
    }

    /// Standard deviation along a direction, with n - 3 degrees of freedom because a plane was fitted.
    fn spread_along(&self, normal: &Vector3<f64>) -> f64 {
        let variance = normal.dot(&(self.covariance() * normal)).max(0.0);
        (variance * self.n / (self.n - 3.0).max(1.0)).sqrt()
    }

    /// The plane through the centroid whose normal is the direction of least variance.
    fn total_least_squares(&self) -> Option<NormalForm> {
        if self.n < 3.0 {
            return None;
        }
        let eigen = SymmetricEigen::new(self.covariance());
        let smallest = eigen.eigenvalues.imin();
        let mut normal: Vector3<f64> = eigen.eigenvectors.column(smallest).into_owned();
        let mut rho = normal.dot(&self.centroid());
        if rho < 0.0 {
            normal = -normal;
            rho = -rho;
        }
        (rho > 1e-6 && normal.iter().all(|v| v.is_finite())).then_some((normal, rho))
    }
}

const LANES: usize = 16;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Seed;
    use rand::Rng;
    use rand_distr::{Distribution, StandardNormal};

    const OPTIONS: RansacOptions =
        RansacOptions { threshold_m: 0.012, iterations: 500, confidence: 0.999 };

    fn scene(outliers: f64) -> (Points, Plane) {
        let plane = Plane::tilted(1.5, 0.5, 0.3);
        let mut rng = Seed(1).stream("scene");
        let mut points = Points::default();
        for _ in 0..20_000 {
            let (x, y) = (rng.random_range(-0.5..0.5), rng.random_range(-0.4..0.4));
            let noise: f64 = StandardNormal.sample(&mut rng);
            let z = if rng.random::<f64>() < outliers {
                rng.random_range(0.5..4.0)
            } else {
                plane.depth(x, y) + 0.003 * noise
            };
            points.push((x * z) as f32, (y * z) as f32, z as f32);
        }
        (points, plane)
    }

    #[test]
    fn finds_the_plane_under_forty_percent_of_gross_errors() {
        let (points, truth) = scene(0.4);
        let found = ransac_plane(&points, &OPTIONS, &mut Seed(3).stream("ransac")).unwrap();
        let angle = found.plane.normal().angle(&truth.normal());
        assert!(angle < 1e-3, "{angle}");
        assert!((found.plane.distance() - truth.distance()).abs() < 5e-4);
    }

    #[test]
    fn points_on_a_line_hold_no_plane() {
        let mut points = Points::default();
        for i in 0..100 {
            points.push(i as f32 * 0.01, 0.0, 1.0);
        }
        assert!(ransac_plane(&points, &OPTIONS, &mut Seed(1).stream("r")).is_none());
    }
}
