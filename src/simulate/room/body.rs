//! A room made of bodies, and where rays from one point hit them.

use nalgebra::{Isometry3, Matrix3, Translation3, Vector3};

use super::shape::{Intersection, Shape};
use super::texture::{Material, Texture};
use crate::scene::{Hit, RaysFrom, Surface, World};

/// A shape somewhere in the room, with the material of each of its faces.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    pub shape: Shape,
    pub room_from_body: Isometry3<f64>,
    pub materials: [Material; Shape::FACES],
}

/// Bodies and the textures on them. One body is a [`Shape::Shell`] when there are walls.
#[derive(Debug, Clone, PartialEq)]
pub struct Room {
    pub bodies: Vec<Body>,
    pub textures: Vec<Texture>,
}

impl Room {
    /// Distance of a point from the nearest surface, m, and that body's index; negative inside furniture
    /// and behind walls.
    pub fn clearance(&self, point: &Vector3<f64>) -> (f64, usize) {
        let of = |body: &Body| {
            let in_body = body.room_from_body.inverse_transform_point(&(*point).into());
            body.shape.clearance(&in_body.coords)
        };
        let all = self.bodies.iter().enumerate().map(|(i, body)| (of(body), i));
        all.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, 0))
    }

    /// One surface per face: none is the calibration target, and none has a fixed tilt, as that changes
    /// with the pose.
    pub fn surfaces(&self) -> Vec<Surface> {
        let any = Surface { is_target: false, theta_rad: None };
        vec![any; self.bodies.len() * Shape::FACES]
    }

    pub fn posed(&self, room_from_camera: &Isometry3<f64>) -> impl Iterator<Item = PosedBody<'_>> {
        let pose = *room_from_camera;
        self.bodies.iter().enumerate().map(move |(i, body)| PosedBody::new(i, body, &pose))
    }
}

/// A room as a world in the frame of a camera inside it.
pub struct PosedRoom<'a> {
    pub room: &'a Room,
    pub room_from_camera: Isometry3<f64>,
}

impl PosedRoom<'_> {
    /// The bodies as seen from a point of the camera's frame, with ray directions in that frame.
    fn about(&self, origin: &Vector3<f64>) -> Vec<PosedBody<'_>> {
        self.room.posed(&(self.room_from_camera * Translation3::from(*origin))).collect()
    }
}

impl World for PosedRoom<'_> {
    fn cast(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Hit> {
        nearest(&self.about(origin), direction)
    }

    fn from<'a>(&'a self, origin: Vector3<f64>) -> RaysFrom<'a> {
        let bodies = self.about(&origin);
        Box::new(move |direction| nearest(&bodies, direction))
    }

    fn surfaces(&self) -> Vec<Surface> {
        self.room.surfaces()
    }
}

/// First surface that a ray hits.
fn nearest(bodies: &[PosedBody<'_>], direction: &Vector3<f64>) -> Option<Hit> {
    let (posed, Intersection { t, face }) = first_met(bodies, direction)?;
    Some(Hit {
        t,
        normal: posed.normal(&posed.point(direction, t), face),
        surface: posed.surface(face),
        albedo: f64::from(posed.body.materials[face].albedo),
    })
}

/// First body that a ray hits, and where; fastest when the bodies are sorted nearest first.
#[inline]
pub fn first_met<'a, 'b: 'a>(
    bodies: impl IntoIterator<Item = &'a PosedBody<'b>>,
    direction: &Vector3<f64>,
) -> Option<(&'a PosedBody<'b>, Intersection)> {
    let length = direction.norm();
    let mut best: Option<(&PosedBody<'b>, Intersection)> = None;
    for body in bodies {
        let reached = best.map_or(f64::INFINITY, |(_, at)| at.t);
        if body.nearest > reached * length {
            continue;
        }
        if let Some(at) = body.intersect(direction)
            && at.t < reached
        {
            best = Some((body, at));
        }
    }
    best
}

/// A body prepared for a camera's rays: all start at one point, with directions in the camera's frame.
pub struct PosedBody<'a> {
    pub body: &'a Body,
    pub index: usize,
    body_from_camera: Matrix3<f64>,
    /// Camera position in the body's frame, m.
    origin: Vector3<f64>,
    /// Lower bound on the distance of a hit, m.
    pub nearest: f64,
}

/// Bounds of a bounding box in the ray coordinates x/z and y/z: lowest and highest.
pub type Window = [[f64; 2]; 2];

const EVERYWHERE: Window = [[f64::NEG_INFINITY; 2], [f64::INFINITY; 2]];

impl<'a> PosedBody<'a> {
    fn new(index: usize, body: &'a Body, room_from_camera: &Isometry3<f64>) -> Self {
        let camera_from_body = room_from_camera.inv_mul(&body.room_from_body);
        let body_from_camera = camera_from_body.inverse();
        let nearest = match body.shape {
            // A shell lies behind everything else.
            Shape::Shell(_) => f64::INFINITY,
            _ => camera_from_body.translation.vector.norm() - body.shape.radius(),
        };
        PosedBody {
            body,
            index,
            body_from_camera: body_from_camera.rotation.to_rotation_matrix().into_inner(),
            origin: body_from_camera.translation.vector,
            nearest,
        }
    }

    /// Region of the picture in which rays may hit it, `None` for nowhere. Never too small.
    pub fn window(&self) -> Option<Window> {
        let Some(half) = self.body.shape.half_size() else { return Some(EVERYWHERE) };
        let corners: [Vector3<f64>; 8] = std::array::from_fn(|k| {
            let sign = |bit: usize| if k >> bit & 1 == 0 { -1.0 } else { 1.0 };
            let corner = half.component_mul(&Vector3::new(sign(0), sign(1), sign(2)));
            self.body_from_camera.tr_mul(&(corner - self.origin))
        });
        if corners.iter().all(|c| c.z <= 0.0) {
            return None;
        }
        let crosses = corners.iter().any(|c| c.z <= 0.0);
        let bound = |k: usize, sign: f64| {
            // A box that crosses the camera plane extends to infinity on its side.
            if crosses && corners.iter().any(|c| sign * c[k] > 0.0) {
                return sign * f64::INFINITY;
            }
            let ahead = corners.iter().filter(|c| c.z > 0.0).map(|c| sign * c[k] / c.z);
            sign * ahead.fold(f64::NEG_INFINITY, f64::max)
        };
        Some([[0, 1].map(|k| bound(k, -1.0)), [0, 1].map(|k| bound(k, 1.0))])
    }

    #[inline]
    pub fn intersect(&self, direction: &Vector3<f64>) -> Option<Intersection> {
        self.body.shape.intersect(&self.origin, &(self.body_from_camera * direction))
    }

    /// Point at `t` along a ray, in the body's frame, m.
    #[inline]
    pub fn point(&self, direction: &Vector3<f64>, t: f64) -> Vector3<f64> {
        self.origin + self.body_from_camera * direction * t
    }

    /// Unit normal in the camera's frame at a point of the body's frame.
    #[inline]
    pub fn normal(&self, point: &Vector3<f64>, face: usize) -> Vector3<f64> {
        self.body_from_camera.tr_mul(&self.body.shape.normal(point, face))
    }

    /// Index of a face in [`World::surfaces`].
    pub fn surface(&self, face: usize) -> u16 {
        (self.index * Shape::FACES + face) as u16
    }
}
