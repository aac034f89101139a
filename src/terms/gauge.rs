//! Gauge of a shape fixed in the picture: the part of it that planes absorb.

use nalgebra::{Matrix3, Vector3};

use super::basis::Basis;
use super::modulation::Modulation;
use super::pixels::Pixels;
use super::place::PixelContext;

/// Affine part of a shape over the whole picture. Every plane absorbs it, so no fit to planes determines its
/// size.
#[derive(Debug, Clone)]
pub struct Gauge {
    /// Modulation of the shape.
    pub(crate) times: Modulation,
    /// Coefficients of 1, x and y of the ray, for each column of the shape.
    pub affine: Vec<[f64; 3]>,
}

impl Gauge {
    /// Returns the gauge; `None` for shapes that are not fixed in the picture, and for those that vanish on
    /// the optical axis by their physics.
    pub fn of(basis: &Basis, pixels: &Pixels<'_>) -> Option<Self> {
        let times = Modulation::still(basis.still_power()?);
        Some(Gauge { times, affine: affine_parts(basis, pixels, |place| place)? })
    }

    /// Whether the affine part is a plane's own, at any distance.
    pub fn is_plane(&self) -> bool {
        self.times == Modulation::One
    }

    /// Subtracts the affine part from the shape's columns.
    pub fn take_out(&self, p: &PixelContext, columns: &mut [f64]) {
        let far = self.times.value(p);
        for (g, [a, b, c]) in columns.iter_mut().zip(&self.affine) {
            *g -= far * (a + b * p.x + c * p.y);
        }
    }

    /// Same, as a separate term.
    pub fn term(&self, coefficients: &[f64]) -> (Basis, [f64; 3]) {
        let mut sum = [0.0; 3];
        for (beta, affine) in coefficients.iter().zip(&self.affine) {
            sum.iter_mut().zip(affine).for_each(|(s, a)| *s -= beta * a);
        }
        (Basis::Affine { times: self.times }, sum)
    }
}

/// Least-squares coefficients of 1, x and y of the ray for each column, over the whole picture. `at` gives
/// the place where the shape is evaluated.
pub fn affine_parts(
    basis: &Basis,
    pixels: &Pixels<'_>,
    at: impl Fn(PixelContext) -> PixelContext,
) -> Option<Vec<[f64; 3]>> {
    let count = basis.count();
    let mut square = Matrix3::zeros();
    let mut cross = vec![Vector3::zeros(); count];
    let mut row = vec![0.0; count];
    for place in pixels.sampled() {
        let ray = Vector3::new(1.0, place.x, place.y);
        square += ray * ray.transpose();
        basis.fill(&at(place), &mut row);
        cross.iter_mut().zip(&row).for_each(|(c, g)| *c += ray * *g);
    }
    let solver = square.lu();
    cross.iter().map(|c| Some(solver.solve(c)?.into())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::kinect_v1;
    use crate::terms::Coordinate;

    /// With its gauge subtracted a shape has no affine part, and an affine shape vanishes.
    #[test]
    fn what_planes_absorb_is_taken_out() {
        let sensor = kinect_v1(4);
        let rays = sensor.camera.rays();
        let pixels = Pixels::new(&sensor.camera, &rays, 43.0);
        let [width, height] = [sensor.camera.width, sensor.camera.height].map(|n| n as f64);
        let times = Modulation::DisparitySquared;
        for basis in [
            Basis::powers(Coordinate::RadiusSquared, 2, Modulation::power(2.0)),
            Basis::Spline { width, height, across: 5, down: 4, times },
            Basis::Affine { times },
        ] {
            let gauge = Gauge::of(&basis, &pixels).unwrap();
            let mut row = vec![0.0; basis.count()];
            let mut sums = vec![[0.0; 3]; basis.count()];
            for v in (2..sensor.camera.height).step_by(4) {
                for u in (2..sensor.camera.width).step_by(4) {
                    let mut place = pixels.place(v * sensor.camera.width + u);
                    place.disparity = 30.0;
                    basis.fill(&place, &mut row);
                    gauge.take_out(&place, &mut row);
                    if matches!(basis, Basis::Affine { .. }) {
                        assert!(row.iter().all(|g| g.abs() < 1e-9), "{row:?}");
                    }
                    for (sum, g) in sums.iter_mut().zip(&row) {
                        *sum = [sum[0] + g, sum[1] + g * place.x, sum[2] + g * place.y];
                    }
                }
            }
            assert!(sums.iter().flatten().all(|s| s.abs() < 1e-8), "{sums:?}");
        }
    }
}
