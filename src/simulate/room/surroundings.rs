//! What stands and hangs round the desks. Room frame, metres and degrees.

use super::furnish::{Builder, CEILING_M, FLOOR_M, picture};
use super::paint::{Lay, Paint, Skin};
use super::shape::Shape;

/// From the middle to a wall, m.
const WALL: f64 = 0.5 * FLOOR_M;

pub fn furnish(b: &mut Builder) {
    // Each wall in its own frame: origin at its foot, x along it, the room at -y.
    b.at([0.0, WALL, 0.0], 0.0, shelf_wall);
    b.at([-WALL, 0.0, 0.0], 90.0, window_wall);
    b.at([0.0, -WALL, 0.0], 180.0, board_wall);
    b.at([WALL, 0.0, 0.0], 270.0, door_wall);
    b.at([-0.15, -1.0, 0.0], -15.0, chair);
    b.at([0.1, 1.02, 0.0], 168.0, chair);
    b.at([1.25, -0.35, 0.0], 100.0, chair);
    on_the_floor(b);
    lamps(b);
}

fn shelf_wall(b: &mut Builder) {
    for (k, x) in [-2.4, -1.3, 1.3, 2.4].into_iter().enumerate() {
        b.at([x, -0.17, 0.0], 0.0, |b| bookcase(b, k));
    }
    poster(b, -0.35, 1.55, [0.6, 0.84], 0);
    poster(b, 0.38, 1.5, [0.6, 0.84], 1);
    b.at([0.0, -0.25, 0.0], 0.0, |b| cupboard(b, 1.2));
}

fn window_wall(b: &mut Builder) {
    for x in [-1.5, 0.5] {
        let view = picture(b.prints.window).glowing(0.8).infrared(0.1);
        let skin = Skin::all(b.plain([0.95; 3])).with(Shape::FRONT, view);
        b.cuboid([x, -0.02, 0.95], [1.6, 0.04, 1.35], 0.0, skin);
        let heater = Skin::all(b.plain([0.9; 3]));
        for k in 0..12 {
            let along = x - 0.66 + 0.12 * f64::from(k);
            b.cuboid([along, -0.08, 0.15], [0.07, 0.1, 0.55], 0.0, heater);
        }
    }
    poster(b, 2.3, 1.5, [0.6, 0.84], 2);
    b.at([2.4, -0.25, 0.0], 0.0, |b| cupboard(b, 0.8));
    b.at([-3.0, -0.5, 0.0], 0.0, plant);
}

fn board_wall(b: &mut Builder) {
    let skin = Skin::all(b.metal()).with(Shape::FRONT, picture(b.prints.board));
    b.cuboid([-0.6, -0.02, 0.95], [2.4, 0.03, 1.2], 0.0, skin);
    poster(b, 1.2, 1.5, [0.6, 0.84], 3);
    poster(b, 2.0, 1.45, [0.6, 0.84], 4);
    b.at([1.6, -0.25, 0.0], 0.0, |b| cupboard(b, 1.4));
    b.at([-2.6, -0.17, 0.0], 0.0, |b| bookcase(b, 4));
    cartons(b, [0.2, -0.4, 0.0]);
}

fn door_wall(b: &mut Builder) {
    let leaf = Skin::all(b.wood().tinted([0.8, 0.72, 0.62]));
    b.cuboid([-2.0, -0.03, 0.0], [0.9, 0.05, 2.05], 0.0, leaf);
    let frame = Skin::all(b.plain([0.5, 0.52, 0.56]));
    b.cuboid([-2.5, -0.04, 0.0], [0.08, 0.07, 2.1], 0.0, frame);
    b.cuboid([-1.5, -0.04, 0.0], [0.08, 0.07, 2.1], 0.0, frame);
    let handle = b.metal();
    b.ball([-1.62, -0.1, 1.0], 0.035, handle);
    clock(b, [-2.0, -0.03, 2.35]);
    b.at([0.6, -0.17, 0.0], 0.0, |b| bookcase(b, 5));
    b.at([1.7, -0.17, 0.0], 0.0, |b| bookcase(b, 1));
    poster(b, -0.6, 1.5, [0.6, 0.84], 5);
    b.at([-0.5, -0.25, 0.0], 0.0, |b| cupboard(b, 1.0));
    cartons(b, [2.85, -0.45, 0.0]);
}

