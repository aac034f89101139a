//! Reading and writing depth images, and writing colour images: PNG, and PGM as fakenect writes it.

use std::io::Cursor;
use std::path::Path;

use png::{BitDepth, ColorType, Compression};
use sha2::{Digest, Sha256};

use crate::camera::usable_size;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::read::{open, read_depth_image, read_image};
use crate::view::{FrameRef, Within};

/// Reads frames of one fixed size and hashes all the bytes it reads.
#[derive(Debug, Clone)]
pub struct FrameSource {
    width: usize,
    height: usize,
    hash: Sha256,
}

const REMEDY_DEPTH: &str = "depth must be a 16-bit single-channel PNG of the recording's size";

impl FrameSource {
    /// Source for frames of this size, px.
    pub fn new(width: usize, height: usize) -> Self {
        FrameSource { width, height, hash: Sha256::new() }
    }

    /// Reads a frame of a recording, from its own file or a container.
    /// Fails if the file is missing, truncated, or of another kind (8 bit, colour) or size.
    pub fn frame(&mut self, frame: &FrameRef) -> Result<Frame> {
        read_sized(frame, [self.width, self.height], Some(&mut self.hash))
    }

    /// Reads one image file. Fails as [`FrameSource::frame`] does.
    pub fn read(&mut self, path: &Path) -> Result<Frame> {
        self.frame(&FrameRef::file(0.0, path.into()))
    }

    /// SHA-256 of all bytes read so far, in the order they were read.
    pub fn digest(self) -> [u8; 32] {
        self.hash.finalize().into()
    }
}

/// Reads one depth frame of this size, px, without hashing.
pub(crate) fn read_depth(frame: &FrameRef, width: usize, height: usize) -> Result<Frame> {
    read_sized(frame, [width, height], None)
}

/// Reads one depth frame of this size, px, and hashes the bytes that it is decoded from.
fn read_sized(
    frame: &FrameRef,
    [width, height]: [usize; 2],
    hash: Option<&mut Sha256>,
) -> Result<Frame> {
    let (path, mut place) = (&frame.path, String::new());
    let image = if let Some(Within { store, index }) = &frame.within {
        let image = store.frame(*index)?;
        let words = || image.raw.iter().flat_map(|w| w.to_le_bytes()).collect::<Vec<u8>>();
        hash.into_iter().for_each(|h| h.update(words()));
        place = format!("{}: ", store.place(*index));
        image
    } else {
        let bytes = read_depth_image(path, [width, height])?;
        hash.into_iter().for_each(|h| h.update(&bytes));
        decode(path, &bytes)?
    };
    let Frame { width: w, height: h, .. } = image;
    if [w, h] == [width, height] {
        return Ok(image);
    }
    Err(Error::recording(
        path,
        format!("{place}the image is {w} x {h} px, the recording's are {width} x {height}"),
        "take the image out, or correct width and height in recording.json",
    ))
}

/// Width and height of a frame.
pub(crate) fn size_of(frame: &FrameRef) -> Result<(usize, usize)> {
    let frame = read_any(frame)?;
    Ok((frame.width, frame.height))
}

/// Reads a depth frame of any size.
pub(super) fn read_any(frame: &FrameRef) -> Result<Frame> {
    if let Some(within) = &frame.within {
        return within.store.frame(within.index);
    }
    let path = &frame.path;
    let bytes = read_image(path)?;
    decode(path, &bytes)
}

fn decode(path: &Path, bytes: &[u8]) -> Result<Frame> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("pgm")) {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if !name.starts_with("d-") {
            let what =
                "a PGM that is not a fakenect dump's d-*.pgm, whose bytes are in another order";
            return Err(Error::recording(path, what, "convert it to a 16-bit grey PNG"));
        }
        decode_fakenect_pgm(path, bytes)
    } else {
        png16(bytes).map_err(|(what, remedy)| Error::recording(path, what, remedy))
    }
}

/// Decodes a 16-bit grey PNG. The error is what is wrong and what to do.
pub(super) fn png16(bytes: &[u8]) -> Result<Frame, (String, &'static str)> {
    let damaged = |e: png::DecodingError| {
        (format!("not a whole PNG ({e})"), "the file is damaged; record it again")
    };
    let mut reader = png::Decoder::new(Cursor::new(bytes)).read_info().map_err(damaged)?;
    let info = reader.info();
    let (width, height) = (info.width as usize, info.height as usize);
    if !usable_size(width, height) {
        // Do not trust the header with an allocation before the pixels are there.
        return Err((format!("{width} x {height} px PNG"), REMEDY_DEPTH));
    }
    if info.bit_depth != BitDepth::Sixteen || info.color_type != ColorType::Grayscale {
        let what = format!("{} bit {:?} PNG", info.bit_depth as u8, info.color_type);
        return Err((what, REMEDY_DEPTH));
    }
    let size = reader.output_buffer_size().unwrap_or(0);
    let mut buffer = vec![0; size];
    reader.next_frame(&mut buffer).map_err(damaged)?;
    let raw = buffer.chunks_exact(2).map(|b| u16::from_be_bytes([b[0], b[1]])).collect();
    Ok(Frame { width, height, raw })
}

