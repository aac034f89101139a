//! The shapes a room is made of, each in its own frame: ray intersection, surface normal, and distance of a
//! point.

use std::f64::consts::{PI, TAU};

use nalgebra::{Vector2, Vector3};

/// A closed surface about the origin of its own frame, z up, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// Half its size along each axis.
    Cuboid(Vector3<f64>),
    Ball(f64),
    /// Upright, closed at both ends.
    Drum {
        radius: f64,
        half_height: f64,
    },
    /// A cuboid seen from inside: floor, walls and ceiling.
    Shell(Vector3<f64>),
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intersection {
    /// Ray parameter, in units of the ray's direction.
    pub t: f64,
    /// See [`Shape::FACES`].
    pub face: usize,
}

impl Shape {
    /// Cuboid and shell: -x, +x, -y, +y, -z, +z. Drum: side, bottom, top. Ball: one.
    pub const FACES: usize = 6;

    /// Radius of the bounding sphere about the origin, m.
    pub fn radius(&self) -> f64 {
        match *self {
            Shape::Cuboid(half) | Shape::Shell(half) => half.norm(),
            Shape::Ball(radius) => radius,
            Shape::Drum { radius, half_height } => radius.hypot(half_height),
        }
    }

    /// First intersection at t > 0; `None` for a ray that starts inside a closed body.
    #[inline]
    pub fn intersect(&self, o: &Vector3<f64>, d: &Vector3<f64>) -> Option<Intersection> {
        match self {
            Shape::Cuboid(half) => hit_cuboid(half, o, d),
            Shape::Ball(radius) => hit_ball(*radius, o, d),
            Shape::Drum { radius, half_height } => hit_drum(*radius, *half_height, o, d),
            Shape::Shell(half) => hit_shell(half, o, d),
        }
    }

    /// Half the size of its bounding box, m; `None` for a shell, which surrounds everything.
    pub fn half_size(&self) -> Option<Vector3<f64>> {
        match *self {
            Shape::Cuboid(half) => Some(half),
            Shape::Ball(radius) => Some(Vector3::repeat(radius)),
            Shape::Drum { radius, half_height } => Some(Vector3::new(radius, radius, half_height)),
            Shape::Shell(_) => None,
        }
    }

    /// Unit normal at a point of the surface, on the side it is seen from.
    #[inline]
    pub fn normal(&self, point: &Vector3<f64>, face: usize) -> Vector3<f64> {
        match self {
            Shape::Cuboid(_) => axis(face),
            Shape::Shell(_) => -axis(face),
            Shape::Ball(radius) => point / *radius,
            Shape::Drum { radius, .. } => match face {
                1 => -Vector3::z(),
                2 => Vector3::z(),
                _ => Vector3::new(point.x, point.y, 0.0) / *radius,
            },
        }
    }

    /// Coordinates on the surface, m: right and down for an upright viewer facing it (on horizontal faces x
    /// and -y; on the bottom of a cuboid -x and -y).
    #[inline]
    pub fn face_place(&self, point: &Vector3<f64>, face: usize) -> Vector2<f64> {
        let p = point;
        match self {
            Shape::Cuboid(_) => match face {
                0 => Vector2::new(-p.y, -p.z),
                1 => Vector2::new(p.y, -p.z),
                2 => Vector2::new(p.x, -p.z),
                3 => Vector2::new(-p.x, -p.z),
                4 => Vector2::new(-p.x, -p.y),
                _ => Vector2::new(p.x, -p.y),
            },
            Shape::Shell(_) => match face {
                0 => Vector2::new(p.y, -p.z),
                1 => Vector2::new(-p.y, -p.z),
                2 => Vector2::new(-p.x, -p.z),
                3 => Vector2::new(p.x, -p.z),
                _ => Vector2::new(p.x, -p.y),
            },
            Shape::Ball(radius) => {
                Vector2::new(p.y.atan2(p.x), -(p.z / radius).clamp(-1.0, 1.0).asin()) * *radius
            }
            Shape::Drum { radius, .. } if face == 0 => Vector2::new(p.y.atan2(p.x) * radius, -p.z),
            Shape::Drum { .. } => Vector2::new(p.x, -p.y),
        }
    }

    /// Width and height of a face in the coordinates of [`Shape::face_place`], m.
    pub fn face_size(&self, face: usize) -> Vector2<f64> {
        match *self {
            Shape::Cuboid(h) | Shape::Shell(h) => 2.0 * [h.yz(), h.xz(), h.xy()][(face / 2).min(2)],
            Shape::Ball(r) => Vector2::new(TAU * r, PI * r),
            Shape::Drum { radius, half_height } if face == 0 => {
                Vector2::new(TAU * radius, 2.0 * half_height)
            }
            Shape::Drum { radius, .. } => Vector2::repeat(2.0 * radius),
        }
    }

