//! One frame of a rectangular board.

use nalgebra::Vector3;
use rand_distr::{Distribution, StandardNormal};

use crate::camera::Rays;
use crate::frame::Frame;
use crate::model::SigmaModel;
use crate::plane::Plane;
use crate::rng::Stream;
use crate::view::Sensor;

/// A flat board, its centre on the optical axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Board {
    pub width_m: f64,
    pub height_m: f64,
}

/// The board's own axes in the optical frame: across the tilt and along the rest.
struct Axes {
    centre: Vector3<f64>,
    right: Vector3<f64>,
    down: Vector3<f64>,
}

impl Axes {
    /// The board's right edge stays as near to the image's horizontal as the tilt allows.
    fn of(plane: &Plane) -> Self {
        let normal = plane.normal().into_inner();
        let right = Vector3::y().cross(&normal).normalize();
        let down = normal.cross(&right);
        Axes { centre: Vector3::new(0.0, 0.0, plane.depth(0.0, 0.0)), right, down }
    }
}

/// Shoot the board at `plane`: depth along the axis plus Gaussian noise of standard deviation
/// sigma(z, theta) along that axis, then the depth code. No background: pixels beside the board measure nothing.
pub fn shoot(
    sensor: &Sensor,
    rays: &Rays,
    plane: &Plane,
    board: &Board,
    sigma: &SigmaModel,
    rng: &mut Stream,
) -> Frame {
    let axes = Axes::of(plane);
    let theta = plane.theta();
    let nothing = sensor.code.word(f64::NAN);
    let words = (0..sensor.camera.pixels())
        .map(|i| {
            let (x, y) = rays.at(i);
            let w = plane.inverse_depth(x, y);
            if w <= 0.0 {
                return nothing;
            }
            let z = 1.0 / w;
            let offset = Vector3::new(x, y, 1.0) * z - axes.centre;
            let on_board = 2.0 * offset.dot(&axes.right).abs() <= board.width_m
                && 2.0 * offset.dot(&axes.down).abs() <= board.height_m;
            if !on_board {
                return nothing;
            }
            let noise: f64 = StandardNormal.sample(rng);
            sensor.code.word(z + sigma.axial_sigma(z, theta) * noise)
        })
        .collect();
    Frame { width: sensor.camera.width, height: sensor.camera.height, words }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Seed;
    use crate::simulate::kinect_v1;

    /// The outline against the projected corners, for a frontal board.
    #[test]
    fn a_frontal_board_has_the_size_that_geometry_gives() {
        let sensor = kinect_v1(1);
        let rays = sensor.camera.rays();
        let plane = Plane::tilted(2.0, 0.0, 0.0);
        let board = Board { width_m: 0.8, height_m: 0.6 };
        let mut rng = Seed(1).stream("board");
        let frame = shoot(&sensor, &rays, &plane, &board, &SigmaModel::paper(), &mut rng);
        let seen = frame.words.iter().filter(|w| **w > 0).count() as f64;
        let expected = (0.8 * 290.0) * (0.6 * 290.0);
        assert!((seen / expected - 1.0).abs() < 0.02, "{seen} {expected}");
    }
}
