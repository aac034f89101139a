//! Errors that pixels repeat in every view: covariance of the views, pixel by pixel.

use rand::Rng;
use rayon::prelude::*;

use super::texture::{PIXEL_BOX, SHORT_LINE, at_two_scales, line_sums, without_lines};
use crate::diagnose::views::box_sums::repeats_of_box;
use crate::diagnose::views::field::Field;
use crate::rng::Seed;
use crate::terms::Axis;

/// Covariances of a view's mean residual with the other views', px^2: of pixels and of means over a few
/// pixels, both without what whole lines share; of whole columns and rows, as far as they change from one to
/// the next. Means and lines in excess of those of a pattern of independent pixels.
#[derive(Debug, Clone, Default)]
pub struct Still {
    pub fixed_px2: Option<f64>,
    /// Effective number of pixels, all of equal weight.
    pub fixed_pixels: f64,
    pub blotches_px2: Option<f64>,
    pub lines_px2: [Option<f64>; 2],
    /// Standard errors common to all views of columns, rows and blotches, px^2: the pattern has few of them.
    pub by_pattern_px2: [f64; 3],
}

impl Still {
    /// Scales by what remains of a pattern of variance 1.
    fn of(
        [pixels, blotches, lines @ ..]: [Option<Product>; 4],
        kept: &[Option<Product>; 4],
    ) -> Self {
        let fixed = pixels.zip(kept[0].filter(|k| k.px2 > 0.0));
        let fixed_px2 = fixed.map(|(seen, kept)| seen.px2 / kept.px2);
        let of_pattern = |kept: Option<Product>| fixed_px2.zip(kept).map(|(px2, k)| px2 * k.px2);
        let beyond = |seen: Option<Product>, kept| {
            seen.map(|seen| seen.px2 - of_pattern(kept).unwrap_or(0.0))
        };
        // The coins have as few lines as the pattern: twice the variance.
        let error = |kept: Option<Product>, repeats: f64| {
            let relative = kept.map_or(0.0, |k| k.error_px2 * (2.0 * repeats).sqrt());
            relative * fixed_px2.unwrap_or(0.0).abs()
        };
        Still {
            fixed_px2,
            fixed_pixels: pixels.map_or(0.0, |seen| seen.n),
            blotches_px2: beyond(blotches, kept[1]),
            lines_px2: [0, 1].map(|k| beyond(lines[k], kept[2 + k])),
            by_pattern_px2: [
                error(kept[2], SHARP_REPEATS),
                error(kept[3], SHARP_REPEATS),
                error(kept[1], repeats_of_box(PIXEL_BOX as f64)),
            ],
        }
    }
}

/// Sum of the squared correlation of [`sharp_lines`] over all lags: 1, -2/3 and 1/6.
const SHARP_REPEATS: f64 = 1.0 + 2.0 * (4.0 / 9.0 + 1.0 / 36.0);

/// What remains in each view of a pattern of variance 1: every pixel is part of the means subtracted.
pub struct KeptPattern(Vec<[Option<Product>; 4]>);

impl KeptPattern {
    pub fn of(fields: &[Field]) -> Self {
        let coins = coins(fields.first().map_or(0, |f| f.width * f.height));
        let views = beside_bias(fields, &[]);
        KeptPattern(covariances(&views, |f, _| at_two_scales(f, &tossed(f, &coins), &[])))
    }
}

/// Each view with its known bias, px by pixel (or empty).
pub fn beside_bias<'a>(fields: &'a [Field], bias: &'a [Vec<f32>]) -> Vec<(&'a Field, &'a [f32])> {
    let of = |n: usize| bias.get(n).map_or(&[][..], Vec::as_slice);
    fields.iter().enumerate().map(|(n, f)| (f, of(n))).collect()
}

/// Covariances of the views that `kept` was made from, each with its known bias.
pub fn still(views: &[(&Field, &[f32])], kept: &KeptPattern) -> Vec<Still> {
    debug_assert_eq!(views.len(), kept.0.len());
    let seen = covariances(views, |f, b| at_two_scales(f, &f.mean, b));
    seen.into_iter().zip(&kept.0).map(|(seen, kept)| Still::of(seen, kept)).collect()
}

