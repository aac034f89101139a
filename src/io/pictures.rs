//! Reading infrared and colour images of the depth image's size: PNG, JPEG.

use std::path::Path;

use image::ImageDecoder;

use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::read::open;

/// A colour image from a PNG or JPEG: red, green, blue, row-major.
#[derive(Debug, Clone, PartialEq)]
pub struct ColourImage {
    pub width: usize,
    pub height: usize,
    pub rgb: Vec<u8>,
}

impl ColourImage {
    /// Reads one image of the depth image's `size`, width and height, px.
    /// Fails if the file is not a whole PNG or JPEG of that size: pixels would not correspond.
    pub fn read(path: &Path, size: [usize; 2]) -> Result<Self> {
        let remedy = "colour must be a whole PNG or JPEG, registered to depth pixel by pixel";
        let image = decode_of_size(path, "colour", size, remedy)?.into_rgb8();
        Ok(ColourImage { width: size[0], height: size[1], rgb: image.into_raw() })
    }
}

/// Decodes an image of exactly this size; larger ones are not decompressed, because half
/// a megabyte can hold gigabytes.
fn decode_of_size(
    path: &Path,
    kind: &str,
    [width, height]: [usize; 2],
    remedy: &'static str,
) -> Result<image::DynamicImage> {
    let damaged = |e: image::ImageError| Error::recording(path, e.to_string(), remedy);
    let file = std::io::BufReader::new(open(path)?);
    // Detected from the content: names can be wrong.
    let reader = image::ImageReader::new(file).with_guessed_format();
    let reader = reader.map_err(|e| Error::read(path, e))?;
    let decoder = reader.into_decoder().map_err(damaged)?;
    let (wide, high) = decoder.dimensions();
    if (wide as usize, high as usize) != (width, height) {
        let what = format!("the {kind} image is {wide} x {high} px, the depth {width} x {height}");
        return Err(Error::recording(path, what, remedy));
    }
    image::DynamicImage::from_decoder(decoder).map_err(damaged)
}

/// Reads one infrared image of the depth image's `size`, width and height, px: amplitudes in the image's own
/// units.
/// Fails if the file is not a whole grey PNG of 8 or 16 bits and that size.
pub fn read_infrared(path: &Path, size: [usize; 2]) -> Result<Frame> {
    let remedy = "infrared must be a grey PNG of the depth's size";
    let raw = match decode_of_size(path, "infrared", size, remedy)? {
        image::DynamicImage::ImageLuma8(grey) => {
            grey.into_raw().into_iter().map(u16::from).collect()
        }
        image::DynamicImage::ImageLuma16(grey) => grey.into_raw(),
        other => {
            return Err(Error::recording(
                path,
                format!("{:?} image", other.color()),
                "infrared must be a grey PNG of 8 or 16 bits",
            ));
        }
    };
    Ok(Frame { width: size[0], height: size[1], raw })
}
