//! Furniture as data: of which parts a piece is made.
//!
//! Frame of a piece: origin on what it stands on, z up, its user or the room at -y; metres and
//! degrees.

use nalgebra::Vector3;

use super::material::{Mapping, Material};
use super::shape::Shape;
use super::textures::{
    BALL, CARTONS, CLOCK, CLOTH, KEYS, LABELS, PAGES, PLAIN, POSTERS, SCREENS, SPINES, WOOD,
};

/// One body of a piece.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    pub shape: Shape,
    /// Its middle.
    pub at: [f64; 3],
    /// Axis of a turn times its angle.
    pub turn_deg: [f64; 3],
    pub materials: [Material; Shape::FACES],
}

impl Part {
    pub const fn new(shape: Shape, at: [f64; 3], turn_deg: f64, material: Material) -> Self {
        Part { shape, at, turn_deg: [0.0, 0.0, turn_deg], materials: [material; Shape::FACES] }
    }

    /// With another material on one face.
    #[must_use]
    pub const fn face(mut self, face: usize, material: Material) -> Self {
        self.materials[face] = material;
        self
    }
}

/// Standing with the middle of its bottom at the place given, of this size along x, y and z.
pub const fn cuboid(
    [x, y, z]: [f64; 3],
    size: [f64; 3],
    turn_deg: f64,
    material: Material,
) -> Part {
    let half = Vector3::new(0.5 * size[0], 0.5 * size[1], 0.5 * size[2]);
    Part::new(Shape::Cuboid(half), [x, y, z + 0.5 * size[2]], turn_deg, material)
}

/// An upright cylinder.
pub const fn drum([x, y, z]: [f64; 3], radius: f64, height: f64, material: Material) -> Part {
    let half_height = 0.5 * height;
    Part::new(Shape::Drum { radius, half_height }, [x, y, z + half_height], 0.0, material)
}

pub const fn ball([x, y, z]: [f64; 3], radius: f64, material: Material) -> Part {
    Part::new(Shape::Ball(radius), [x, y, z + radius], 0.0, material)
}

/// One colour: red, green and blue from 0 to 1.
pub const fn plain(tint: [f32; 3]) -> Material {
    Material::new(PLAIN, Mapping::Repeat(0.3)).tinted(tint)
}

/// A texture once over a face.
pub const fn picture(texture: usize) -> Material {
    Material::new(texture, Mapping::Fit)
}

/// Black plastic and glass: dark to infrared too.
pub const DARK: Material = plain([0.14, 0.14, 0.16]).with_albedo(0.15);
pub const METAL: Material = plain([0.55, 0.57, 0.6]).with_albedo(0.45);
pub const OAK: Material = Material::new(WOOD, Mapping::Repeat(1.1));
pub const FABRIC: Material = Material::new(CLOTH, Mapping::Repeat(0.25));
pub const WHITE: Material = plain([1.0; 3]);

/// An office desk's usual size, and the height of its top.
const DESK: [f64; 2] = [1.6, 0.8];
pub const TOP: f64 = 0.74;
/// ISO 216 A4.
const A4: [f64; 2] = [0.21, 0.297];

/// A top on four legs, drawers and a computer.
pub fn desk() -> Vec<Part> {
    let [x, y] = DESK.map(|side| 0.5 * side - 0.06);
    let leg = |x, y| cuboid([x, y, 0.0], [0.05, 0.05, TOP - 0.03], 0.0, METAL);
    let mut parts = vec![
        cuboid([0.0, 0.0, TOP - 0.03], [DESK[0], DESK[1], 0.03], 0.0, OAK),
        leg(-x, -y),
        leg(x, -y),
        leg(-x, y),
        leg(x, y),
        cuboid([0.52, 0.0, 0.05], [0.42, 0.6, 0.56], 0.0, plain([0.75, 0.76, 0.78])),
    ];
    for z in [0, 1, 2].map(|k| 0.08 + 0.18 * f64::from(k)) {
        let front = plain([0.62, 0.64, 0.68]);
        parts.push(cuboid([0.52, -0.305, z], [0.39, 0.01, 0.16], 0.0, front));
        parts.push(cuboid([0.52, -0.32, z + 0.1], [0.12, 0.016, 0.02], 0.0, DARK));
    }
    parts.push(cuboid([-0.55, 0.1, 0.02], [0.2, 0.44, 0.43], 0.0, DARK));
    parts.push(cuboid([-0.55, -0.125, 0.06], [0.16, 0.01, 0.36], 0.0, plain([0.7, 0.72, 0.74])));
    parts
}

