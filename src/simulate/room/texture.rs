//! What a surface looks like: a picture with its smaller copies, so that far texture blurs and does
//! not flicker, how it lies there, its answer to infrared, and how it is drawn.

use rand::Rng;

use crate::rng::Stream;

/// A square picture that repeats, and its halvings down to one texel.
#[derive(Debug, Clone, PartialEq)]
pub struct Texture {
    levels: Vec<Level>,
}

#[derive(Debug, Clone, PartialEq)]
struct Level {
    /// Texels a side, a power of two.
    size: usize,
    /// Red, green, blue and nothing: four bytes are one load.
    texels: Vec<[u8; 4]>,
}

impl Texture {
    /// Of `size` by `size` texels, row by row.
    ///
    /// # Panics
    /// When `size` is no power of two or does not fit the texels.
    pub fn new(size: usize, texels: Vec<[u8; 3]>) -> Self {
        assert!(size.is_power_of_two() && texels.len() == size * size, "a square picture");
        let padded = texels.iter().map(|&[r, g, b]| [r, g, b, 0]).collect();
        let mut levels = vec![Level { size, texels: padded }];
        while levels[levels.len() - 1].size > 1 {
            levels.push(levels[levels.len() - 1].halved());
        }
        Texture { levels }
    }

    pub fn size(&self) -> usize {
        self.levels[0].size
    }

    /// Colour, 0 to 255, at `uv` (in pictures; repeats), where a pixel covers 2^`lod` texels.
    #[inline]
    pub fn at(&self, uv: [f32; 2], lod: f32) -> [f32; 3] {
        let uv = uv.map(fraction);
        let top = (self.levels.len() - 1) as f32;
        let lod = lod.clamp(0.0, top);
        let fine = lod as usize;
        // Half of all places see one level only; the blend between two stays continuous.
        let share = (2.0 * (lod - fine as f32) - 0.5).clamp(0.0, 1.0);
        let one = |level: usize| {
            let [r, g, b, _] = self.levels[level].at(uv);
            [r, g, b]
        };
        if share == 0.0 || share == 1.0 {
            return one(fine + share as usize);
        }
        let (near, far) = (self.levels[fine].at(uv), self.levels[fine + 1].at(uv));
        std::array::from_fn(|c| near[c] + share * (far[c] - near[c]))
    }
}

impl Level {
    fn halved(&self) -> Level {
        let size = self.size / 2;
        let mut texels = Vec::with_capacity(size * size);
        for y in 0..size {
            for x in 0..size {
                let four = [(0, 0), (1, 0), (0, 1), (1, 1)]
                    .map(|(i, j)| self.texels[(2 * y + j) * self.size + 2 * x + i]);
                let mean = |c: usize| four.iter().map(|t| u16::from(t[c])).sum::<u16>() + 2;
                texels.push([0, 1, 2, 3].map(|c| (mean(c) / 4) as u8));
            }
        }
        Level { size, texels }
    }

    /// Between the four nearest texel centres; `uv` in [0, 1].
    #[inline]
    fn at(&self, uv: [f32; 2]) -> [f32; 4] {
        // A whole picture more keeps the numbers positive, and the mask takes it off again.
        let [x, y] = uv.map(|v| (v + 1.0) * self.size as f32 - 0.5);
        let (left, up) = (x as usize, y as usize);
        let (s, t) = (x - left as f32, y - up as f32);
        let mask = self.size - 1;
        let (x0, x1) = (left & mask, (left + 1) & mask);
        let (y0, y1) = ((up & mask) * self.size, ((up + 1) & mask) * self.size);
        let corner = |x: usize, y: usize| self.texels[y + x].map(f32::from);
        let (a, b, c, d) = (corner(x0, y0), corner(x1, y0), corner(x0, y1), corner(x1, y1));
        std::array::from_fn(|k| {
            let above = a[k] + s * (b[k] - a[k]);
            let below = c[k] + s * (d[k] - c[k]);
            above + t * (below - above)
        })
    }
}

/// The part of a number after the point, 0 to 1. (`floor` is a call on a plain x86-64.)
#[inline]
pub fn fraction(v: f32) -> f32 {
    let rest = v - v as i32 as f32;
    if rest < 0.0 { rest + 1.0 } else { rest }
}

/// log2, straight between the powers of two: at most 0.09 too low, a tenth of a level.
#[inline]
pub fn rough_log2(v: f32) -> f32 {
    const ONE: f32 = 127.0;
    v.to_bits() as f32 / (1u32 << 23) as f32 - ONE
}

