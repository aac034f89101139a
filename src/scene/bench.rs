//! The calibration bench: a flat target, optionally with a wall behind and clutter in front.

use nalgebra::Vector3;

use super::{Hit, Surface, TargetFrame, World};
use crate::plane::Plane;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Board {
    pub width_m: f64,
    pub height_m: f64,
}

/// What the sensor faces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Target {
    Board(Board),
    /// Fills the picture.
    Wall,
}

/// A flat rectangle perpendicular to the optical axis: a box's face, a hand, a cupboard.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Patch {
    pub centre: Vector3<f64>,
    pub width_m: f64,
    pub height_m: f64,
    pub albedo: f64,
}

/// Everything in front of the sensor in one view.
#[derive(Debug, Clone, PartialEq)]
pub struct Bench {
    pub plane: Plane,
    pub target: Target,
    pub frame: TargetFrame,
    /// Reflectance of the target over its own coordinates.
    pub print: Print,
    /// Depth of a wall perpendicular to the axis, m.
    pub wall_m: Option<f64>,
    pub clutter: Vec<Patch>,
    /// Bow of the board, m: rise of its middle over its edges towards the sensor, parabolic along its
    /// right.
    pub sagitta_m: f64,
}

/// What is printed on the target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Print {
    /// Uniform grey.
    Plain(f64),
    /// Squares of this side, m, in eight greys from 1 down to 1/8.
    Patches(f64),
}

/// Practical side of a printed grey square, m.
pub const PATCH_SIDE_M: f64 = 0.15;
/// Matt white paper at 830 nm.
pub const WHITE: f64 = 0.8;
/// A painted wall.
const WALL_ALBEDO: f64 = 0.6;

const TARGET: u16 = 0;
const WALL: u16 = 1;

impl Bench {
    /// The target alone on `plane`, its centre on the optical axis.
    pub fn bare(plane: Plane, target: Target) -> Self {
        let centre = Vector3::new(0.0, 0.0, plane.depth(0.0, 0.0));
        Bench {
            plane,
            target,
            frame: TargetFrame::on(&plane, centre),
            print: Print::Plain(WHITE),
            wall_m: None,
            clutter: Vec::new(),
            sagitta_m: 0.0,
        }
    }

    fn inside(&self, (s, t): (f64, f64)) -> bool {
        match self.target {
            Target::Wall => true,
            Target::Board(b) => 2.0 * s.abs() <= b.width_m && 2.0 * t.abs() <= b.height_m,
        }
    }

    fn half_width(&self) -> f64 {
        match self.target {
            Target::Board(b) => 0.5 * b.width_m,
            // A wall bends over metres.
            Target::Wall => 1.0,
        }
    }

