//! Images of the noise, without what is smooth, constant or common to a line, and their correlation.

use std::borrow::Cow;
use std::f32::consts::FRAC_1_SQRT_2;

use crate::diagnose::options::FRAMES_KEPT;
use crate::diagnose::views::box_sums::{gross_limit, high_pass};
use crate::diagnose::views::field::Field;
use crate::stats::measure_correlation;
use crate::terms::Axis;

/// Correlation of frames above which they have little noise of their own.
const STILL: f64 = 0.6;

/// An image of the noise that changes from frame to frame, so that nothing constant is taken for it;
/// the first frame where there is only one or where nearly everything is constant. `next` is the
/// correlation of successive frames.
pub fn moving(frames: &[Vec<f32>], next: Option<f64>) -> Vec<f32> {
    match frames {
        [a, b, ..] if next.is_none_or(|c| c < STILL) => change(a, b),
        _ => frames[0].clone(),
    }
}

/// Changes between a view's frames, as orthogonal images that each have the variance of one frame.
pub fn changes(frames: &[Vec<f32>]) -> Vec<Vec<f32>> {
    match frames {
        [a, b, c, d, ..] => {
            let sum = |a: &[f32], b: &[f32]| -> Vec<f32> {
                a.iter().zip(b).map(|(a, b)| (a + b) * FRAC_1_SQRT_2).collect()
            };
            vec![change(a, b), change(c, d), change(&sum(a, b), &sum(c, d))]
        }
        [a, b, ..] => vec![change(a, b)],
        _ => Vec::new(),
    }
}

/// Change from one frame to another, scaled to the variance of one.
fn change(a: &[f32], b: &[f32]) -> Vec<f32> {
    a.iter().zip(b).map(|(a, b)| (b - a) * FRAC_1_SQRT_2).collect()
}

/// Residuals as an image, px, high-passed and without the known bias.
pub fn high_passed(field: &Field, residuals: &[f32], bias: &[f32]) -> Vec<f32> {
    field.high_passed(&without_bias(residuals, bias))
}

/// Residuals without the known bias, which may be empty.
pub fn without_bias<'a>(residuals: &'a [f32], bias: &[f32]) -> Cow<'a, [f32]> {
    if bias.is_empty() {
        return Cow::Borrowed(residuals);
    }
    residuals.iter().zip(bias).map(|(r, b)| r - b).collect()
}

/// Residuals as an image, px, without the known bias, gross errors and the means over [`PIXEL_BOX`].
pub fn pixel_scale(field: &Field, residuals: &[f32], bias: &[f32]) -> Vec<f32> {
    high_pass(&fine_scale(field, residuals, bias), field.width, PIXEL_BOX)
}

/// Same, followed by those means: neither smooth nor changing from pixel to pixel.
pub fn at_two_scales(field: &Field, residuals: &[f32], bias: &[f32]) -> [Vec<f32>; 2] {
    let image = fine_scale(field, residuals, bias);
    let pixels = high_pass(&image, field.width, PIXEL_BOX);
    let means = image.iter().zip(&pixels).map(|(all, own)| all - own).collect();
    [pixels, means]
}

/// Residuals as an image, px, without the known bias, gross errors and what is smooth.
pub fn fine_scale(field: &Field, residuals: &[f32], bias: &[f32]) -> Vec<f32> {
    without_outliers(&high_passed(field, residuals, bias), field.step_px)
}

/// Residuals of up to so many steps are no gross errors (in the changes of frames, words 3.5 steps apart). Where
/// the noise is less than half a step, most pixels keep their word, and the median change is only the tilt of
/// the plane subtracted. Noise of half a step puts fewer than one word in 100,000 beyond.
const MAX_STEPS: f64 = 2.5;

/// Replaces gross errors by NaN, in an image of words of this step.
pub fn without_outliers(image: &[f32], step_px: f64) -> Vec<f32> {
    let limit = gross_limit(image).max((MAX_STEPS * step_px) as f32);
    let kept = |r: &f32| if r.abs() > limit { f32::NAN } else { *r };
    image.iter().map(kept).collect()
}

/// Shorter rows and columns keep their mean, px: it is mostly noise.
const LONG_LINE: f64 = 150.0;
/// Same where a pixel is compared with itself and a line's mean only disturbs.
pub const SHORT_LINE: f64 = 30.0;

/// Row, or column, of a pixel of an image.
pub fn line_of(pixel: usize, width: usize, axis: Axis) -> usize {
    if axis == Axis::Row { pixel / width } else { pixel % width }
}

