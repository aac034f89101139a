//! Residuals as pictures: blue nearer than expected, red farther, grey where nothing was measured.

use maud::Markup;
use plotters::style::RGBColor;

use super::axis::round_up;
use super::colours;
use super::document::picture;
use crate::error::Result;
use crate::io::encode_rgb;
use crate::stats::quantile;

/// Shades of either side.
const STEPS: f64 = 100.0;
const NO_TARGET: [u8; 3] = [222, 222, 222];
/// Share of the pixels that the scale covers; the few beyond it saturate.
const COVERED: f64 = 0.98;
/// For a picture without any pixel.
const EMPTY_SCALE: f64 = 1.0;

/// Where the colours end: covers 98 % of the finite values, rounded up to 1, 2 or 5 times a power
/// of ten.
pub(super) fn scale(values: &[f32]) -> f64 {
    let sizes = values.iter().filter(|v| v.is_finite()).map(|v| f64::from(v.abs()));
    let size = quantile(&mut sizes.collect::<Vec<f64>>(), COVERED);
    size.filter(|size| *size > 0.0).map_or(EMPTY_SCALE, round_up)
}

/// Values row by row, white at zero and saturated at `farther` in red, `-farther` in blue; a
/// disparity, which is larger for what is nearer, has a negative scale.
///
/// # Errors
/// When the picture's size and its pixels disagree.
pub(super) fn residual_image(
    size: [usize; 2],
    values: &[f32],
    farther: f64,
    alt: &str,
) -> Result<Markup> {
    Ok(picture(&png(size, values, farther)?, size, alt))
}

fn png([width, height]: [usize; 2], values: &[f32], farther: f64) -> Result<Vec<u8>> {
    let colour = |value: &f32| {
        // In steps, so that few colours occur and the picture packs well.
        let share = (f64::from(*value) / farther).clamp(-1.0, 1.0);
        let shade = 0.5 + 0.5 * (STEPS * share).round() / STEPS;
        let RGBColor(r, g, b) = colours::between(&colours::RESIDUALS, shade);
        if value.is_finite() { [r, g, b] } else { NO_TARGET }
    };
    encode_rgb(width, height, &values.iter().flat_map(colour).collect::<Vec<u8>>())
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
