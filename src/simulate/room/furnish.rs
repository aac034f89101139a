//! The office: its walls, and a builder that puts furniture where it belongs.

use nalgebra::{Isometry3, Vector3};

use super::body::Body;
use super::paint::{Lay, Paint, Skin};
use super::prints::Prints;
use super::shape::Shape;
use super::{Room, desk, surroundings};
use crate::rng::Seed;

/// Side of the square floor, m: a path of freiburg2_desk's size (4.2 m across) leaves a metre to
/// the shelves on every side.
pub const FLOOR_M: f64 = 7.2;
/// Height of the room, m.
pub const CEILING_M: f64 = 2.8;

/// Width of a carpet tile, and of the pattern it is cut from, m.
const CARPET: Lay = Lay::Tiles { side_m: 0.5, of_m: 1.1 };
const CEILING_TILE_M: f32 = 0.6;

impl Room {
    /// Two desks back to back in the middle of a furnished room; the seed draws what is printed
    /// on things, and moves nothing.
    pub fn office(seed: Seed) -> Room {
        let (prints, textures) = Prints::new(seed);
        let mut builder = Builder { prints: &prints, frame: Isometry3::identity(), bodies: vec![] };
        walls(&mut builder);
        builder.at([0.0, -0.41, 0.0], 0.0, desk::first);
        builder.at([0.0, 0.41, 0.0], 180.0, desk::second);
        surroundings::furnish(&mut builder);
        Room { bodies: builder.bodies, textures }
    }
}

fn walls(b: &mut Builder) {
    let half = Vector3::new(0.5 * FLOOR_M, 0.5 * FLOOR_M, 0.5 * CEILING_M);
    let skin = Skin::all(Paint::new(b.prints.plaster, Lay::Repeat(1.7)))
        .with(Shape::BOTTOM, Paint::new(b.prints.carpet, CARPET))
        .with(Shape::TOP, Paint::new(b.prints.ceiling, Lay::Repeat(CEILING_TILE_M)));
    b.put(Shape::Shell(half), [0.0, 0.0, half.z], 0.0, skin);
}

/// Puts bodies into the room, in the frame of the piece of furniture at hand.
pub struct Builder<'a> {
    pub prints: &'a Prints,
    frame: Isometry3<f64>,
    bodies: Vec<Body>,
}

impl Builder<'_> {
    /// Build in a frame of its own at `at` (m), turned about z by `turn_deg`.
    pub fn at(&mut self, at: [f64; 3], turn_deg: f64, build: impl FnOnce(&mut Self)) {
        let outer = self.frame;
        self.frame = outer * pose(at, turn_deg);
        build(self);
        self.frame = outer;
    }

    /// A cuboid standing with the middle of its bottom at `at`, of `size` along x, y, z, m.
    pub fn cuboid(&mut self, at: [f64; 3], size: [f64; 3], turn_deg: f64, skin: Skin) {
        let half = 0.5 * Vector3::from(size);
        let middle = [at[0], at[1], at[2] + half.z];
        self.put(Shape::Cuboid(half), middle, turn_deg, skin);
    }

    /// An upright cylinder standing at `at`, m.
    pub fn drum(&mut self, at: [f64; 3], radius: f64, height: f64, skin: Skin) {
        let half_height = 0.5 * height;
        self.put(
            Shape::Drum { radius, half_height },
            [at[0], at[1], at[2] + half_height],
            0.0,
            skin,
        );
    }

    /// A ball lying at `at`, m.
    pub fn ball(&mut self, at: [f64; 3], radius: f64, paint: Paint) {
        self.put(Shape::Ball(radius), [at[0], at[1], at[2] + radius], 0.0, Skin::all(paint));
    }

    /// A shape with its middle at `at`, m.
    pub fn put(&mut self, shape: Shape, at: [f64; 3], turn_deg: f64, skin: Skin) {
        self.place(shape, pose(at, turn_deg), skin);
    }

    /// A shape anyhow, in the frame at hand.
    pub fn place(&mut self, shape: Shape, pose: Isometry3<f64>, skin: Skin) {
        self.bodies.push(Body { shape, room_from_body: self.frame * pose, skin });
    }

    /// One colour, red, green and blue from 0 to 1.
    pub fn plain(&self, tint: [f32; 3]) -> Paint {
        Paint::new(self.prints.plain, Lay::Repeat(0.3)).tinted(tint)
    }

    /// Black plastic and glass: dark to infrared too.
    pub fn dark(&self) -> Paint {
        self.plain([0.14, 0.14, 0.16]).infrared(0.15)
    }

    pub fn metal(&self) -> Paint {
        self.plain([0.55, 0.57, 0.6]).infrared(0.45)
    }

    pub fn wood(&self) -> Paint {
        Paint::new(self.prints.wood, Lay::Repeat(1.1))
    }
}

fn pose([x, y, z]: [f64; 3], turn_deg: f64) -> Isometry3<f64> {
    Isometry3::new(Vector3::new(x, y, z), Vector3::z() * turn_deg.to_radians())
}

/// A picture once over a face.
pub fn picture(texture: usize) -> Paint {
    Paint::new(texture, Lay::Fit)
}