/// Sum and number of the finite pixels of each row, or of each column.
pub fn line_sums(image: &[f32], width: usize, axis: Axis) -> Vec<(f64, f64)> {
    let lines = if axis == Axis::Row { image.len() / width.max(1) } else { width };
    let mut sums = vec![(0.0, 0.0); lines];
    for (i, r) in image.iter().enumerate().filter(|(_, r)| r.is_finite()) {
        let (sum, n) = &mut sums[line_of(i, width, axis)];
        *sum += f64::from(*r);
        *n += 1.0;
    }
    sums
}

/// Subtracts the mean of each long row and column: noise common to a line is not a window's.
pub fn without_lines(image: &[f32], width: usize, min_pixels: f64) -> Vec<f32> {
    let mut out = image.to_vec();
    let level = |(sum, n): (f64, f64)| if n >= min_pixels { (sum / n) as f32 } else { 0.0 };
    for axis in [Axis::Row, Axis::Column] {
        let levels: Vec<f32> = line_sums(&out, width, axis).into_iter().map(level).collect();
        let pixels = out.iter_mut().enumerate();
        pixels.for_each(|(i, r)| *r -= levels[line_of(i, width, axis)]);
    }
    out
}

/// From this share of the variance on, the part common to rows or columns is subtracted whole. The mean of 30
/// pixels of a Kinect's window, 9 px, adds three tenths of the remaining variance, which is less.
const LARGE_SHARE: f64 = 0.25;

/// Area of the window that correlates the pixels of an image, px^2. Rows and columns have these `shares` of
/// the variance, which add to the correlation at every lag and are not a window's.
pub fn area(noise: &[f32], width: usize, shares: [f64; 2]) -> f64 {
    let is_large = shares.iter().any(|share| *share > LARGE_SHARE);
    let (min_pixels, shares) = if is_large { (SHORT_LINE, [0.0; 2]) } else { (LONG_LINE, shares) };
    let correlation = measure_correlation(&without_lines(noise, width, min_pixels), width);
    // A box of L px has a correlation sum of L along each axis.
    let along = |by_lag: &[f64], share: f64| {
        let left = |rho: &f64| ((rho - share) / (1.0 - share).max(0.1)).max(0.0);
        1.0 + 2.0 * by_lag[1..].iter().map(left).filter(|r| *r > 0.05).sum::<f64>()
    };
    along(&correlation.along_u, shares[0]) * along(&correlation.along_v, shares[1])
}

/// Correlation of two images, pixel by pixel.
pub fn same_pixel(a: &[f32], b: &[f32]) -> f64 {
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (&a, &b) in a.iter().zip(b) {
        let (a, b) = (f64::from(a), f64::from(b));
        if (a * b).is_finite() {
            ab += a * b;
            aa += a * a;
            bb += b * b;
        }
    }
    if aa * bb > 0.0 { ab / (aa * bb).sqrt() } else { f64::NAN }
}

/// Side of the box whose mean is subtracted to leave errors that change from pixel to pixel, px.
pub const PIXEL_BOX: usize = 7;

/// Lags well beyond a Kinect's window, px.
pub const FAR: [usize; 12] = [20, 22, 24, 27, 30, 33, 36, 39, 42, 46, 50, 54];
/// Longest lag that a window's side is fitted to, px.
pub const PROFILE_LAGS: usize = 16;

/// An image with zeros where there is no value, so that sums need no test.
pub struct Filled {
    value: Vec<f32>,
    there: Vec<u8>,
}

impl Filled {
    pub fn of(image: &[f32]) -> Self {
        Filled {
            value: image.iter().map(|r| if r.is_finite() { *r } else { 0.0 }).collect(),
            there: image.iter().map(|r| u8::from(r.is_finite())).collect(),
        }
    }
}

/// Mean product of pixels at these lags along `step`, px^2; `None` with too few pairs.
pub fn covariance(image: &Filled, width: usize, lags: &[usize], step: [usize; 2]) -> Option<f64> {
    let (w, h) = (width, image.value.len() / width.max(1));
    let (mut sum, mut n) = (0.0, 0u64);
    for lag in lags {
        let (du, dv) = (lag * step[0], lag * step[1]);
        let across = w.saturating_sub(du);
        if across == 0 {
            continue;
        }
        for v in 0..h.saturating_sub(dv) {
            let near = v * w..v * w + across;
            let far = (v + dv) * w + du..(v + dv) * w + du + across;
            sum += products(&image.value[near.clone()], &image.value[far.clone()]);
            let pairs = image.there[near].iter().zip(&image.there[far]);
            n += u64::from(pairs.map(|(a, b)| u32::from(a & b)).sum::<u32>());
        }
    }
    (n > 1000).then(|| sum / n as f64)
}