/// How a texture lies on a face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mapping {
    /// Once over the whole face.
    Fit,
    /// Again every so many metres.
    Repeat(f32),
    /// In square tiles of this side, m, each cut from another place of the texture, which is
    /// `of_m` wide: no two tiles look alike, and nothing can be mistaken for its neighbour.
    Tiles { side_m: f32, of_m: f32 },
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// Index into the room's textures.
    pub texture: usize,
    pub mapping: Mapping,
    /// Factor on red, green and blue.
    pub tint: [f32; 3],
    /// Share of the colour that shines by itself (screens, lamps), 0 to 1.
    pub emission: f32,
    /// Share of infrared light given back, 0 to 1.
    pub albedo: f32,
}

/// Matt paint, paper and wood at 830 nm.
pub const MATT: f32 = 0.6;

impl Material {
    pub const fn new(texture: usize, mapping: Mapping) -> Self {
        Material { texture, mapping, tint: [1.0; 3], emission: 0.0, albedo: MATT }
    }

    /// Texture coordinates (in pictures) of a place on a face of this `size`, and pictures per m^2.
    #[inline]
    pub fn coordinates(&self, place: [f32; 2], size: [f32; 2]) -> ([f32; 2], f32) {
        match self.mapping {
            Mapping::Fit => {
                let scale = size.map(|e| 1.0 / e);
                (std::array::from_fn(|k| place[k] * scale[k] + 0.5), scale[0] * scale[1])
            }
            Mapping::Repeat(metres) => {
                let scale = 1.0 / metres;
                (place.map(|p| p * scale), scale * scale)
            }
            Mapping::Tiles { side_m, of_m } => {
                let tiles = place.map(|p| p / side_m);
                let within = tiles.map(fraction);
                let cut = scatter([tiles[0] - within[0], tiles[1] - within[1]]);
                let scale = 1.0 / of_m;
                let uv = std::array::from_fn(|k| within[k] * side_m * scale + cut[k]);
                (uv, scale * scale)
            }
        }
    }
}

/// Two numbers in [0, 1) without a visible pattern: the fractions of multiples of the plastic
/// number's powers (Roberts' R2 sequence), by the cell, whose numbers are whole.
fn scatter(cell: [f32; 2]) -> [f32; 2] {
    const R2: [f32; 2] = [0.754_877_7, 0.569_840_3];
    // A difference of floats: whole only to rounding, so made whole (a room has +-100 tiles).
    let [i, j] = cell.map(|c| (c + 1000.5) as i32);
    let index = (57 * i + 131 * j) as f32;
    R2.map(|r| fraction(index * r))
}

pub type Colour = [u8; 3];

/// A square picture in the making. Places are shares of its side, 0 to 1, x right, y down.
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
/// What things are printed in.
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

    /// An empty frame, `line` wide.
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

    /// Smooth random light and dark, `cells` patches across and down, up to `depth` grey levels.
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

    /// `count` flecks of `side`, each of one of the colours.
    pub fn flecks(&mut self, count: usize, side: f32, colours: &[Colour], rng: &mut Stream) {
        for _ in 0..count {
            let (x, y): (f32, f32) = (rng.random(), rng.random());
            let colour = colours[rng.random_range(0..colours.len())];
            self.rect([x, y, x + side * rng.random_range(0.5..1.5), y + side], colour);
        }
    }

    /// Lines of words in an area: letters `height` high, ragged at the right, some lines short.
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

/// Black or white, whichever is read better on this background.
pub fn readable_on(background: Colour) -> Colour {
    let grey: u16 = background.iter().map(|c| u16::from(*c)).sum::<u16>() / 3;
    if grey > 125 { BLACK } else { WHITE }
}

/// A rectangle anywhere in the picture, its sides between these.
pub fn any_area(rng: &mut Stream, min: f32, max: f32) -> Area {
    let (w, h) = (rng.random_range(min..max), rng.random_range(min..max));
    let (x, y) = (rng.random_range(0.0..1.0 - w), rng.random_range(0.0..1.0 - h));
    [x, y, x + w, y + h]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_level_is_the_mean_and_texel_centres_are_exact() {
        let texels: Vec<[u8; 3]> = (0..16).map(|i| [10 * i as u8, 3, 250]).collect();
        let texture = Texture::new(4, texels.clone());
        assert!((texture.at([0.3, 0.9], 9.0)[0] - 75.0).abs() <= 1.0);
        let at = |x: usize, y: usize| [(x as f32 + 0.5) / 4.0, (y as f32 + 0.5) / 4.0];
        assert_eq!(texture.at(at(2, 1), 0.0)[0], f32::from(texels[6][0]));
        assert_eq!(texture.at([at(2, 1)[0] + 5.0, at(2, 1)[1] - 3.0], 0.0)[0], 60.0, "repeats");
    }
}
