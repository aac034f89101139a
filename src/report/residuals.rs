//! Residual images: blue is nearer than expected, red farther, grey not measured.

use maud::Markup;

use super::axis::round_up;
use super::colours;
use super::document::picture;
use crate::error::{Error, Result};
use crate::stats::quantile;

/// Colours of the palette besides entry 0, "no target". They run from the most negative to the most positive;
/// their number is odd, so that zero is exactly white. An indexed picture takes a third of the bytes.
const SHADES: u8 = 201;
const NO_TARGET: [u8; 3] = [222, 222, 222];
/// Share of the pixels that the scale covers; the rest saturate.
const COVERED: f64 = 0.98;
/// Scale of a picture without valid pixels.
const EMPTY_SCALE: f64 = 1.0;

/// End of the colour scale: covers 98 % of the finite values, rounded up to 1, 2 or 5 times a power of ten.
pub(super) fn scale(values: &[f32]) -> f64 {
    let sizes = values.iter().filter(|v| v.is_finite()).map(|v| f64::from(v.abs()));
    let size = quantile(&mut sizes.collect::<Vec<f64>>(), COVERED);
    size.filter(|size| *size > 0.0).map_or(EMPTY_SCALE, round_up)
}

/// Draws values row by row: white at zero, saturated red at `farther` and blue at `-farther`. The scale is
/// negative for disparities, which are larger for nearer points.
///
/// # Errors
/// If the size of the picture and the number of its pixels disagree.
pub(super) fn residual_image(
    size: [usize; 2],
    values: &[f32],
    farther: f64,
    alt: &str,
) -> Result<Markup> {
    Ok(picture(&png(size, values, farther)?, size, alt))
}

fn png([width, height]: [usize; 2], values: &[f32], farther: f64) -> Result<Vec<u8>> {
    let failed =
        |e: png::EncodingError| Error::Drawing { what: "the residual picture", why: e.to_string() };
    let last = f64::from(SHADES - 1);
    let shades = (0..SHADES).map(|i| colours::between(&colours::RESIDUALS, f64::from(i) / last));
    let palette = NO_TARGET.into_iter().chain(shades.flat_map(|c| [c.0, c.1, c.2]));
    let pixels: Vec<u8> = values.iter().map(|&v| shade(f64::from(v) / farther)).collect();
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width as u32, height as u32);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_palette(palette.collect::<Vec<u8>>());
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(&pixels).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
}

fn shade(share: f64) -> u8 {
    let half = f64::from(SHADES / 2);
    if share.is_finite() { 1 + (half + share.clamp(-1.0, 1.0) * half).round() as u8 } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scale_is_round_and_ignores_outliers() {
        let mut values: Vec<f32> = (0..1000).map(|i| i as f32 * 0.0037 - 1.85).collect();
        values[0] = 900.0;
        values[1] = f32::NAN;
        assert_eq!(scale(&values), 2.0);
        assert_eq!(scale(&[f32::NAN; 3]), EMPTY_SCALE);
        assert_eq!(scale(&[0.0; 3]), EMPTY_SCALE);
    }

    #[test]
    fn the_picture_reads_back() {
        let bytes = png([4, 1], &[f32::NAN, 0.0, -9.0, 9.0], 5.0).unwrap();
        let image = image::load_from_memory(&bytes).unwrap().to_rgb8();
        assert_eq!(image.get_pixel(0, 0).0, NO_TARGET);
        assert_eq!(image.get_pixel(1, 0).0, [255, 255, 255]);
        assert!(image.get_pixel(2, 0).0[2] > 100 && image.get_pixel(2, 0).0[0] < 30);
        assert!(image.get_pixel(3, 0).0[0] > 100 && image.get_pixel(3, 0).0[2] < 60);
        assert!(png([4, 4], &[0.0; 3], 1.0).is_err(), "a torn picture");
    }
}
