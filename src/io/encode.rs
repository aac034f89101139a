//! Images as bytes: 16-bit depth as PNG or as fakenect's PGM, 8-bit colour.

use png::{BitDepth, ColorType, Compression};

use crate::error::{Error, Result};
use crate::frame::Frame;

/// A depth frame as the bytes of a 16-bit grey PNG.
///
/// # Errors
/// When the frame's size does not match its raw values.
pub fn encode_png16(frame: &Frame) -> Result<Vec<u8>> {
    encode_depth(frame, Compression::Balanced)
}

/// As [`encode_png16`], in a tenth of the time and some more bytes.
///
/// # Errors
/// As [`encode_png16`].
pub fn encode_png16_quickly(frame: &Frame) -> Result<Vec<u8>> {
    encode_depth(frame, Compression::Fast)
}

/// Red, green, blue, row-major, as the bytes of an 8-bit PNG, at the quickest compression.
///
/// # Errors
/// When there are not three bytes a pixel.
pub fn encode_rgb(width: usize, height: usize, rgb: &[u8]) -> Result<Vec<u8>> {
    encode([width, height], (ColorType::Rgb, BitDepth::Eight), Compression::Fast, rgb)
}

/// A depth frame as fakenect writes it: a PGM whose values are little-endian.
pub fn encode_pgm16(frame: &Frame) -> Vec<u8> {
    let mut bytes = format!("P5 {} {} 65535\n", frame.width, frame.height).into_bytes();
    bytes.extend(frame.raw.iter().flat_map(|w| w.to_le_bytes()));
    bytes
}

fn encode_depth(frame: &Frame, compression: Compression) -> Result<Vec<u8>> {
    let data: Vec<u8> = frame.raw.iter().flat_map(|w| w.to_be_bytes()).collect();
    let kind = (ColorType::Grayscale, BitDepth::Sixteen);
    encode([frame.width, frame.height], kind, compression, &data)
}

fn encode(
    [width, height]: [usize; 2],
    (colour, depth): (ColorType, BitDepth),
    compression: Compression,
    data: &[u8],
) -> Result<Vec<u8>> {
    let failed = |e: png::EncodingError| Error::Drawing { what: "PNG", why: e.to_string() };
    // What a sensor sees shrinks to less than it was, if only by its filtered rows.
    let mut bytes = Vec::with_capacity(data.len());
    let mut encoder = png::Encoder::new(&mut bytes, width as u32, height as u32);
    encoder.set_color(colour);
    encoder.set_depth(depth);
    encoder.set_compression(compression);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(data).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
}
