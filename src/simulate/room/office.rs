//! Where everything stands: two desks back to back in the middle of a furnished room.

use nalgebra::{Isometry3, Vector3};

use super::body::{Body, Room};
use super::furniture::*;
use super::material::{Mapping, Material};
use super::shape::Shape;
use super::textures::{self, BOARD, CARPET, CEILING, CLOTH, LABELS, PLASTER, WINDOW};
use crate::rng::Seed;

/// Side of the square floor, m: a path of freiburg2_desk's size (4.2 m across) leaves a metre to
/// the shelves on every side.
pub const FLOOR_M: f64 = 7.2;
/// Height of the room, m.
pub const CEILING_M: f64 = 2.8;
/// From the middle to a wall, m.
const WALL: f64 = 0.5 * FLOOR_M;

impl Room {
    /// The seed draws what is printed on things, and moves nothing.
    pub fn office(seed: Seed) -> Room {
        let mut office = Office { room_from_area: Isometry3::identity(), bodies: Vec::new() };
        office.middle();
        office.walls();
        office.floor_and_ceiling();
        Room { bodies: office.bodies, textures: textures::draw(seed) }
    }
}

/// A room in the making, one area after the other.
struct Office {
    /// A desk, a wall or a chair, in which the next pieces are given.
    room_from_area: Isometry3<f64>,
    bodies: Vec<Body>,
}

fn pose(at: [f64; 3], turn_deg: [f64; 3]) -> Isometry3<f64> {
    Isometry3::new(at.into(), Vector3::from(turn_deg.map(f64::to_radians)))
}

impl Office {
    /// Go on in an area whose origin is at `at` (m), turned about z.
    fn area(&mut self, at: [f64; 3], turn_deg: f64) {
        self.room_from_area = pose(at, [0.0, 0.0, turn_deg]);
    }

    /// A piece of furniture of the area.
    fn put(&mut self, at: [f64; 3], turn_deg: f64, parts: impl IntoIterator<Item = Part>) {
        let room_from_piece = self.room_from_area * pose(at, [0.0, 0.0, turn_deg]);
        self.bodies.extend(parts.into_iter().map(|part| Body {
            shape: part.shape,
            room_from_body: room_from_piece * pose(part.at, part.turn_deg),
            materials: part.materials,
        }));
    }

    /// Single things, given in the area's own frame.
    fn add(&mut self, parts: impl IntoIterator<Item = Part>) {
        self.put([0.0; 3], 0.0, parts);
    }

    fn middle(&mut self) {
        let half = Vector3::new(WALL, WALL, 0.5 * CEILING_M);
        let plaster = Material::new(PLASTER, Mapping::Repeat(1.7));
        let carpet = Material::new(CARPET, Mapping::Tiles { side_m: 0.5, of_m: 1.1 });
        let walls = Part::new(Shape::Shell(half), [0.0, 0.0, half.z], 0.0, plaster);
        let ceiling = Material::new(CEILING, Mapping::Repeat(0.6));
        self.add([walls.face(Shape::BOTTOM, carpet).face(Shape::TOP, ceiling)]);

        self.area([0.0, -0.41, 0.0], 0.0);
        self.add(desk());
        self.put([-0.32, 0.2, TOP], 8.0, screen(0));
        self.put([0.3, 0.22, TOP], -12.0, screen(1));
        self.put([-0.2, -0.18, TOP], 3.0, keyboard());
        self.add([paper([0.42, -0.2, TOP], 12.0, 0), paper([0.62, -0.1, TOP], -20.0, 1)]);
        self.add([paper([-0.62, -0.2, TOP], -8.0, 2)]);
        self.add(books([-0.66, 0.16, TOP], &[14.0, -5.0, 22.0, 3.0], 0));
        self.put([0.16, -0.24, TOP], 0.0, cup(0));
        self.put([0.72, 0.26, TOP], 0.0, cup(1));
        self.add([carton([0.62, 0.08, TOP], [0.2, 0.14, 0.1], 30.0, 0)]);

        self.area([0.0, 0.41, 0.0], 180.0);
        self.add(desk());
        self.put([0.28, 0.2, TOP], 10.0, screen(2));
        self.put([-0.34, -0.02, TOP], -14.0, notebook());
        self.put([0.22, -0.16, TOP], -4.0, keyboard());
        self.add([paper([0.62, -0.16, TOP], -15.0, 3), paper([-0.02, -0.22, TOP], 28.0, 4)]);
        self.add([paper([-0.64, -0.22, TOP], 6.0, 5), striped_ball([-0.1, 0.24, TOP], 0.09)]);
        self.add(books([0.68, 0.22, TOP], &[-12.0, 6.0, -3.0], 3));
        self.put([-0.48, 0.24, TOP], 0.0, cup(2));
        self.put([-0.58, 0.2, TOP], 0.0, cup(1));
        self.add([carton([-0.3, 0.27, TOP], [0.16, 0.12, 0.19], 20.0, 1)]);
        self.add([carton([-0.7, 0.05, TOP], [0.1, 0.2, 0.06], -10.0, 2)]);
    }