    /// Signed distance of a point from the forbidden region, m: the inside of a body, or the outside of a
    /// shell.
    pub fn clearance(&self, point: &Vector3<f64>) -> f64 {
        match self {
            Shape::Cuboid(half) => outside(&(point.abs() - half)),
            Shape::Ball(radius) => point.norm() - radius,
            Shape::Drum { radius, half_height } => {
                let (side, cap) = (point.x.hypot(point.y) - radius, point.z.abs() - half_height);
                outside(&Vector3::new(side, cap, f64::NEG_INFINITY))
            }
            Shape::Shell(half) => (half - point.abs()).min(),
        }
    }
}

/// Outward normal of a cuboid's face.
fn axis(face: usize) -> Vector3<f64> {
    let mut normal = Vector3::zeros();
    normal[face / 2] = if face.is_multiple_of(2) { -1.0 } else { 1.0 };
    normal
}

/// Signed distance of a point from a product of intervals, given its excess over each.
fn outside(over: &Vector3<f64>) -> f64 {
    over.map(|v| v.max(0.0)).norm() + over.max().min(0.0)
}

/// Slab method: intersects the ray's intervals in three slabs, and tells the face through which it enters.
#[inline]
fn hit_cuboid(half: &Vector3<f64>, o: &Vector3<f64>, d: &Vector3<f64>) -> Option<Intersection> {
    let (mut near, mut far, mut face) = (f64::NEG_INFINITY, f64::INFINITY, 0);
    for k in 0..3 {
        let inverse = 1.0 / d[k];
        let (low, high) = ((-half[k] - o[k]) * inverse, (half[k] - o[k]) * inverse);
        let enters = low.min(high);
        if enters > near {
            near = enters;
            face = 2 * k + usize::from(d[k] < 0.0);
        }
        far = far.min(low.max(high));
    }
    (near <= far && near > 0.0).then_some(Intersection { t: near, face })
}

fn hit_shell(half: &Vector3<f64>, o: &Vector3<f64>, d: &Vector3<f64>) -> Option<Intersection> {
    let mut hit = Intersection { t: f64::INFINITY, face: 0 };
    for k in 0..3 {
        let t = (half[k].copysign(d[k]) - o[k]) / d[k];
        if t < hit.t {
            hit = Intersection { t, face: 2 * k + usize::from(d[k] > 0.0) };
        }
    }
    (hit.t > 0.0 && hit.t.is_finite()).then_some(hit)
}

fn hit_ball(radius: f64, o: &Vector3<f64>, d: &Vector3<f64>) -> Option<Intersection> {
    let (a, b) = (d.norm_squared(), o.dot(d));
    let discriminant = b * b - a * (o.norm_squared() - radius * radius);
    if discriminant < 0.0 {
        return None;
    }
    let t = (-b - discriminant.sqrt()) / a;
    (t > 0.0).then_some(Intersection { t, face: 0 })
}

/// Intersects a ray with the intersection of an infinite cylinder and a slab.
fn hit_drum(radius: f64, half: f64, o: &Vector3<f64>, d: &Vector3<f64>) -> Option<Intersection> {
    let (side_in, side_out) = across_cylinder(radius, o, d)?;
    let inverse = 1.0 / d.z;
    let (low, high) = ((-half - o.z) * inverse, (half - o.z) * inverse);
    let (cap_in, cap_out) = (low.min(high), low.max(high));
    let near = side_in.max(cap_in);
    let face = match (cap_in > side_in, d.z < 0.0) {
        (true, true) => 2,
        (true, false) => 1,
        (false, _) => 0,
    };
    (near <= side_out.min(cap_out) && near > 0.0).then_some(Intersection { t: near, face })
}

/// Where a ray enters and leaves the infinite cylinder.
fn across_cylinder(radius: f64, o: &Vector3<f64>, d: &Vector3<f64>) -> Option<(f64, f64)> {
    let a = d.x * d.x + d.y * d.y;
    let b = o.x * d.x + o.y * d.y;
    let c = o.x * o.x + o.y * o.y - radius * radius;
    if a == 0.0 {
        return (c <= 0.0).then_some((f64::NEG_INFINITY, f64::INFINITY));
    }
    let discriminant = b * b - a * c;
    let root = discriminant.sqrt();
    (discriminant >= 0.0).then_some(((-b - root) / a, (-b + root) / a))
}