/// 24 inches.
pub fn screen(which: usize) -> [Part; 4] {
    [
        cuboid([0.0, 0.0, 0.1], [0.53, 0.04, 0.32], 0.0, DARK).face(Shape::FRONT, display(which)),
        cuboid([0.0, 0.04, 0.01], [0.06, 0.03, 0.25], 0.0, DARK),
        drum([0.0, 0.03, 0.0], 0.11, 0.012, DARK),
        cuboid([0.15, 0.022, 0.2], [0.12, 0.006, 0.1], 0.0, picture(LABELS + which)),
    ]
}

fn display(which: usize) -> Material {
    picture(SCREENS + which).emitting(0.9).with_albedo(0.2)
}

/// With its mouse.
pub fn keyboard() -> [Part; 2] {
    [
        cuboid([0.0; 3], [0.44, 0.15, 0.022], 0.0, DARK).face(Shape::TOP, picture(KEYS)),
        cuboid([0.3, 0.0, 0.0], [0.06, 0.11, 0.03], 6.0, DARK),
    ]
}

pub fn notebook() -> [Part; 2] {
    [
        cuboid([0.0; 3], [0.34, 0.24, 0.02], 0.0, METAL).face(Shape::TOP, picture(KEYS)),
        cuboid([0.0, 0.125, 0.02], [0.34, 0.012, 0.22], 0.0, METAL).face(Shape::FRONT, display(0)),
    ]
}

/// A printed sheet lying there.
pub fn paper([x, y, z]: [f64; 3], turn_deg: f64, which: usize) -> Part {
    let sheet = cuboid([x, y, z], [A4[0], A4[1], 0.002], turn_deg, WHITE);
    sheet.face(Shape::TOP, picture(PAGES + which))
}

/// A stack, from the bottom up: how far each book is turned.
pub fn books([x, y, mut z]: [f64; 3], turns_deg: &[f64], first: usize) -> Vec<Part> {
    let book = |(k, &turn_deg): (usize, &f64)| {
        let (cover, spine) = (picture(POSTERS + (first + k) % 6), picture(LABELS + k % 3));
        let (shrink, thick) = (1.0 - 0.06 * k as f64, 0.028 + 0.012 * (k % 2) as f64);
        let size = [0.17 * shrink, 0.24 * shrink, thick];
        let book = cuboid([x, y, z], size, turn_deg, plain([0.94, 0.92, 0.86]));
        z += thick;
        book.face(Shape::TOP, cover).face(Shape::FRONT, spine).face(Shape::LEFT, spine)
    };
    turns_deg.iter().enumerate().map(book).collect()
}

pub fn cup(which: usize) -> [Part; 2] {
    let coffee = plain([0.2, 0.12, 0.08]);
    [
        drum([0.0; 3], 0.042, 0.1, picture(LABELS + which)).face(Shape::DRUM_TOP, coffee),
        cuboid([0.055, 0.0, 0.03], [0.03, 0.012, 0.045], 0.0, plain([0.9; 3])),
    ]
}

pub fn carton(at: [f64; 3], size: [f64; 3], turn_deg: f64, which: usize) -> Part {
    cuboid(at, size, turn_deg, picture(CARTONS + which))
}

/// Three moving boxes, one on top.
pub fn cartons() -> [Part; 3] {
    [
        carton([0.0; 3], [0.5, 0.4, 0.36], 6.0, 0),
        carton([0.0, 0.02, 0.36], [0.42, 0.38, 0.3], -9.0, 1),
        carton([-0.52, 0.05, 0.0], [0.4, 0.34, 0.28], 14.0, 2),
    ]
}

pub fn striped_ball(at: [f64; 3], radius: f64) -> Part {
    ball(at, radius, picture(BALL))
}

/// Its middle at (x, z) of a wall.
pub fn poster(x: f64, z: f64, which: usize) -> Part {
    let sheet = cuboid([x, -0.005, z - 0.5 * 0.84], [0.6, 0.008, 0.84], 0.0, WHITE);
    sheet.face(Shape::FRONT, picture(POSTERS + which))
}

/// Five boards with a row of books on each, a tin beside every third row; its back at +y.
pub fn bookcase(which: usize) -> Vec<Part> {
    let wood = OAK.tinted([0.86, 0.8, 0.74]);
    let side = |x| cuboid([x, 0.0, 0.0], [0.02, 0.3, 1.9], 0.0, wood);
    let mut parts =
        vec![cuboid([0.0, 0.155, 0.0], [1.0, 0.02, 1.9], 0.0, wood), side(-0.49), side(0.49)];
    for k in 0..6 {
        let z = 0.05 + 0.365 * k as f64;
        parts.push(cuboid([0.0, 0.0, z], [0.96, 0.3, 0.022], 0.0, wood));
        if k == 5 {
            break;
        }
        let row = which + k;
        let has_tin = row.is_multiple_of(3);
        let (width, x) = if has_tin { (0.62, -0.16) } else { (0.92, 0.0) };
        let row_of_books =
            cuboid([x, 0.03, z + 0.022], [width, 0.2, 0.27], 0.0, plain([0.3, 0.28, 0.26]));
        parts.push(row_of_books.face(Shape::FRONT, picture(SPINES + row % 6)));
        if has_tin {
            parts.push(drum([0.3, 0.0, z + 0.022], 0.07, 0.2, picture(LABELS + row % 3)));
        }
    }
    parts
}

