//! The office's textures, drawn from the seed: materials, prints and screens.
//!
//! Each has sharp structure at several scales, so that corners are found from near and far.

use rand::Rng;

use super::canvas::{BLACK, Canvas, WHITE, any_area, any_colour, readable_on};
use super::texture::Texture;
use crate::rng::{Seed, Stream};

type Draw = fn(&mut Stream) -> Canvas;

/// Kinds of texture: name, number of different ones, and drawing function.
const KINDS: [(&str, usize, Draw); 17] = [
    ("plain", 1, plain),
    ("plaster", 1, plaster),
    ("ceiling", 1, ceiling),
    ("carpet", 1, carpet),
    ("wood", 1, wood),
    ("cloth", 1, cloth),
    ("keys", 1, keys),
    ("window", 1, window),
    ("clock", 1, clock),
    ("ball", 1, ball),
    ("board", 1, board),
    ("page", 6, page),
    ("poster", 6, poster),
    ("spines", 6, spines),
    ("screen", 3, screen),
    ("carton", 3, carton),
    ("label", 3, label),
];

/// Draws all of them by name ("wood", "page/3"), each from its own random stream.
pub fn draw(seed: Seed) -> Vec<(String, Texture)> {
    let one = |(kind, count, draw): (&str, usize, Draw), k: usize| {
        let name = if count == 1 { kind.to_string() } else { format!("{kind}/{k}") };
        let texture = draw(&mut seed.stream(&format!("room/print/{name}"))).finish();
        (name, texture)
    };
    KINDS.iter().flat_map(|&kind| (0..kind.1).map(move |k| one(kind, k))).collect()
}

fn plain(rng: &mut Stream) -> Canvas {
    let mut c = Canvas::new(128, [232; 3]);
    c.mottle([4, 4], 3.0, rng);
    c.mottle([64, 64], 4.0, rng);
    c
}

fn plaster(rng: &mut Stream) -> Canvas {
    let mut c = Canvas::new(256, [226, 224, 214]);
    for cells in [4, 32, 128] {
        c.mottle([cells, cells], 4.0, rng);
    }
    c
}

fn ceiling(rng: &mut Stream) -> Canvas {
    let mut c = Canvas::new(256, [236, 236, 232]);
    c.flecks(500, 0.006, &[[190; 3], [205; 3]], rng);
    c.frame([0.0, 0.0, 1.0, 1.0], 0.012, [170; 3]);
    c
}

/// A metre of loop pile with coloured flecks.
fn carpet(rng: &mut Stream) -> Canvas {
    let mut c = Canvas::new(512, [92, 98, 108]);
    c.mottle([6, 6], 8.0, rng);
    c.flecks(420, 0.012, &[[52, 56, 66], [150, 152, 150], [60, 74, 112]], rng);
    c.mottle([128, 128], 14.0, rng);
    c
}

/// A metre of boards, the grain along x.
fn wood(rng: &mut Stream) -> Canvas {
    let mut c = Canvas::new(512, [188, 146, 98]);
    c.mottle([2, 12], 16.0, rng);
    c.mottle([3, 60], 14.0, rng);
    c.mottle([10, 220], 12.0, rng);
    for _ in 0..7 {
        let at = [rng.random_range(0.05..0.95), rng.random_range(0.05..0.95)];
        c.disc(at, 0.014, [128, 88, 52]);
        c.disc(at, 0.008, [74, 46, 28]);
    }
    c
}

fn cloth(rng: &mut Stream) -> Canvas {
    let mut c = Canvas::new(256, [66, 72, 92]);
    for k in 0..16 {
        let y = k as f32 / 16.0;
        c.rect([0.0, y, 1.0, y + 0.02], [84, 92, 116]);
    }
    c.mottle([96, 96], 16.0, rng);
    c
}

/// Sky, a house across the street, a tree; two panes.
fn window(rng: &mut Stream) -> Canvas {
    let mut c = Canvas::new(512, [172, 204, 236]);
    c.mottle([5, 4], 18.0, rng);
    c.rect([0.0, 0.45, 1.0, 1.0], [150, 96, 78]);
    for k in 0..24 {
        let (x, y) = (0.04 + (k % 6) as f32 * 0.16, 0.5 + (k / 6) as f32 * 0.13);
        c.rect([x, y, x + 0.09, y + 0.08], [236, 232, 220]);
        c.rect([x + 0.01, y + 0.01, x + 0.08, y + 0.07], [58, 66, 82]);
    }
    for _ in 0..160 {
        let at = [rng.random_range(0.66..0.98), rng.random_range(0.3..0.85)];
        let green = rng.random_range(60..140);
        c.disc(at, rng.random_range(0.01..0.035), [40, green, 44]);
    }
    c.rect([0.485, 0.0, 0.515, 1.0], WHITE);
    c.frame([0.0, 0.0, 1.0, 1.0], 0.03, WHITE);
    c
}

