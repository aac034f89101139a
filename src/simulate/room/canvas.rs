//! Drawing of textures: rectangles, discs, mottle and lines of print, in fractions of the picture.

use rand::Rng;

use super::texture::Texture;
use crate::rng::Stream;

pub type Colour = [u8; 3];

/// A square picture being drawn. Coordinates are fractions of its side, 0 to 1, x right, y down.
pub struct Canvas {
    size: usize,
    texels: Vec<Colour>,
}

/// x0, y0, x1, y1.
pub type Area = [f32; 4];

/// A printed letter: three by five marks, one column and two rows of space.
const GLYPH: (usize, usize) = (3, 5);
const GLYPH_CELL: (f32, f32) = (4.0, 7.0);
/// Line pitch over the letters' own cell.
const LEADING: f32 = 1.2;

pub const BLACK: Colour = [22, 22, 26];
pub const WHITE: Colour = [246, 246, 242];
/// Print colours.
#[rustfmt::skip]
const STRONG: [Colour; 10] = [
    [178, 34, 40], [24, 78, 142], [30, 116, 66], [232, 186, 40], [222, 106, 34],
    [88, 44, 120], [20, 132, 142], [122, 72, 40], [60, 62, 70], [236, 230, 214],
];

impl Canvas {
    pub fn new(size: usize, colour: Colour) -> Self {
        Canvas { size, texels: vec![colour; size * size] }
    }

    pub fn finish(self) -> Texture {
        Texture::new(self.size, self.texels)
    }

    fn span(&self, low: f32, high: f32) -> std::ops::Range<usize> {
        let texel = |v: f32| (v * self.size as f32).round().clamp(0.0, self.size as f32) as usize;
        texel(low)..texel(high)
    }

    pub fn rect(&mut self, [x0, y0, x1, y1]: Area, colour: Colour) {
        for y in self.span(y0, y1) {
            for x in self.span(x0, x1) {
                self.texels[y * self.size + x] = colour;
            }
        }
    }

    /// Draws an unfilled frame, its lines `line` wide.
    pub fn frame(&mut self, [x0, y0, x1, y1]: Area, line: f32, colour: Colour) {
        self.rect([x0, y0, x1, y0 + line], colour);
        self.rect([x0, y1 - line, x1, y1], colour);
        self.rect([x0, y0, x0 + line, y1], colour);
        self.rect([x1 - line, y0, x1, y1], colour);
    }

    pub fn disc(&mut self, [cx, cy]: [f32; 2], radius: f32, colour: Colour) {
        for y in self.span(cy - radius, cy + radius) {
            for x in self.span(cx - radius, cx + radius) {
                let place = |v: usize, c: f32| (v as f32 + 0.5) / self.size as f32 - c;
                if place(x, cx).hypot(place(y, cy)) < radius {
                    self.texels[y * self.size + x] = colour;
                }
            }
        }
    }

    /// Adds smooth random brightness, `cells` patches across and down, up to `depth` grey levels.
    pub fn mottle(&mut self, cells: [usize; 2], depth: f32, rng: &mut Stream) {
        let lattice: Vec<f32> =
            (0..cells[0] * cells[1]).map(|_| rng.random_range(-depth..depth)).collect();
        let node = |i: usize, j: usize| lattice[(j % cells[1]) * cells[0] + i % cells[0]];
        for (k, texel) in self.texels.iter_mut().enumerate() {
            let x = (k % self.size) as f32 / self.size as f32 * cells[0] as f32;
            let y = (k / self.size) as f32 / self.size as f32 * cells[1] as f32;
            let (i, j, s, t) = (x as usize, y as usize, x.fract(), y.fract());
            let above = node(i, j) * (1.0 - s) + node(i + 1, j) * s;
            let below = node(i, j + 1) * (1.0 - s) + node(i + 1, j + 1) * s;
            let add = above * (1.0 - t) + below * t;
            *texel = texel.map(|c| (f32::from(c) + add).clamp(0.0, 255.0) as u8);
        }
    }

    /// Draws `count` flecks of `side`, each in one of the colours.
    pub fn flecks(&mut self, count: usize, side: f32, colours: &[Colour], rng: &mut Stream) {
        for _ in 0..count {
            let (x, y): (f32, f32) = (rng.random(), rng.random());
            let colour = colours[rng.random_range(0..colours.len())];
            self.rect([x, y, x + side * rng.random_range(0.5..1.5), y + side], colour);
        }
    }

    /// Draws lines of words in an area: letters `height` high, ragged at the right, some lines short.
    pub fn words(&mut self, [x0, y0, x1, y1]: Area, height: f32, colour: Colour, rng: &mut Stream) {
        let mark = height / GLYPH.1 as f32;
        let (advance, leading) = (GLYPH_CELL.0 * mark, GLYPH_CELL.1 * mark * LEADING);
        let mut y = y0;
        while y + height <= y1 {
            let short: f32 = if rng.random_bool(0.15) { 0.4 } else { rng.random_range(0.85..1.0) };
            let end = x0 + (x1 - x0) * short;
            let mut x = x0;
            while x + advance <= end {
                for _ in 0..rng.random_range(2..9) {
                    if x + advance <= end {
                        self.glyph([x, y], mark, colour, rng);
                    }
                    x += advance;
                }
                x += advance;
            }
            y += leading;
        }
    }

    fn glyph(&mut self, [x, y]: [f32; 2], mark: f32, colour: Colour, rng: &mut Stream) {
        for j in 0..GLYPH.1 {
            for i in 0..GLYPH.0 {
                if rng.random_bool(0.6) {
                    let (left, top) = (x + i as f32 * mark, y + j as f32 * mark);
                    self.rect([left, top, left + mark, top + mark], colour);
                }
            }
        }
    }
}

pub fn any_colour(rng: &mut Stream) -> Colour {
    STRONG[rng.random_range(0..STRONG.len())]
}

/// Black or white, whichever is more legible on this background.
pub fn readable_on(background: Colour) -> Colour {
    let grey: u16 = background.iter().map(|c| u16::from(*c)).sum::<u16>() / 3;
    if grey > 125 { BLACK } else { WHITE }
}

/// A random rectangle in the picture, its sides between `min` and `max`.
pub fn any_area(rng: &mut Stream, min: f32, max: f32) -> Area {
    let (w, h) = (rng.random_range(min..max), rng.random_range(min..max));
    let (x, y) = (rng.random_range(0.0..1.0 - w), rng.random_range(0.0..1.0 - h));
    [x, y, x + w, y + h]
}