/// Decodes `P5 w h 65535` with little-endian values, contrary to the PGM standard:
/// fakenect dumps its memory as is.
fn decode_fakenect_pgm(path: &Path, bytes: &[u8]) -> Result<Frame> {
    let bad =
        |what: &str| Error::recording(path, what, "expected a fakenect d-*.pgm: P5, size, 65535");
    let (header, data) = pgm_header(bytes).ok_or_else(|| bad("no P5 header"))?;
    let [width, height, top] = header;
    if top != 65535 {
        return Err(bad("the greatest value is not 65535"));
    }
    if data.len() < 2 * width * height {
        return Err(bad("the image is cut short"));
    }
    let raw = data[..2 * width * height]
        .chunks_exact(2)
        .map(|b| u16::from_le_bytes([b[0], b[1]]))
        .collect();
    Ok(Frame { width, height, raw })
}

/// Width, height and maximum value, and the bytes after the single white space that ends the header.
fn pgm_header(bytes: &[u8]) -> Option<([usize; 3], &[u8])> {
    let mut rest = bytes.strip_prefix(b"P5")?;
    let mut numbers = [0usize; 3];
    for number in &mut numbers {
        let start = rest.iter().position(|b| !b.is_ascii_whitespace())?;
        rest = &rest[start..];
        let end = rest.iter().position(|b| !b.is_ascii_digit())?;
        *number = std::str::from_utf8(&rest[..end]).ok()?.parse().ok()?;
        rest = &rest[end..];
    }
    let [width, height, _] = numbers;
    usable_size(width, height).then_some((numbers, rest.get(1..)?))
}

/// Encodes a depth frame as a 16-bit grey PNG.
/// Fails if the frame's size does not match its raw values.
pub fn encode_png16(frame: &Frame) -> Result<Vec<u8>> {
    encode_depth(frame, Compression::Balanced, None)
}

/// How a corrected depth image is marked: keyword and text of a tEXt chunk.
const CORRECTED: [&str; 2] = ["Comment", "biases taken out by kinoise correct"];

/// As [`encode_png16`], marked as corrected.
pub(crate) fn encode_corrected(frame: &Frame) -> Result<Vec<u8>> {
    encode_depth(frame, Compression::Balanced, Some(CORRECTED))
}

/// Whether the image is marked as corrected; false if it cannot be read.
pub(crate) fn is_corrected(path: &Path) -> bool {
    let Ok(file) = open(path) else { return false };
    let Ok(reader) = png::Decoder::new(std::io::BufReader::new(file)).read_info() else {
        return false;
    };
    let [keyword, text] = CORRECTED;
    let mut said = reader.info().uncompressed_latin1_text.iter();
    said.any(|chunk| chunk.keyword == keyword && chunk.text == text)
}

/// As [`encode_png16`], in a tenth of the time but slightly larger.
pub fn encode_png16_quickly(frame: &Frame) -> Result<Vec<u8>> {
    encode_depth(frame, Compression::Fast, None)
}

/// Encodes red, green, blue (row-major) as an 8-bit PNG with the fastest compression.
/// Fails if there are not three bytes per pixel.
pub fn encode_rgb(width: usize, height: usize, rgb: &[u8]) -> Result<Vec<u8>> {
    encode([width, height], (ColorType::Rgb, BitDepth::Eight), Compression::Fast, None, rgb)
}

/// Encodes a depth frame as fakenect does: a PGM with little-endian values.
pub fn encode_pgm16(frame: &Frame) -> Vec<u8> {
    let mut bytes = format!("P5 {} {} 65535\n", frame.width, frame.height).into_bytes();
    bytes.extend(frame.raw.iter().flat_map(|w| w.to_le_bytes()));
    bytes
}

fn encode_depth(
    frame: &Frame,
    compression: Compression,
    said: Option<[&str; 2]>,
) -> Result<Vec<u8>> {
    let data: Vec<u8> = frame.raw.iter().flat_map(|w| w.to_be_bytes()).collect();
    let kind = (ColorType::Grayscale, BitDepth::Sixteen);
    encode([frame.width, frame.height], kind, compression, said, &data)
}

fn encode(
    [width, height]: [usize; 2],
    (colour, depth): (ColorType, BitDepth),
    compression: Compression,
    said: Option<[&str; 2]>,
    data: &[u8],
) -> Result<Vec<u8>> {
    let failed = |e: png::EncodingError| Error::Drawing { what: "PNG", why: e.to_string() };
    // Real depth images compress to less than their raw size, if only through row filtering.
    let mut bytes = Vec::with_capacity(data.len());
    let mut encoder = png::Encoder::new(&mut bytes, width as u32, height as u32);
    encoder.set_color(colour);
    encoder.set_depth(depth);
    encoder.set_compression(compression);
    if let Some([keyword, text]) = said {
        encoder.add_text_chunk(keyword.into(), text.into()).map_err(failed)?;
    }
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(data).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame() -> Frame {
        Frame { width: 5, height: 3, raw: (0..15).map(|i| i * 4000 + 7).collect() }
    }

    #[test]
    fn a_pgm_reads_back_exactly_and_its_words_are_little_endian() {
        let bytes = encode_pgm16(&frame());
        assert_eq!(decode_fakenect_pgm(Path::new("d.pgm"), &bytes).unwrap(), frame());
        let mut bytes = b"P5 2 1 65535\n".to_vec();
        bytes.extend([0x01, 0x02, 0xff, 0x07]);
        let frame = decode_fakenect_pgm(Path::new("d.pgm"), &bytes).unwrap();
        assert_eq!(frame.raw, [0x0201, 2047]);
        for cut in 0..bytes.len() {
            assert!(decode_fakenect_pgm(Path::new("d.pgm"), &bytes[..cut]).is_err());
        }
        let huge = b"P5 99999999 99999999 65535\n..";
        assert!(decode_fakenect_pgm(Path::new("d.pgm"), huge).is_err());
    }
}
