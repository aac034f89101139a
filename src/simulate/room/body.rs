//! A shape somewhere in the room, and how it looks.

use nalgebra::{Isometry3, Matrix3, Vector3};

use super::paint::{Paint, Skin};
use super::shape::{Shape, Touch};

/// One piece of furniture's part.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    pub shape: Shape,
    pub room_from_body: Isometry3<f64>,
    pub skin: Skin,
}

impl Body {
    /// How far a point of the room is from the body's surface, m; negative where it must not be.
    pub fn clearance(&self, point: &Vector3<f64>) -> f64 {
        let in_body = self.room_from_body.inverse_transform_point(&(*point).into());
        self.shape.clearance(&in_body.coords)
    }

    pub fn paint(&self, face: usize) -> &Paint {
        &self.skin.0[face]
    }
}

/// A body as rays of one bundle meet it: all from one point, directions in the bundle's frame.
#[derive(Debug, Clone, Copy)]
pub struct Staged {
    shape: Shape,
    body_from_bundle: Matrix3<f64>,
    /// The rays' common origin in the body's frame, m.
    origin: Vector3<f64>,
    /// Middle of the body in the bundle's frame, m, and the sphere about it.
    pub middle: Vector3<f64>,
    pub reach: f64,
}

impl Staged {
    /// For rays from `room_from_bundle`'s origin.
    pub fn new(body: &Body, room_from_bundle: &Isometry3<f64>) -> Self {
        let bundle_from_body = room_from_bundle.inv_mul(&body.room_from_body);
        let body_from_bundle = bundle_from_body.inverse();
        Staged {
            shape: body.shape,
            body_from_bundle: body_from_bundle.rotation.to_rotation_matrix().into_inner(),
            origin: body_from_bundle.translation.vector,
            middle: bundle_from_body.translation.vector,
            reach: body.shape.reach(),
        }
    }

    /// Nearer than this no ray of the bundle meets it, m.
    pub fn nearest(&self) -> f64 {
        match self.shape {
            // The sphere about a shell tells nothing: it is met behind everything else.
            Shape::Shell(_) => f64::INFINITY,
            _ => self.middle.norm() - self.reach,
        }
    }

    /// May a ray within the cone about the unit vector `axis` meet it? The cone widens by `slope`
    /// metres a metre. Never wrong with a no.
    pub fn is_near(&self, axis: &Vector3<f64>, slope: f64) -> bool {
        let stray = slope * (self.middle.norm() + self.reach);
        self.shape.is_near(&self.origin, &(self.body_from_bundle * axis), stray)
    }

    #[inline]
    pub fn touch(&self, direction: &Vector3<f64>) -> Option<Touch> {
        self.shape.touch(&self.origin, &(self.body_from_bundle * direction))
    }

    /// Point of the body's own frame at `t` along a ray, m.
    #[inline]
    pub fn point(&self, direction: &Vector3<f64>, t: f64) -> Vector3<f64> {
        self.origin + self.body_from_bundle * direction * t
    }

    /// Unit normal in the bundle's frame at a point of the body's frame.
    #[inline]
    pub fn normal(&self, point: &Vector3<f64>, face: usize) -> Vector3<f64> {
        self.body_from_bundle.tr_mul(&self.shape.normal(point, face))
    }
}
