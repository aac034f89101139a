//! Colour images: 8-bit PNG, written quickly.

use png::{BitDepth, ColorType, Compression};

use crate::error::{Error, Result};

/// Red, green, blue, row-major, as the bytes of an 8-bit PNG, at the quickest compression.
///
/// # Errors
/// When there are not three bytes a pixel.
pub fn encode_rgb(width: usize, height: usize, rgb: &[u8]) -> Result<Vec<u8>> {
    let failed = |e: png::EncodingError| Error::Drawing { what: "colour PNG", why: e.to_string() };
    // A picture of an office shrinks to two thirds or less.
    let mut bytes = Vec::with_capacity(rgb.len());
    let mut encoder = png::Encoder::new(&mut bytes, width as u32, height as u32);
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(Compression::Fast);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(rgb).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
}
