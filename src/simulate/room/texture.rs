//! Appearance of surfaces: mip-mapped textures, so that distant ones blur instead of flickering, their
//! mapping onto faces, and the infrared reflectance.

/// A square, repeating texture with its mip levels down to one texel.
#[derive(Debug, Clone, PartialEq)]
pub struct Texture {
    levels: Vec<Level>,
}

#[derive(Debug, Clone, PartialEq)]
struct Level {
    /// Texels per side, a power of two.
    size: usize,
    /// Red, green, blue and padding: four bytes are one load.
    texels: Vec<[u8; 4]>,
}

impl Texture {
    /// A texture of `size` by `size` texels, row-major.
    ///
    /// # Panics
    /// If `size` is not a power of two or does not match the texels.
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

    /// Colour, 0 to 255, at `uv` (in units of the texture; repeats), where a pixel spans 2^`lod` texels.
    #[inline]
    pub fn at(&self, uv: [f32; 2], lod: f32) -> [f32; 3] {
        let uv = uv.map(fraction);
        let top = (self.levels.len() - 1) as f32;
        let lod = lod.clamp(0.0, top);
        let fine = lod as usize;
        // Half of all samples read one level only; the blend between two stays continuous.
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

    /// Bilinear interpolation between the four nearest texel centres; `uv` in [0, 1].
    #[inline]
    fn at(&self, uv: [f32; 2]) -> [f32; 4] {
        // One more period keeps the numbers positive; the mask removes it again.
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

/// Fractional part, 0 to 1. (`floor` is a function call on baseline x86-64.)
#[inline]
pub fn fraction(v: f32) -> f32 {
    let rest = v - v as i32 as f32;
    if rest < 0.0 { rest + 1.0 } else { rest }
}

/// log2, linear between the powers of two: at most 0.09 too low, a tenth of a level.
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
    /// Repeated with this period, m.
    Repeat(f32),
    /// In square tiles of this side, m, each cut from another place of the texture, which is `of_m` wide:
    /// no two tiles look alike, so none can be mistaken for its neighbour.
    Tiles { side_m: f32, of_m: f32 },
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// Index into the room's textures.
    pub texture: usize,
    pub mapping: Mapping,
    /// Factor on red, green and blue.
    pub tint: [f32; 3],
    /// Share of the colour that is emitted (screens, lamps), 0 to 1.
    pub emission: f32,
    /// Infrared reflectance, 0 to 1.
    pub albedo: f32,
}

/// Matt paint, paper and wood at 830 nm.
pub const MATT: f32 = 0.6;

impl Material {
    pub const fn new(texture: usize, mapping: Mapping) -> Self {
        Material { texture, mapping, tint: [1.0; 3], emission: 0.0, albedo: MATT }
    }

    /// Texture coordinates (in units of the texture) of a place on a face of this `size`, and textures per
    /// m^2.
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

/// Two numbers in [0, 1) per cell without a visible pattern: Roberts' R2 sequence, the fractional parts of
/// multiples of the plastic number's powers. Cell numbers are whole.
fn scatter(cell: [f32; 2]) -> [f32; 2] {
    const R2: [f32; 2] = [0.754_877_7, 0.569_840_3];
    // A difference of floats, whole only up to rounding, hence rounded (a room has +-100 tiles).
    let [i, j] = cell.map(|c| (c + 1000.5) as i32);
    let index = (57 * i + 131 * j) as f32;
    R2.map(|r| fraction(index * r))
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
