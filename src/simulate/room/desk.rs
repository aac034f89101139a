//! Two desks and what lies on them. Frame of a desk: origin on the floor below the middle of its
//! top, its user at -y, metres and degrees.

use super::furnish::{Builder, picture};
use super::paint::Skin;
use super::shape::Shape;

/// Of the top: an office desk's usual size, m.
const WIDTH: f64 = 1.6;
const DEPTH: f64 = 0.8;
/// Of its upper side, m.
const TOP: f64 = 0.74;
/// ISO 216 A4, m.
const A4: [f64; 2] = [0.21, 0.297];

/// Two screens, papers, books, a cup, a lamp.
pub fn first(b: &mut Builder) {
    frame(b);
    b.at([-0.32, 0.2, TOP], 8.0, |b| screen(b, 0));
    b.at([0.3, 0.22, TOP], -12.0, |b| screen(b, 1));
    b.at([-0.2, -0.18, TOP], 3.0, keyboard);
    papers(b, &[(0.42, -0.2, 12.0, 0), (0.62, -0.1, -20.0, 1), (-0.62, -0.2, -8.0, 2)]);
    books(b, [-0.66, 0.16, TOP], &[14.0, -5.0, 22.0, 3.0], 0);
    b.at([0.16, -0.24, TOP], 0.0, |b| cup(b, 0));
    b.at([0.72, 0.26, TOP], 0.0, |b| cup(b, 1));
    carton(b, [0.62, 0.08, TOP], [0.2, 0.14, 0.1], 30.0, 0);
}

/// A screen, a notebook, a ball, tins and more papers.
pub fn second(b: &mut Builder) {
    frame(b);
    b.at([0.28, 0.2, TOP], 10.0, |b| screen(b, 2));
    b.at([-0.34, -0.02, TOP], -14.0, notebook);
    b.at([0.22, -0.16, TOP], -4.0, keyboard);
    papers(b, &[(0.62, -0.16, -15.0, 3), (-0.02, -0.22, 28.0, 4), (-0.64, -0.22, 6.0, 5)]);
    let striped = picture(b.prints.ball);
    b.ball([-0.1, 0.24, TOP], 0.09, striped);
    books(b, [0.68, 0.22, TOP], &[-12.0, 6.0, -3.0], 3);
    b.at([-0.48, 0.24, TOP], 0.0, |b| cup(b, 2));
    b.at([-0.58, 0.2, TOP], 0.0, |b| cup(b, 1));
    carton(b, [-0.3, 0.27, TOP], [0.16, 0.12, 0.19], 20.0, 1);
    carton(b, [-0.7, 0.05, TOP], [0.1, 0.2, 0.06], -10.0, 2);
}

fn frame(b: &mut Builder) {
    let (wood, metal) = (Skin::all(b.wood()), Skin::all(b.metal()));
    b.cuboid([0.0, 0.0, TOP - 0.03], [WIDTH, DEPTH, 0.03], 0.0, wood);
    for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
        let at = [x * (0.5 * WIDTH - 0.06), y * (0.5 * DEPTH - 0.06), 0.0];
        b.cuboid(at, [0.05, 0.05, TOP - 0.03], 0.0, metal);
    }
    drawers(b);
    let case = b.dark();
    b.cuboid([-0.55, 0.1, 0.02], [0.2, 0.44, 0.43], 0.0, Skin::all(case));
    let light = b.plain([0.7, 0.72, 0.74]);
    b.cuboid([-0.55, -0.125, 0.06], [0.16, 0.01, 0.36], 0.0, Skin::all(light));
}

fn drawers(b: &mut Builder) {
    let body = Skin::all(b.plain([0.75, 0.76, 0.78]));
    b.cuboid([0.52, 0.0, 0.05], [0.42, 0.6, 0.56], 0.0, body);
    for k in 0..3 {
        let z = 0.08 + 0.18 * f64::from(k);
        let front = Skin::all(b.plain([0.62, 0.64, 0.68]));
        b.cuboid([0.52, -0.305, z], [0.39, 0.01, 0.16], 0.0, front);
        let grip = Skin::all(b.dark());
        b.cuboid([0.52, -0.32, z + 0.1], [0.12, 0.016, 0.02], 0.0, grip);
    }
}