fn poster(b: &mut Builder, x: f64, z: f64, [width, height]: [f64; 2], which: usize) {
    let skin = Skin::all(b.plain([1.0; 3])).with(Shape::FRONT, picture(b.prints.posters[which]));
    b.cuboid([x, -0.005, z - 0.5 * height], [width, 0.008, height], 0.0, skin);
}

/// Five boards, a row of books on each; its back at +y.
fn bookcase(b: &mut Builder, which: usize) {
    let wood = Skin::all(b.wood().tinted([0.86, 0.8, 0.74]));
    b.cuboid([0.0, 0.155, 0.0], [1.0, 0.02, 1.9], 0.0, wood);
    for x in [-0.49, 0.49] {
        b.cuboid([x, 0.0, 0.0], [0.02, 0.3, 1.9], 0.0, wood);
    }
    for k in 0..6 {
        let z = 0.05 + 0.365 * f64::from(k);
        b.cuboid([0.0, 0.0, z], [0.96, 0.3, 0.022], 0.0, wood);
        if k == 5 {
            break;
        }
        let row = which + k as usize;
        let spines = b.prints.spines[row % b.prints.spines.len()];
        let skin = Skin::all(b.plain([0.3, 0.28, 0.26])).with(Shape::FRONT, picture(spines));
        let has_tin = row.is_multiple_of(3);
        let (width, aside) = if has_tin { (0.62, -0.16) } else { (0.92, 0.0) };
        b.cuboid([aside, 0.03, z + 0.022], [width, 0.2, 0.27], 0.0, skin);
        if has_tin {
            let tin = Skin::all(picture(b.prints.labels[row % b.prints.labels.len()]));
            b.drum([0.3, 0.0, z + 0.022], 0.07, 0.2, tin);
        }
    }
}

/// Knee-high to chest-high, two doors, a box on top.
fn cupboard(b: &mut Builder, height: f64) {
    let body = Skin::all(b.plain([0.66, 0.68, 0.72]));
    b.cuboid([0.0, 0.0, 0.0], [1.0, 0.45, height - 0.2], 0.0, body);
    for x in [-0.245, 0.245] {
        let door = Skin::all(b.plain([0.8, 0.81, 0.83]));
        b.cuboid([x, -0.23, 0.05], [0.47, 0.015, height - 0.3], 0.0, door);
        let grip = Skin::all(b.dark());
        b.cuboid([0.2 * x, -0.245, 0.5 * height], [0.015, 0.02, 0.12], 0.0, grip);
    }
    let carton = Skin::all(picture(b.prints.cartons[(10.0 * height) as usize % 3]));
    b.cuboid([-0.2, 0.02, height - 0.2], [0.4, 0.3, 0.24], 9.0, carton);
    let page = picture(b.prints.pages[(10.0 * height) as usize % 6]);
    let sheet = Skin::all(b.plain([1.0; 3])).with(Shape::FRONT, page);
    b.cuboid([0.25, -0.24, 0.3 * height], [0.21, 0.003, 0.297], 0.0, sheet);
}

/// Five feet, a post, a seat and a back; somebody sitting on it looks to +y.
fn chair(b: &mut Builder) {
    let (dark, metal) = (Skin::all(b.dark()), Skin::all(b.metal()));
    for k in 0..5 {
        b.at([0.0, 0.0, 0.0], 72.0 * f64::from(k), |b| {
            b.cuboid([0.15, 0.0, 0.06], [0.28, 0.04, 0.03], 0.0, dark);
            let wheel = b.dark();
            b.ball([0.28, 0.0, 0.0], 0.03, wheel);
        });
    }
    b.drum([0.0, 0.0, 0.08], 0.025, 0.36, metal);
    let cloth = Skin::all(Paint::new(b.prints.cloth, Lay::Repeat(0.25)));
    b.cuboid([0.0, 0.0, 0.44], [0.46, 0.44, 0.07], 0.0, cloth);
    b.cuboid([0.0, -0.22, 0.46], [0.06, 0.03, 0.2], 0.0, dark);
    b.cuboid([0.0, -0.22, 0.6], [0.42, 0.05, 0.34], 0.0, cloth);
}

