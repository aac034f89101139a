//! A view's residual as a picture: blue nearer than the plane, red farther, grey no target.

use super::axis::round_up;
use super::colours;
use crate::error::{Error, Result};
use crate::measure::ResidualPicture;

/// Palette: entry 0 is "no target", the rest run from the most negative to the most positive;
/// odd in number, so that zero is exactly white.
const SHADES: u8 = 201;
const NO_TARGET: [u8; 3] = [222, 222, 222];
/// Share of the pixels that the scale covers; the few beyond it saturate.
const COVERED: f64 = 0.98;
/// For a picture without any pixel.
const EMPTY_SCALE_MM: f64 = 1.0;

/// The scale on which to show a view, mm: covers 98 % of its pixels, rounded up to 1, 2, 5.
pub fn scale_mm(picture: &ResidualPicture) -> f64 {
    let mut sizes: Vec<f32> =
        picture.millimetres.iter().map(|v| v.abs()).filter(|v| v.is_finite()).collect();
    if sizes.is_empty() {
        return EMPTY_SCALE_MM;
    }
    let rank = ((sizes.len() - 1) as f64 * COVERED).round() as usize;
    let (_, size, _) = sizes.select_nth_unstable_by(rank, f32::total_cmp);
    if *size > 0.0 { round_up(f64::from(*size)) } else { EMPTY_SCALE_MM }
}

/// PNG of the picture, white at zero and saturated at `scale_mm` on either side.
///
/// # Errors
/// When the picture's size and its pixels disagree.
pub fn residual_png(picture: &ResidualPicture, scale_mm: f64) -> Result<Vec<u8>> {
    let shades = picture.millimetres.iter().map(|&v| shade(v, scale_mm)).collect();
    png_of(picture.width, picture.height, shades)
}

/// The same of disparities, px: what is larger than expected is nearer, and blue here too.
pub fn disparity_png(size: [usize; 2], px: &[f32], scale_px: f64) -> Result<Vec<u8>> {
    let shades = px.iter().map(|&v| shade(-v, scale_px)).collect();
    png_of(size[0], size[1], shades)
}

fn png_of(width: usize, height: usize, shades: Vec<u8>) -> Result<Vec<u8>> {
    let failed =
        |e: png::EncodingError| Error::Drawing { what: "the residual picture", why: e.to_string() };
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width as u32, height as u32);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_palette(palette());
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(&shades).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
}

fn palette() -> Vec<u8> {
    let last = f64::from(SHADES - 1);
    let shades = (0..SHADES).map(|i| colours::residual(f64::from(i) / last));
    NO_TARGET.into_iter().chain(shades.flat_map(|c| [c.0, c.1, c.2])).collect()
}

fn shade(value: f32, scale: f64) -> u8 {
    if !value.is_finite() {
        return 0;
    }
    let half = f64::from(SHADES / 2);
    let share = (f64::from(value) / scale).clamp(-1.0, 1.0);
    1 + (half + share * half).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(millimetres: Vec<f32>) -> ResidualPicture {
        ResidualPicture { width: millimetres.len(), height: 1, millimetres }
    }

    #[test]
    fn the_scale_is_round_and_ignores_outliers() {
        let mut values: Vec<f32> = (0..1000).map(|i| i as f32 * 0.0037 - 1.85).collect();
        values[0] = 900.0;
        values[1] = f32::NAN;
        assert_eq!(scale_mm(&picture(values)), 2.0);
        assert_eq!(scale_mm(&picture(vec![f32::NAN; 3])), EMPTY_SCALE_MM);
        assert_eq!(scale_mm(&picture(vec![0.0; 3])), EMPTY_SCALE_MM);
    }

    #[test]
    fn the_picture_reads_back() {
        let bytes = residual_png(&picture(vec![f32::NAN, 0.0, -9.0, 9.0]), 5.0).unwrap();
        let image = image::load_from_memory(&bytes).unwrap().to_rgb8();
        assert_eq!(image.get_pixel(0, 0).0, NO_TARGET);
        assert_eq!(image.get_pixel(1, 0).0, [255, 255, 255]);
        assert!(image.get_pixel(2, 0).0[2] > 100 && image.get_pixel(2, 0).0[0] < 30);
        assert!(image.get_pixel(3, 0).0[0] > 100 && image.get_pixel(3, 0).0[2] < 60);
    }

    #[test]
    fn a_torn_picture_is_refused() {
        let torn = ResidualPicture { width: 4, height: 4, millimetres: vec![0.0; 3] };
        assert!(residual_png(&torn, 1.0).is_err());
    }
}
