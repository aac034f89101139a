//! What a surface looks like: a texture, how it lies there, and its answer to infrared.

use super::texture::fraction;

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

/// One face's look.
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
const MATT: f32 = 0.6;

impl Material {
    pub const fn new(texture: usize, mapping: Mapping) -> Self {
        Material { texture, mapping, tint: [1.0; 3], emission: 0.0, albedo: MATT }
    }

    #[must_use]
    pub const fn tinted(self, tint: [f32; 3]) -> Self {
        Material { tint, ..self }
    }

    #[must_use]
    pub const fn emitting(self, emission: f32) -> Self {
        Material { emission, ..self }
    }

    #[must_use]
    pub const fn with_albedo(self, albedo: f32) -> Self {
        Material { albedo, ..self }
    }

    /// Texture coordinates (in pictures) of a place on a face of this `size`, m, and the pictures
    /// per square metre there.
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
