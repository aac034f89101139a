//! Coordinates on a view's target.

use std::f64::consts::FRAC_PI_4;

use nalgebra::Vector3;

use super::field::Field;
use crate::camera::{Camera, Rays};
use crate::scene::TargetFrame;
use crate::stats::range;

/// Steps of the angle that is looked for, within 45 degrees either way: 0.5 degrees, by which a bow along one
/// side is seen as a twist of 2 sin(0.25 degrees), 1 %.
const TURNS: i32 = 90;
/// A board counts as turned where its outline lies on lines along its sides this many times as sharply as on
/// lines along an upright board's, or along the picture's own, where it ends at a given region. A round outline
/// is as sharp at any angle; sides of 100 px turned by 2 degrees spread over 3.5 px.
const SHARPER: f64 = 2.0;
/// Width that the outline's pixels scatter over on a straight side: a pixel either way.
const SIDE_PX: f64 = 2.0;
/// Most lines across a board: one seen at a grazing angle may reach to the horizon.
const MOST_LINES: f64 = 1e5;
/// Share of the picture along its border where a target may end because the sensor sees no more: as the widest
/// margin of a sensor.
const BORDER: f64 = 1.0 / 16.0;

/// Coordinates on the target along its sides, with the origin at the centroid of its pixels. Views see a board
/// turned about the optical axis by some degrees: along the picture, its bow would change from view to view.
pub fn board_frame(field: &Field, camera: &Camera, rays: &Rays) -> TargetFrame {
    const ENOUGH: usize = 5000;
    let stride = (field.pixels.len() / ENOUGH).max(1);
    let point = |i: u32| {
        let (x, y) = rays.at(i as usize);
        Vector3::new(x, y, 1.0) * field.plane.depth(x, y)
    };
    let few: Vec<u32> = field.pixels.iter().copied().step_by(stride).collect();
    let sum = few.iter().fold(Vector3::zeros(), |sum, &i| sum + point(i));
    let frame = TargetFrame::on(&field.plane, sum / few.len() as f64);
    let pixels: Vec<u32> = outline(field).collect();
    let ends: Vec<[f64; 2]> = pixels.iter().map(|&i| frame.place(&point(i)).into()).collect();
    let width = field.width as u32;
    let picture: Vec<[f64; 2]> =
        pixels.iter().map(|&i| [i % width, i / width].map(f64::from)).collect();
    let wide = SIDE_PX * frame.centre.z / camera.fx;
    let upright = sharpness(&ends, 0.0, wide).max(sharpness(&picture, 0.0, SIDE_PX));
    let turned = (-TURNS..TURNS).map(|k| f64::from(k) / f64::from(TURNS) * FRAC_PI_4);
    let tried = turned.map(|angle| (angle, sharpness(&ends, angle, wide)));
    // Of a near board two opposite sides or one may be in the picture.
    match tried.max_by(|a, b| a.1.total_cmp(&b.1)) {
        Some((angle, most)) if most > SHARPER * upright => frame.turned(angle),
        _ => frame,
    }
}

/// Pixels where the target ends inside the picture.
fn outline(field: &Field) -> impl Iterator<Item = u32> {
    let inside = |at: usize, n: usize| {
        let border = (BORDER * n as f64) as usize;
        (border..n - border).contains(&at)
    };
    let ends = field.pixels.iter().zip(&field.edge).filter(|(_, edge)| **edge <= 1.0);
    ends.map(|(&i, _)| i).filter(move |&i| {
        let i = i as usize;
        inside(i % field.width, field.width) && inside(i / field.width, field.height)
    })
}

/// How much these points lie on lines, `wide` each, at this angle and across: of each direction the sum of
/// squares of the numbers of points on its lines, and of both their geometric mean.
fn sharpness(points: &[[f64; 2]], angle: f64, wide: f64) -> f64 {
    let (sin, cos) = angle.sin_cos();
    let on_lines = |[along, across]: [f64; 2]| {
        let at = || points.iter().map(|[a, b]| along * a + across * b);
        let [low, high] = range(at());
        let last = ((high - low) / wide).min(MOST_LINES) as usize;
        let mut lines = vec![0.0; last + 1];
        at().for_each(|v| lines[(((v - low) / wide) as usize).min(last)] += 1.0);
        lines.iter().map(|n| n * n).sum::<f64>()
    };
    (on_lines([cos, sin]) * on_lines([-sin, cos])).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plane::Plane;
    use crate::simulate::kinect_v1;

    /// Angle from the picture's horizontal to the frame's right, rad, of a target that is where `holds` says so of
    /// a place on the plane, m from the optical axis, and its pixel.
    fn seen(plane: Plane, holds: impl Fn([f64; 2], [usize; 2]) -> bool) -> f64 {
        let camera = kinect_v1(1).camera;
        let rays = camera.rays();
        let unturned = TargetFrame::on(&plane, Vector3::new(0.0, 0.0, plane.depth(0.0, 0.0)));
        let is_on = |i: &u32| {
            let (x, y) = rays.at(*i as usize);
            let place = unturned.place(&(Vector3::new(x, y, 1.0) * plane.depth(x, y)));
            holds(place.into(), [*i as usize % camera.width, *i as usize / camera.width])
        };
        let pixels = (0..camera.pixels() as u32).filter(is_on).collect();
        let field = Field::unseen(plane, 43.5, [camera.width, camera.height], pixels);
        let right = board_frame(&field, &camera, &rays).right;
        right.dot(&unturned.down).atan2(right.dot(&unturned.right))
    }

    #[test]
    fn a_board_has_its_own_right() {
        for degrees in [-35.0_f64, -12.0, 5.0, 20.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let board = |[r, d]: [f64; 2], _: [usize; 2]| {
                (cos * r + sin * d).abs() < 0.4 && (cos * d - sin * r).abs() < 0.3
            };
            // Whole, tilted, and so near that corners are outside.
            for plane in [(1.5, 0.0, 0.0), (1.5, 0.6, 0.9), (0.75, 0.2, -2.0)] {
                let found = seen(Plane::tilted(plane.0, plane.1, plane.2), board).to_degrees();
                assert!((found - degrees).abs() <= 0.75, "{plane:?}: {found} for {degrees}");
            }
        }
    }

    /// A wall, a round target, an upright one, and a part of the picture given as the target.
    #[test]
    fn without_turned_sides_right_is_the_pictures() {
        for plane in [(1.5, 0.0, 0.0), (1.5, 0.6, 0.9)] {
            let turned = |holds: &dyn Fn([f64; 2], [usize; 2]) -> bool| {
                seen(Plane::tilted(plane.0, plane.1, plane.2), holds)
            };
            assert_eq!(turned(&|_, _| true), 0.0);
            assert_eq!(turned(&|[r, d], _| r.hypot(d) < 0.3), 0.0);
            assert_eq!(turned(&|[r, d], _| r.abs() < 0.4 && d.abs() < 0.3), 0.0);
            assert_eq!(turned(&|_, [u, v]| u.abs_diff(320) < 200 && v.abs_diff(240) < 150), 0.0);
        }
    }
}
