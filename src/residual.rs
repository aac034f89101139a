//! The residual of a depth pixel: axis and sign are defined here and nowhere else.
//!
//! * **axial** e = z - z_plane: measured minus expected depth along the optical axis, m.
//!   This is what the default model's sigma describes and what `simulate` adds.
//! * **perpendicular** p = n . X - rho: signed distance of the measured point from the plane, m,
//!   positive behind it. This is what the paper takes the standard deviation of.
//!
//! With w = 1/z_plane = q . (x, y, 1) and rho = 1/|q|: p = e * w * rho, exactly.

use crate::plane::Plane;

#[inline]
pub fn axial(z: f64, plane: &Plane, x: f64, y: f64) -> f64 {
    z - plane.depth(x, y)
}

/// Factor that turns an axial residual on the ray (x, y, 1) into a perpendicular one.
#[inline]
pub fn perpendicular_per_axial(plane: &Plane, x: f64, y: f64) -> f64 {
    plane.inverse_depth(x, y) * plane.distance()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use proptest::prelude::*;

    proptest! {
        /// Against the textbook point-to-plane distance.
        #[test]
        fn perpendicular_is_the_point_to_plane_distance(
            z0 in 0.5f64..4.0, theta in 0.0f64..1.3, azimuth in -3.0f64..3.0,
            x in -0.3f64..0.3, y in -0.25f64..0.25, e in -0.05f64..0.05) {
            let plane = Plane::tilted(z0, theta, azimuth);
            let depth = plane.depth(x, y);
            prop_assume!(depth > 0.1 && depth < 50.0);
            let z = depth + e;
            let distance = plane.normal().dot(&(Vector3::new(x, y, 1.0) * z)) - plane.distance();
            let axial = axial(z, &plane, x, y);
            let perpendicular = axial * perpendicular_per_axial(&plane, x, y);
            prop_assert!((perpendicular - distance).abs() < 1e-9);
            prop_assert!((axial - e).abs() < 1e-9);
        }
    }
}