    /// Each in its own frame: origin at its foot, x along it, the room at -y.
    fn walls(&mut self) {
        self.area([0.0, WALL, 0.0], 0.0);
        for (which, x) in [-2.4, -1.3, 1.3, 2.4].into_iter().enumerate() {
            self.put([x, -0.17, 0.0], 0.0, bookcase(which));
        }
        self.add([poster(-0.35, 1.55, 0), poster(0.38, 1.5, 1)]);
        self.put([0.0, -0.25, 0.0], 0.0, cupboard(1.2));

        self.area([-WALL, 0.0, 0.0], 90.0);
        for x in [-1.5, 0.5] {
            let view = picture(WINDOW).emitting(0.8).with_albedo(0.1);
            let frame = cuboid([x, -0.02, 0.95], [1.6, 0.04, 1.35], 0.0, plain([0.95; 3]));
            self.add([frame.face(Shape::FRONT, view)]);
            self.add(heater(x));
        }
        self.add([poster(2.3, 1.5, 2)]);
        self.put([2.4, -0.25, 0.0], 0.0, cupboard(0.8));
        self.put([-3.0, -0.5, 0.0], 0.0, plant());

        self.area([0.0, -WALL, 0.0], 180.0);
        let board = cuboid([-0.6, -0.02, 0.95], [2.4, 0.03, 1.2], 0.0, METAL);
        self.add([board.face(Shape::FRONT, picture(BOARD))]);
        self.add([poster(1.2, 1.5, 3), poster(2.0, 1.45, 4)]);
        self.put([1.6, -0.25, 0.0], 0.0, cupboard(1.4));
        self.put([-2.6, -0.17, 0.0], 0.0, bookcase(4));
        self.put([0.2, -0.4, 0.0], 0.0, cartons());

        self.area([WALL, 0.0, 0.0], 270.0);
        self.add(door([-2.0, -0.03, 0.0]));
        self.put([0.6, -0.17, 0.0], 0.0, bookcase(5));
        self.put([1.7, -0.17, 0.0], 0.0, bookcase(1));
        self.add([poster(-0.6, 1.5, 5)]);
        self.put([-0.5, -0.25, 0.0], 0.0, cupboard(1.0));
        self.put([2.85, -0.45, 0.0], 0.0, cartons());
    }

    fn floor_and_ceiling(&mut self) {
        let chairs =
            [([-0.15, -1.0, 0.0], -15.0), ([0.1, 1.02, 0.0], 168.0), ([1.25, -0.35, 0.0], 100.0)];
        for (at, turn_deg) in chairs {
            self.area(at, turn_deg);
            (0..5).for_each(|k| self.put([0.0; 3], 72.0 * f64::from(k), chair_foot()));
            self.add(chair_seat());
        }
        self.area([0.0; 3], 0.0);
        let blue = plain([0.24, 0.3, 0.44]);
        self.add([striped_ball([-1.75, 1.7, 0.0], 0.28), bin(1.15, 0.75, blue)]);
        self.add([bin(-1.2, -0.72, picture(LABELS + 1)), bin(2.6, -2.9, blue)]);
        self.add([paper([1.5, 1.5, 0.0], 20.0, 0), paper([-1.4, 0.4, 0.0], -35.0, 1)]);
        self.add([paper([0.9, -1.6, 0.0], 50.0, 2)]);
        self.add([carton([1.45, 0.35, 0.0], [0.36, 0.28, 0.26], 25.0, 1)]);
        let bag = FABRIC.tinted([1.9, 0.9, 0.7]);
        self.add([cuboid([-1.1, 0.1, 0.0], [0.16, 0.36, 0.3], 8.0, bag)]);
        let rug = Material::new(CLOTH, Mapping::Repeat(0.8)).tinted([1.5, 1.2, 1.0]);
        self.add([cuboid([1.9, -1.9, 0.0], [1.3, 0.9, 0.008], 15.0, rug)]);
        // Long tubes below the ceiling, above either side of the desks.
        let tube =
            |y| cuboid([0.0, y, CEILING_M - 0.06], [2.4, 0.2, 0.05], 0.0, WHITE.emitting(1.0));
        self.add([tube(-1.5), tube(1.5)]);
    }
}