fn clock(_: &mut Stream) -> Canvas {
    let mut c = Canvas::new(256, BLACK);
    c.disc([0.5, 0.5], 0.46, WHITE);
    for hour in 0..12 {
        let angle = f64::from(hour) * std::f64::consts::TAU / 12.0;
        let (sin, cos) = (angle.sin() as f32, angle.cos() as f32);
        let at = [0.5 + 0.39 * sin, 0.5 - 0.39 * cos];
        c.disc(at, if hour % 3 == 0 { 0.035 } else { 0.02 }, BLACK);
    }
    c.rect([0.49, 0.2, 0.515, 0.52], BLACK);
    c.rect([0.49, 0.485, 0.72, 0.52], BLACK);
    c
}

fn ball(rng: &mut Stream) -> Canvas {
    let mut c = Canvas::new(256, [214, 52, 44]);
    for k in 0..8 {
        let x = k as f32 / 8.0;
        if k % 2 == 0 {
            c.rect([x, 0.0, x + 0.125, 1.0], [240, 238, 226]);
        }
        c.disc([x + 0.06, 0.5], 0.04, [30, 60, 130]);
    }
    c.rect([0.0, 0.33, 1.0, 0.36], BLACK);
    c.rect([0.0, 0.64, 1.0, 0.67], BLACK);
    c.mottle([64, 64], 6.0, rng);
    c
}

/// Six rows of keys, for a face three times as wide as high.
pub fn keys(rng: &mut Stream) -> Canvas {
    let mut c = Canvas::new(256, [40, 40, 44]);
    for row in 0..6 {
        let mut x: f32 = 0.02;
        while x < 0.95 {
            let wide = if rng.random_bool(0.12) { 0.1 } else { 0.047 };
            let y = 0.04 + row as f32 * 0.157;
            let key = [x, y, (x + wide).min(0.98), y + 0.135];
            c.rect(key, [206, 206, 200]);
            c.rect([x + 0.012, y + 0.03, x + 0.026, y + 0.08], BLACK);
            x += wide + 0.011;
        }
    }
    c
}

/// A whiteboard after a meeting.
pub fn board(rng: &mut Stream) -> Canvas {
    let mut c = Canvas::new(512, [248, 248, 248]);
    let pens = [[26, 44, 130], [176, 26, 30], BLACK, [18, 110, 60]];
    for _ in 0..7 {
        let [x, y, _, _] = any_area(rng, 0.3, 0.31);
        let pen = pens[rng.random_range(0..pens.len())];
        c.words([x, y, x + 0.3, y + 0.16], 0.026, pen, rng);
    }
    for _ in 0..6 {
        let pen = pens[rng.random_range(0..pens.len())];
        let field = any_area(rng, 0.08, 0.2);
        c.frame(field, 0.007, pen);
    }
    c.frame([0.0, 0.0, 1.0, 1.0], 0.015, [128, 130, 134]);
    c
}

/// A printed sheet: heading, columns of text, a figure with bars or a photograph.
pub fn page(rng: &mut Stream) -> Canvas {
    let mut c = Canvas::new(256, WHITE);
    c.words([0.1, 0.06, 0.9, 0.13], 0.045, BLACK, rng);
    c.words([0.1, 0.18, 0.9, 0.45], 0.026, [40, 40, 44], rng);
    let figure = [0.12, 0.47, 0.5, 0.72];
    c.rect(figure, any_colour(rng));
    for k in 0..5 {
        let x = 0.15 + 0.07 * k as f32;
        c.rect([x, rng.random_range(0.49..0.68), x + 0.045, 0.72], any_colour(rng));
    }
    c.words([0.55, 0.47, 0.9, 0.72], 0.026, [40, 40, 44], rng);
    c.words([0.1, 0.76, 0.9, 0.95], 0.026, [40, 40, 44], rng);
    c
}