/// Three moving boxes, one on top.
fn cartons(b: &mut Builder, at: [f64; 3]) {
    b.at(at, 0.0, |b| {
        let sizes = [[0.5, 0.4, 0.36], [0.42, 0.38, 0.3], [0.4, 0.34, 0.28]];
        let places =
            [([0.0, 0.0, 0.0], 6.0), ([0.0, 0.02, 0.36], -9.0), ([-0.52, 0.05, 0.0], 14.0)];
        for (k, (at, turn)) in places.into_iter().enumerate() {
            let skin = Skin::all(picture(b.prints.cartons[k]));
            b.cuboid(at, sizes[k], turn, skin);
        }
    });
}

fn plant(b: &mut Builder) {
    let pot = Skin::all(b.plain([0.66, 0.36, 0.24]));
    b.drum([0.0, 0.0, 0.0], 0.18, 0.34, pot);
    let stem = Skin::all(b.plain([0.36, 0.28, 0.18]));
    b.drum([0.0, 0.0, 0.34], 0.025, 0.6, stem);
    // A sunflower's angle keeps the leaves apart; they widen downwards.
    for k in 0..14 {
        let angle = f64::from(k) * 2.399_963;
        let out = 0.1 + 0.012 * f64::from(14 - k);
        let green = b.plain([0.16, 0.36 + 0.02 * k as f32, 0.16]).infrared(0.5);
        let at = [out * angle.cos(), out * angle.sin(), 0.62 + 0.055 * f64::from(k)];
        b.ball(at, 0.09, green);
    }
}

/// A flat drum on its side.
fn clock(b: &mut Builder, [x, y, z]: [f64; 3]) {
    let skin = Skin::all(b.dark()).with(Shape::DRUM_TOP, picture(b.prints.clock));
    let upright = nalgebra::UnitQuaternion::from_axis_angle(
        &nalgebra::Vector3::x_axis(),
        std::f64::consts::FRAC_PI_2,
    );
    let pose = nalgebra::Isometry3::from_parts(nalgebra::Translation3::new(x, y, z), upright);
    b.place(Shape::Drum { radius: 0.17, half_height: 0.02 }, pose, skin);
}

fn on_the_floor(b: &mut Builder) {
    let striped = picture(b.prints.ball);
    b.ball([-1.75, 1.7, 0.0], 0.28, striped);
    for (k, (x, y)) in [(1.15, 0.75), (-1.2, -0.72), (2.6, -2.9)].into_iter().enumerate() {
        let inside = b.dark();
        let bin = if k == 1 { picture(b.prints.labels[1]) } else { b.plain([0.24, 0.3, 0.44]) };
        b.drum([x, y, 0.0], 0.14, 0.32, Skin::all(bin).with(Shape::DRUM_TOP, inside));
    }
    for (k, (x, y, turn)) in
        [(1.5, 1.5, 20.0), (-1.4, 0.4, -35.0), (0.9, -1.6, 50.0)].into_iter().enumerate()
    {
        let page = Skin::all(b.plain([1.0; 3])).with(Shape::TOP, picture(b.prints.pages[k]));
        b.cuboid([x, y, 0.0], [0.21, 0.297, 0.002], turn, page);
    }
    let carton = Skin::all(picture(b.prints.cartons[1]));
    b.cuboid([1.45, 0.35, 0.0], [0.36, 0.28, 0.26], 25.0, carton);
    let bag = Skin::all(Paint::new(b.prints.cloth, Lay::Repeat(0.25)).tinted([1.9, 0.9, 0.7]));
    b.cuboid([-1.1, 0.1, 0.0], [0.16, 0.36, 0.3], 8.0, bag);
    let rug = Paint::new(b.prints.cloth, Lay::Repeat(0.8)).tinted([1.5, 1.2, 1.0]);
    b.cuboid([1.9, -1.9, 0.0], [1.3, 0.9, 0.008], 15.0, Skin::all(rug));
}

/// Long tubes below the ceiling, above either side of the desks.
fn lamps(b: &mut Builder) {
    let light = Skin::all(b.plain([1.0; 3]).glowing(1.0));
    for y in [-1.5, 1.5] {
        b.cuboid([0.0, y, CEILING_M - 0.06], [2.4, 0.2, 0.05], 0.0, light);
    }
}