/// 24 inches, facing the user.
fn screen(b: &mut Builder, which: usize) {
    let shown = picture(b.prints.screens[which]).glowing(0.9).infrared(0.2);
    let skin = Skin::all(b.dark()).with(Shape::FRONT, shown);
    b.cuboid([0.0, 0.0, 0.1], [0.53, 0.04, 0.32], 0.0, skin);
    let dark = Skin::all(b.dark());
    b.cuboid([0.0, 0.04, 0.01], [0.06, 0.03, 0.25], 0.0, dark);
    b.drum([0.0, 0.03, 0.0], 0.11, 0.012, dark);
    let badge = Skin::all(picture(b.prints.labels[which]));
    b.cuboid([0.15, 0.022, 0.2], [0.12, 0.006, 0.1], 0.0, badge);
}

fn keyboard(b: &mut Builder) {
    let skin = Skin::all(b.dark()).with(Shape::TOP, picture(b.prints.keys));
    b.cuboid([0.0, 0.0, 0.0], [0.44, 0.15, 0.022], 0.0, skin);
    let mouse = Skin::all(b.dark());
    b.cuboid([0.3, 0.0, 0.0], [0.06, 0.11, 0.03], 6.0, mouse);
}

fn notebook(b: &mut Builder) {
    let keys = Skin::all(b.metal()).with(Shape::TOP, picture(b.prints.keys));
    b.cuboid([0.0, 0.0, 0.0], [0.34, 0.24, 0.02], 0.0, keys);
    let shown = picture(b.prints.screens[0]).glowing(0.9).infrared(0.2);
    let lid = Skin::all(b.metal()).with(Shape::FRONT, shown);
    b.cuboid([0.0, 0.125, 0.02], [0.34, 0.012, 0.22], 0.0, lid);
}

/// Printed sheets: x, y, turn, and which.
fn papers(b: &mut Builder, sheets: &[(f64, f64, f64, usize)]) {
    for &(x, y, turn, which) in sheets {
        let print = Skin::all(b.plain([1.0; 3])).with(Shape::TOP, picture(b.prints.pages[which]));
        b.cuboid([x, y, TOP], [A4[0], A4[1], 0.002], turn, print);
    }
}

/// A stack, from the bottom up: how far each is turned.
fn books(b: &mut Builder, [x, y, mut z]: [f64; 3], turns: &[f64], first: usize) {
    for (k, &turn) in turns.iter().enumerate() {
        let cover = b.prints.posters[(first + k) % b.prints.posters.len()];
        let spine = b.prints.labels[k % b.prints.labels.len()];
        let leaves = b.plain([0.94, 0.92, 0.86]);
        let skin = Skin::all(leaves)
            .with(Shape::TOP, picture(cover))
            .with(Shape::FRONT, picture(spine))
            .with(Shape::LEFT, picture(spine));
        let (shrink, thick) = (1.0 - 0.06 * k as f64, 0.028 + 0.012 * (k % 2) as f64);
        b.cuboid([x, y, z], [0.17 * shrink, 0.24 * shrink, thick], turn, skin);
        z += thick;
    }
}

fn cup(b: &mut Builder, which: usize) {
    let coffee = b.plain([0.2, 0.12, 0.08]);
    let skin = Skin::all(picture(b.prints.labels[which])).with(Shape::DRUM_TOP, coffee);
    b.drum([0.0, 0.0, 0.0], 0.042, 0.1, skin);
    let ear = Skin::all(b.plain([0.9; 3]));
    b.cuboid([0.055, 0.0, 0.03], [0.03, 0.012, 0.045], 0.0, ear);
}

fn carton(b: &mut Builder, at: [f64; 3], size: [f64; 3], turn: f64, which: usize) {
    let skin = Skin::all(picture(b.prints.cartons[which]));
    b.cuboid(at, size, turn, skin);
}