/// Mean product of one view's values with the other views', px^2.
#[derive(Debug, Clone, Copy)]
struct Product {
    px2: f64,
    /// Effective number of values, all of equal weight.
    n: f64,
    /// Standard error from the scatter of the products.
    error_px2: f64,
}

/// Covariances of pixels, of means over a few, of columns and of rows.
fn covariances(
    views: &[(&Field, &[f32])],
    images: impl Fn(&Field, &[f32]) -> [Vec<f32>; 2] + Sync,
) -> Vec<[Option<Product>; 4]> {
    let of_view = |(f, b): &(&Field, &[f32])| {
        let images = images(f, b);
        let [columns, rows] = sharp_lines(&images[0], f.width);
        let [pixels, blotches] = images.map(|m| without_lines(&m, f.width, SHORT_LINE));
        [pixels, blotches, columns, rows]
    };
    let all: Vec<[Vec<f32>; 4]> = views.par_iter().map(of_view).collect();
    let of = |k: usize, min_pairs| {
        across_views(&all.iter().map(|view| &view[k][..]).collect::<Vec<_>>(), min_pairs)
    };
    let [pixels, blotches] = [0, 1].map(|k| of(k, MIN_PAIRS[0]));
    let [columns, rows] = [2, 3].map(|k| of(k, MIN_PAIRS[1]));
    (0..views.len()).map(|v| [pixels[v], blotches[v], columns[v], rows[v]]).collect()
}

/// Fewest pairs of pixels, and of lines, with the other views.
const MIN_PAIRS: [f64; 2] = [1000.0, 100.0];

/// Mean of each column, and of each row, minus the mean of its two neighbours; NaN where one of the three is
/// short. Smooth remainders of shapes drop out; lines with independent errors keep their variance.
fn sharp_lines(image: &[f32], width: usize) -> [Vec<f32>; 2] {
    let mean = |(sum, n): (f64, f64)| if n >= SHORT_LINE { sum / n } else { f64::NAN };
    let sharp = |w: &[f64]| ((w[1] - 0.5 * (w[0] + w[2])) * (2.0f64 / 3.0).sqrt()) as f32;
    [Axis::Column, Axis::Row].map(|axis| {
        let means: Vec<f64> = line_sums(image, width, axis).into_iter().map(mean).collect();
        means.windows(3).map(sharp).collect()
    })
}

/// A random sign for each pixel of the picture: a pattern of variance 1 wherever it is seen.
fn coins(pixels: usize) -> Vec<f32> {
    let mut rng = Seed(0).stream("diagnose/still");
    (0..pixels).map(|_| if rng.random() { 1.0 } else { -1.0 }).collect()
}

/// The coins at the pixels where the view has a mean.
fn tossed(field: &Field, coins: &[f32]) -> Vec<f32> {
    let pixels = field.pixels.iter().zip(&field.mean);
    pixels.map(|(&i, mean)| if mean.is_finite() { coins[i as usize] } else { f32::NAN }).collect()
}

/// Mean product of each view's values with the others'.
fn across_views(means: &[&[f32]], min_pairs: f64) -> Vec<Option<Product>> {
    let n = means.iter().map(|image| image.len()).max().unwrap_or(0);
    let mut sum = vec![0f32; n];
    let mut count = vec![0u16; n];
    for image in means {
        for ((s, c), &r) in sum.iter_mut().zip(&mut count).zip(*image) {
            if r.is_finite() {
                *s += r;
                *c += 1;
            }
        }
    }
    let of = |image: &&[f32]| {
        // Pixels seen by more views weigh more.
        let (mut products, mut squares) = (0.0, 0.0);
        let (mut pairs, mut squared, mut both) = (0.0, 0.0, 0.0);
        for ((&s, &c), &r) in sum.iter().zip(&count).zip(*image) {
            if r.is_finite() && c > 1 {
                let (product, others) = (f64::from(r) * f64::from(s - r), f64::from(c - 1));
                products += product;
                squares += product * product;
                pairs += others;
                squared += others * others;
                both += product * others;
            }
        }
        let px2 = products / pairs;
        let off = squares - px2 * (2.0 * both - px2 * squared);
        let error_px2 = off.max(0.0).sqrt() / pairs;
        (pairs > min_pairs).then_some(Product { px2, n: pairs * pairs / squared, error_px2 })
    };
    means.par_iter().map(of).collect()
}

#[cfg(test)]
#[path = "still_tests.rs"]
mod tests;