/// Large title, a picture of coloured shapes, a caption.
pub fn poster(rng: &mut Stream) -> Canvas {
    let background = any_colour(rng);
    let text = readable_on(background);
    let mut c = Canvas::new(512, background);
    c.words([0.06, 0.05, 0.94, 0.2], 0.07, text, rng);
    c.rect([0.06, 0.22, 0.94, 0.78], any_colour(rng));
    for _ in 0..60 {
        let [x0, y0, x1, y1] = any_area(rng, 0.02, 0.2).map(|v| 0.07 + 0.86 * v);
        let (y0, y1) = (0.22 + 0.56 * y0, 0.22 + 0.56 * y1);
        let colour = any_colour(rng);
        if rng.random_bool(0.5) {
            c.rect([x0, y0, x1, y1], colour);
        } else {
            c.disc([0.5 * (x0 + x1), 0.5 * (y0 + y1)], 0.3 * (y1 - y0), colour);
        }
    }
    c.words([0.06, 0.81, 0.94, 0.95], 0.025, text, rng);
    c.frame([0.0, 0.0, 1.0, 1.0], 0.012, text);
    c
}

/// A row of books, their titles along the spines.
pub fn spines(rng: &mut Stream) -> Canvas {
    let mut c = Canvas::new(512, [30, 26, 24]);
    let mut x: f32 = 0.0;
    while x < 0.98 {
        let right = (x + rng.random_range(0.022..0.065)).min(1.0);
        let (top, background) = (rng.random_range(0.02..0.22), any_colour(rng));
        let text = readable_on(background);
        c.rect([x + 0.002, top, right - 0.002, 1.0], background);
        let (low, high) = (rng.random_range(0.25..0.35), rng.random_range(0.6..0.8));
        c.words([x + 0.008, low, right - 0.004, high], 0.016, text, rng);
        for band in [top + 0.06, 0.88] {
            c.rect([x + 0.002, band, right - 0.002, band + 0.02], text);
        }
        x = right;
    }
    c
}

pub fn screen(rng: &mut Stream) -> Canvas {
    let mut c = Canvas::new(512, [32, 72, 120]);
    c.mottle([5, 5], 20.0, rng);
    for (k, window) in [[0.04, 0.08, 0.6, 0.72], [0.42, 0.22, 0.96, 0.9]].into_iter().enumerate() {
        let [x0, y0, x1, y1] = window;
        let background = if k == 0 { WHITE } else { [28, 30, 36] };
        c.rect(window, background);
        c.rect([x0, y0, x1, y0 + 0.05], [196, 200, 206]);
        c.words([x0 + 0.03, y0 + 0.01, x0 + 0.3, y0 + 0.05], 0.024, BLACK, rng);
        c.words([x0 + 0.02, y0 + 0.08, x1 - 0.02, y1 - 0.02], 0.024, readable_on(background), rng);
    }
    c.rect([0.0, 0.95, 1.0, 1.0], [24, 24, 28]);
    (0..9).for_each(|k| {
        let x = 0.01 + 0.05 * k as f32;
        c.rect([x, 0.96, x + 0.03, 0.99], any_colour(rng));
    });
    c.frame([0.0, 0.0, 1.0, 1.0], 0.02, BLACK);
    c
}

pub fn carton(rng: &mut Stream) -> Canvas {
    let mut c = Canvas::new(256, [178, 138, 92]);
    c.mottle([2, 40], 8.0, rng);
    c.mottle([40, 40], 7.0, rng);
    c.rect([0.0, 0.44, 1.0, 0.54], [206, 178, 132]);
    let [x, y, _, _] = any_area(rng, 0.4, 0.41);
    let label = [x, y, x + 0.36, y + 0.3];
    c.rect(label, WHITE);
    c.words([x + 0.03, y + 0.03, x + 0.34, y + 0.28], 0.035, BLACK, rng);
    c.words([0.62, 0.78, 0.96, 0.95], 0.07, [70, 44, 26], rng);
    c
}

/// Print around a cup or a tin.
pub fn label(rng: &mut Stream) -> Canvas {
    let background = any_colour(rng);
    let mut c = Canvas::new(256, background);
    c.rect([0.0, 0.12, 1.0, 0.2], readable_on(background));
    c.words([0.05, 0.3, 0.95, 0.6], 0.1, readable_on(background), rng);
    for k in 0..8 {
        c.disc([0.06 + 0.125 * k as f32, 0.78], 0.045, any_colour(rng));
    }
    c
}