/// Knee-high to chest-high, two doors, a box on top.
pub fn cupboard(height: f64) -> [Part; 7] {
    let which = (10.0 * height) as usize;
    let door =
        |x| cuboid([x, -0.23, 0.05], [0.47, 0.015, height - 0.3], 0.0, plain([0.8, 0.81, 0.83]));
    let grip = |x| cuboid([0.2 * x, -0.245, 0.5 * height], [0.015, 0.02, 0.12], 0.0, DARK);
    [
        cuboid([0.0; 3], [1.0, 0.45, height - 0.2], 0.0, plain([0.66, 0.68, 0.72])),
        door(-0.245),
        grip(-0.245),
        door(0.245),
        grip(0.245),
        carton([-0.2, 0.02, height - 0.2], [0.4, 0.3, 0.24], 9.0, which % 3),
        cuboid([0.25, -0.24, 0.3 * height], [0.21, 0.003, 0.297], 0.0, WHITE)
            .face(Shape::FRONT, picture(PAGES + which % 6)),
    ]
}

/// One of a chair's five feet, with its wheel.
pub fn chair_foot() -> [Part; 2] {
    [cuboid([0.15, 0.0, 0.06], [0.28, 0.04, 0.03], 0.0, DARK), ball([0.28, 0.0, 0.0], 0.03, DARK)]
}

/// A post, a seat and a back; somebody sitting on it looks to +y.
pub fn chair_seat() -> [Part; 4] {
    [
        drum([0.0, 0.0, 0.08], 0.025, 0.36, METAL),
        cuboid([0.0, 0.0, 0.44], [0.46, 0.44, 0.07], 0.0, FABRIC),
        cuboid([0.0, -0.22, 0.46], [0.06, 0.03, 0.2], 0.0, DARK),
        cuboid([0.0, -0.22, 0.6], [0.42, 0.05, 0.34], 0.0, FABRIC),
    ]
}

/// A pot, a stem and leaves: a sunflower's angle keeps them apart, and they widen downwards.
pub fn plant() -> Vec<Part> {
    let leaf = |k: u8| {
        let angle = f64::from(k) * 2.399_963;
        let out = 0.1 + 0.012 * f64::from(14 - k);
        let at = [out * angle.cos(), out * angle.sin(), 0.62 + 0.055 * f64::from(k)];
        ball(at, 0.09, plain([0.16, 0.36 + 0.02 * f32::from(k), 0.16]).with_albedo(0.5))
    };
    let pot = drum([0.0; 3], 0.18, 0.34, plain([0.66, 0.36, 0.24]));
    let stem = drum([0.0, 0.0, 0.34], 0.025, 0.6, plain([0.36, 0.28, 0.18]));
    [pot, stem].into_iter().chain((0..14).map(leaf)).collect()
}

/// Leaf, posts, handle, and a clock above: a flat drum on its side.
pub fn door([x, y, z]: [f64; 3]) -> [Part; 5] {
    let post = |x| cuboid([x, -0.04, z], [0.08, 0.07, 2.1], 0.0, plain([0.5, 0.52, 0.56]));
    let clock = Shape::Drum { radius: 0.17, half_height: 0.02 };
    let clock = Part::new(clock, [x, y, 2.35], 0.0, DARK).face(Shape::DRUM_TOP, picture(CLOCK));
    [
        cuboid([x, y, z], [0.9, 0.05, 2.05], 0.0, OAK.tinted([0.8, 0.72, 0.62])),
        post(x - 0.5),
        post(x + 0.5),
        ball([-1.62, -0.1, 1.0], 0.035, METAL),
        Part { turn_deg: [90.0, 0.0, 0.0], ..clock },
    ]
}

pub fn bin(x: f64, y: f64, material: Material) -> Part {
    drum([x, y, 0.0], 0.14, 0.32, material).face(Shape::DRUM_TOP, DARK)
}

/// Twelve fins below a window whose middle is at `x` of the wall.
pub fn heater(x: f64) -> impl Iterator<Item = Part> {
    let fin = move |k| [x - 0.66 + 0.12 * f64::from(k), -0.08, 0.15];
    (0..12).map(move |k| cuboid(fin(k), [0.07, 0.1, 0.55], 0.0, plain([0.9; 3])))
}