    /// Intersects a ray with the target; a bow of millimetres is found by iterating from the flat plane.
    fn cast_target(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Hit> {
        let normal = self.plane.normal().into_inner();
        let slope = normal.dot(direction);
        let gap = self.plane.distance() - normal.dot(origin);
        let mut t = gap / slope;
        let mut place = self.frame.place(&(origin + direction * t));
        let mut lean = 0.0;
        if self.sagitta_m != 0.0 {
            let half = self.half_width();
            for _ in 0..BOW_ITERATIONS {
                let s = place.0 / half;
                let rise = self.sagitta_m * (1.0 - s * s);
                lean = -2.0 * self.sagitta_m * s / half;
                t = (gap - rise) / slope;
                place = self.frame.place(&(origin + direction * t));
            }
        }
        if !(t > 0.0 && t.is_finite() && self.inside(place)) {
            return None;
        }
        // The surface n . X = rho - rise(s) has the gradient n + rise'(s) right.
        let bent = (normal + self.frame.right * lean).normalize();
        let facing = if bent.dot(direction) > 0.0 { -bent } else { bent };
        Some(Hit { t, normal: facing, surface: TARGET, albedo: self.print.albedo(place) })
    }

    fn cast_patch(&self, patch: &Patch, origin: &Vector3<f64>, d: &Vector3<f64>) -> Option<Hit> {
        let t = (patch.centre.z - origin.z) / d.z;
        let offset = origin + d * t - patch.centre;
        let inside =
            2.0 * offset.x.abs() <= patch.width_m && 2.0 * offset.y.abs() <= patch.height_m;
        (t > 0.0 && t.is_finite() && inside).then_some(Hit {
            t,
            normal: -Vector3::z(),
            surface: WALL + 1,
            albedo: patch.albedo,
        })
    }

    fn cast_wall(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Hit> {
        let t = (self.wall_m? - origin.z) / direction.z;
        (t > 0.0 && t.is_finite()).then_some(Hit {
            t,
            normal: -Vector3::z(),
            surface: WALL,
            albedo: WALL_ALBEDO,
        })
    }
}

/// The bow is millimetres over decimetres: each iteration shrinks the error by the slope, below 0.1.
const BOW_ITERATIONS: usize = 4;

impl Print {
    fn albedo(&self, (s, t): (f64, f64)) -> f64 {
        match *self {
            Print::Plain(albedo) => albedo,
            Print::Patches(side) => {
                let (i, j) = ((s / side).floor() as i64, (t / side).floor() as i64);
                // Neighbours differ, and grey does not correlate with either direction.
                f64::from((3 * i + 5 * j).rem_euclid(8) as i32 + 1) / 8.0
            }
        }
    }
}

impl World for Bench {
    fn cast(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Hit> {
        let patches = self.clutter.iter().filter_map(|p| self.cast_patch(p, origin, direction));
        patches
            .chain(self.cast_target(origin, direction))
            .chain(self.cast_wall(origin, direction))
            .min_by(|a, b| a.t.total_cmp(&b.t))
    }

    fn target(&self) -> Option<TargetFrame> {
        Some(self.frame)
    }

    fn surfaces(&self) -> Vec<Surface> {
        let flat = |is_target, theta| Surface { is_target, theta_rad: Some(theta) };
        vec![flat(true, self.plane.theta()), flat(false, 0.0), flat(false, 0.0)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Seen;
    use crate::simulate::kinect_v1;

    /// The outline against the projected corners, for a frontal board.
    #[test]
    fn a_frontal_board_has_the_size_that_geometry_gives() {
        let camera = kinect_v1(1).camera;
        let board = Target::Board(Board { width_m: 0.8, height_m: 0.6 });
        let bench = Bench::bare(Plane::tilted(2.0, 0.0, 0.0), board);
        let seen = Seen::of(&bench, &camera, &camera.rays());
        let pixels = seen.depth.iter().filter(|z| z.is_finite()).count() as f64;
        let expected = (0.8 * 290.0) * (0.6 * 290.0);
        assert!((pixels / expected - 1.0).abs() < 0.02, "{pixels} {expected}");
    }

    /// Depth, tilt and azimuth of every pixel against the plane's own formulas.
    #[test]
    fn a_tilted_target_is_seen_as_its_plane_says() {
        let camera = kinect_v1(4).camera;
        let rays = camera.rays();
        for azimuth in [0.0, 1.0, -2.5] {
            let plane = Plane::tilted(1.5, 0.9, azimuth);
            let seen = Seen::of(&Bench::bare(plane, Target::Wall), &camera, &rays);
            for i in (0..camera.pixels()).step_by(97) {
                let (x, y) = rays.at(i);
                if plane.inverse_depth(x, y) > 0.0 {
                    let z = plane.depth(x, y);
                    assert!((f64::from(seen.depth[i]) / z - 1.0).abs() < 1e-6);
                    assert!((seen.theta(i) - 0.9).abs() < 1e-6);
                    assert!((seen.azimuth(i) - azimuth).abs() < 1e-5, "{}", seen.azimuth(i));
                }
            }
        }
    }

    #[test]
    fn a_bowed_board_stands_out_by_its_sagitta_in_the_middle() {
        let board = Target::Board(Board { width_m: 1.0, height_m: 0.8 });
        let mut bench = Bench::bare(Plane::tilted(2.0, 0.0, 0.0), board);
        bench.sagitta_m = 0.005;
        let at = |x: f64| bench.cast(&Vector3::zeros(), &Vector3::new(x, 0.0, 1.0)).unwrap().t;
        assert!((at(0.0) - 1.995).abs() < 1e-6);
        assert!((at(0.2499) - 2.0).abs() < 1e-5, "the edge stays");
        assert!((at(0.125) - (2.0 - 0.005 * 0.75)).abs() < 1e-5, "half way");
    }
}
