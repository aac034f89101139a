//! Images of a film, written quickly: 8-bit colour and 16-bit depth.

use png::{BitDepth, ColorType, Compression};

use crate::error::{Error, Result};
use crate::frame::Frame;

/// Red, green, blue, row-major, as the bytes of an 8-bit PNG, at the quickest compression.
///
/// # Errors
/// When there are not three bytes a pixel.
pub fn encode_rgb(width: usize, height: usize, rgb: &[u8]) -> Result<Vec<u8>> {
    encode([width, height], ColorType::Rgb, BitDepth::Eight, rgb)
}

/// A depth frame as the bytes of a 16-bit grey PNG, at the quickest compression: a tenth of the
/// time of [`super::encode_png16`].
///
/// # Errors
/// When the frame's size does not match its words.
pub fn encode_png16_quickly(frame: &Frame) -> Result<Vec<u8>> {
    let data: Vec<u8> = frame.raw.iter().flat_map(|w| w.to_be_bytes()).collect();
    encode([frame.width, frame.height], ColorType::Grayscale, BitDepth::Sixteen, &data)
}

fn encode(
    [width, height]: [usize; 2],
    kind: ColorType,
    depth: BitDepth,
    data: &[u8],
) -> Result<Vec<u8>> {
    let failed = |e: png::EncodingError| Error::Drawing { what: "PNG", why: e.to_string() };
    // What a sensor sees shrinks to less than it was, if only by its filtered rows.
    let mut bytes = Vec::with_capacity(data.len());
    let mut encoder = png::Encoder::new(&mut bytes, width as u32, height as u32);
    encoder.set_color(kind);
    encoder.set_depth(depth);
    encoder.set_compression(Compression::Fast);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(data).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
}