/// Sum of products, in lanes that a processor adds at once.
fn products(a: &[f32], b: &[f32]) -> f64 {
    const LANES: usize = 8;
    let mut lanes = [0.0f64; LANES];
    let (a, b) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let rest = a.remainder().iter().zip(b.remainder());
    let rest: f64 = rest.map(|(a, b)| f64::from(a * b)).sum();
    for (a, b) in a.zip(b) {
        for ((lane, a), b) in lanes.iter_mut().zip(a).zip(b) {
            *lane += f64::from(a * b);
        }
    }
    lanes.iter().sum::<f64>() + rest
}

/// Log ratio of each frame's mean square to the others', from high-passed residuals, and the number of pixels
/// used: those measured in all frames. What frames share, constant or slowly changing, is the same in all.
/// `None` with fewer than three frames, which cannot show which one differs.
pub fn frame_log_variance(frames: &[Vec<f32>]) -> ([Option<f64>; FRAMES_KEPT], f64) {
    let (mut all, mut pixels) = ([None; FRAMES_KEPT], 0.0);
    let n = frames.len().min(FRAMES_KEPT);
    if n < 3 {
        return (all, pixels);
    }
    let mut squares = [0.0; FRAMES_KEPT];
    for k in 0..frames[0].len() {
        let at: [f64; FRAMES_KEPT] =
            std::array::from_fn(|j| frames.get(j).map_or(0.0, |f| f64::from(f[k]).powi(2)));
        if at.iter().sum::<f64>().is_finite() {
            squares.iter_mut().zip(at).for_each(|(square, r)| *square += r);
            pixels += 1.0;
        }
    }
    let whole: f64 = squares.iter().sum();
    for (one, own) in all.iter_mut().zip(squares).take(n) {
        let rest = (whole - own) / (n - 1) as f64;
        *one = (own > 0.0 && rest > 0.0).then(|| (own / rest).ln());
    }
    (all, pixels)
}

#[cfg(test)]
mod tests {
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::rng::Seed;
    use crate::stats::noise_through_boxes;

    /// Noise through boxes of this side plus rows with about this share of the
    /// variance, and their actual share.
    fn image(side: usize, share: f64) -> (Vec<f32>, f64) {
        let mut rng = Seed(7).stream("texture/area");
        let noise = noise_through_boxes([WIDTH, HEIGHT], side, &mut rng);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let scale = (share / (1.0 - share)).sqrt();
        let rows: Vec<f64> = (0..HEIGHT).map(|_| scale * normal()).collect();
        let square = rows.iter().map(|r| r * r).sum::<f64>() / HEIGHT as f64;
        let with_row = |(i, r): (usize, f64)| (r + rows[i / WIDTH]) as f32;
        let image = noise.into_iter().enumerate().map(with_row).collect();
        (image, square / (1.0 + square))
    }

    const WIDTH: usize = 140;
    const HEIGHT: usize = 100;

    /// A target that faces the sensor: two words in a hundred are a step off, in a plane of next to no tilt.
    #[test]
    fn words_a_step_off_are_no_gross_errors() {
        let word = |i: usize| 1e-4 * (i % 7) as f32 + if i.is_multiple_of(50) { 0.13 } else { 0.0 };
        let mut image: Vec<f32> = (0..5000).map(word).collect();
        image[1234] = 3.0;
        let lost = |image: &[f32]| image.iter().filter(|r| r.is_nan()).count();
        assert_eq!(lost(&without_outliers(&image, 0.13)), 1);
        assert_eq!(lost(&without_outliers(&image, 0.0)), 101, "of words as good as continuous");
    }

    #[test]
    fn rows_that_err_alike_are_no_window() {
        for (side, share) in [(1, 0.0), (1, 0.8), (3, 0.0), (3, 0.2), (3, 0.6), (5, 0.8)] {
            let (image, share) = image(side, share);
            let found = area(&image, WIDTH, [share, 0.0]).sqrt();
            assert!((found / side as f64 - 1.0).abs() < 0.12, "{found} px of {side}, rows {share}");
        }
    }
}
