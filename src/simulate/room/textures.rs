//! The office's textures, drawn by the seed: what things are made of, and what is printed on them
//! or shown by screens.
//!
//! Each has sharp structure at several scales, so that corners are found from near and from afar.

use rand::Rng;

use super::canvas::{BLACK, Canvas, WHITE};
use super::printed::{board, carton, keys, label, page, poster, screen, spines};
use super::texture::Texture;
use crate::rng::{Seed, Stream};

/// Indices into the room's textures, in the order of [`SINGLE`].
pub const PLAIN: usize = 0;
pub const PLASTER: usize = 1;
pub const CEILING: usize = 2;
pub const CARPET: usize = 3;
pub const WOOD: usize = 4;
pub const CLOTH: usize = 5;
pub const KEYS: usize = 6;
pub const WINDOW: usize = 7;
pub const CLOCK: usize = 8;
pub const BALL: usize = 9;
pub const BOARD: usize = 10;
/// Of the first of each series, in the order of [`SERIES`].
pub const PAGES: usize = 11;
pub const POSTERS: usize = 17;
pub const SPINES: usize = 23;
pub const SCREENS: usize = 29;
pub const CARTONS: usize = 32;
pub const LABELS: usize = 35;

type Draw = fn(&mut Stream) -> Canvas;

/// What there is once: its name and how it is drawn.
const SINGLE: [(&str, Draw); 11] = [
    ("plain", plain),
    ("plaster", plaster),
    ("ceiling", ceiling),
    ("carpet", carpet),
    ("wood", wood),
    ("cloth", cloth),
    ("keys", keys),
    ("window", window),
    ("clock", clock),
    ("ball", ball),
    ("board", board),
];

/// What there are several of, each different.
const SERIES: [(&str, usize, Draw); 6] = [
    ("page", 6, page),
    ("poster", 6, poster),
    ("spines", 6, spines),
    ("screen", 3, screen),
    ("carton", 3, carton),
    ("label", 3, label),
];

/// All of them, each from a stream of its own.
pub fn draw(seed: Seed) -> Vec<Texture> {
    let one =
        |name: &str, draw: Draw| draw(&mut seed.stream(&format!("room/print/{name}"))).finish();
    let single = SINGLE.iter().map(|(name, draw)| one(name, *draw));
    let series = SERIES.iter().flat_map(|(name, count, draw)| {
        (0..*count).map(move |k| one(&format!("{name}/{k}"), *draw))
    });
    single.chain(series).collect()
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

/// Panels round a ball.
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
