//! How the noise hangs together: between neighbours, frames, rows, and views.
//!
//! Every statistic is one number a view, so that views are the sample.

use std::f32::consts::FRAC_1_SQRT_2;

use rayon::prelude::*;

use super::field::Field;
use super::smooth::{SMOOTH_PX, high_pass};
use crate::camera::Camera;
use crate::stats::{MAD_TO_SIGMA, measure_correlation, median_in_place};

/// What one view tells; `None` where it cannot.
#[derive(Debug, Clone, Default)]
pub struct Structure {
    /// Pixels that were looked at.
    pub pixels: f64,
    /// Variance of the first frame's rough residual, px^2.
    pub variance_px2: f64,
    /// Side of the window that would make the correlation, px.
    pub window_px: Option<f64>,
    /// Mean correlation of near pixels of what changes between frames, beyond that of far ones.
    pub near: Option<f64>,
    /// Correlation of a pixel with itself 1, 2 and 3 frames later.
    pub lagged: [Option<f64>; 3],
    /// Covariance of the mean residual with the other views' at the same pixels, px^2.
    pub fixed_px2: Option<f64>,
    /// The part of it that whole columns and rows share, px^2.
    pub lines_px2: Option<f64>,
    /// Variance that a row (a column) of one frame shares, px^2.
    pub row_px2: Option<f64>,
    pub column_px2: Option<f64>,
    /// Of the frames' means about a line in time.
    pub jitter: Option<Jitter>,
    /// Share of residuals beyond four local standard deviations, and how many were looked at.
    pub tail: f64,
    pub tail_pixels: f64,
    /// Excess kurtosis inside four local standard deviations would be cut; mean |r| beyond, in
    /// standard deviations.
    pub tail_size: f64,
}

/// Frame by frame, the mean residual of the target.
#[derive(Debug, Clone, Copy)]
pub struct Jitter {
    /// Sum of squares about the line, px^2, and its degrees of freedom.
    pub scatter_px2: f64,
    pub freedom: f64,
    /// What the pixels' own noise lets one expect for scatter / freedom, px^2.
    pub expected_px2: f64,
    /// Sum of squares that the line explains, px^2.
    pub trend_px2: f64,
    /// Velocity along the optical axis, m/s.
    pub velocity_mps: f64,
}

/// A Gaussian's share beyond four standard deviations.
pub const GAUSSIAN_TAIL: f64 = 6.334e-5;
const TAIL_SIGMAS: f32 = 4.0;

/// Measure all views. `bias` has, view by view, what is known to be no noise, px (or is empty).
pub fn structures(fields: &[Field], camera: &Camera, bias: &[Vec<f32>]) -> Vec<Structure> {
    let views = beside_bias(fields, bias);
    let mut all: Vec<Structure> = views.par_iter().map(|(f, b)| structure(f, camera, b)).collect();
    for (s, Still { fixed_px2, with_lines_px2 }) in all.iter_mut().zip(still(&views, camera)) {
        s.fixed_px2 = fixed_px2;
        s.lines_px2 = with_lines_px2.zip(fixed_px2).map(|(all, fixed)| all - fixed);
    }
    all
}

/// [`Structure::fixed_px2`] of all views alone.
pub fn fixed_px2_by_view(fields: &[Field], camera: &Camera) -> Vec<Option<f64>> {
    still(&beside_bias(fields, &[]), camera).into_iter().map(|s| s.fixed_px2).collect()
}

fn beside_bias<'a>(fields: &'a [Field], bias: &'a [Vec<f32>]) -> Vec<(&'a Field, &'a [f32])> {
    let of = |n: usize| bias.get(n).map_or(&[][..], Vec::as_slice);
    fields.iter().enumerate().map(|(n, f)| (f, of(n))).collect()
}

/// Covariance of a view's mean residual with the other views' at the same pixels, px^2: without and
/// with what whole lines share.
struct Still {
    fixed_px2: Option<f64>,
    with_lines_px2: Option<f64>,
}

fn still(views: &[(&Field, &[f32])], camera: &Camera) -> Vec<Still> {
    let mut means: Vec<Vec<f32>> = views.par_iter().map(|(f, b)| fine(f, b)).collect();
    let with_lines = across_views(&means);
    means.par_iter_mut().for_each(|m| *m = without_lines(m, camera.width, SHORT_LINE));
    let pairs = across_views(&means).into_iter().zip(with_lines);
    pairs.map(|(fixed_px2, with_lines_px2)| Still { fixed_px2, with_lines_px2 }).collect()
}

fn structure(field: &Field, camera: &Camera, bias: &[f32]) -> Structure {
    let mut s = Structure::default();
    let frames: Vec<Vec<f32>> = field.first.iter().map(|r| calm(&rough(field, r, bias))).collect();
    let Some(first) = frames.first() else { return s };
    s.pixels = first.iter().filter(|r| r.is_finite()).count() as f64;
    s.variance_px2 = mean(first.iter().map(|&r| f64::from(r).powi(2))).unwrap_or(0.0);
    let level: Vec<Vec<f32>> =
        frames.iter().map(|f| without_lines(f, camera.width, SHORT_LINE)).collect();
    for lag in 1..frames.len().min(4) {
        let pairs = (0..frames.len() - lag).map(|k| same_pixel(&level[k], &level[k + lag]));
        s.lagged[lag - 1] = mean(pairs);
    }
    let noise = moving(&frames, &s);
    let lines = without_lines(&noise, camera.width, LONG_LINE);
    let changes = changes(&frames);
    if !changes.is_empty() {
        let filled: Vec<Filled> = changes.iter().map(|c| Filled::of(c)).collect();
        let over = |lags: &[usize], step: [usize; 2]| {
            let all: Option<Vec<f64>> =
                filled.iter().map(|c| covariance(c, camera, lags, step)).collect();
            mean(all?.into_iter())
        };
        // Taking out what is smooth leaves a little of everything everywhere: what a diagonal
        // shows is no row's.
        let apart = over(&FAR, [1, 1]);
        let shared = |step| Some(over(&FAR, step)? - apart?);
        s.row_px2 = shared([1, 0]);
        s.column_px2 = shared([0, 1]);
        let beyond = |step, lines: Option<f64>| Some(over(&NEAR, step)? - apart? - lines?.max(0.0));
        let power = mean(changes.iter().flatten().map(|&r| f64::from(r).powi(2)));
        s.near = (|| {
            let along = beyond([1, 0], s.row_px2)? + beyond([0, 1], s.column_px2)?;
            Some(0.5 * along / power?.max(1e-12))
        })();
    }
    let correlation = measure_correlation(&lines, camera.width);
    // What whole rows share is no window's: it stands in the correlation at every lag.
    let share = |px2: Option<f64>| (px2.unwrap_or(0.0) / s.variance_px2.max(1e-12)).max(0.0);
    let along = |course: &[f64], share: f64| {
        let left = |rho: &f64| ((rho - share) / (1.0 - share).max(0.1)).max(0.0);
        1.0 + 2.0 * course[1..].iter().map(left).filter(|r| *r > 0.05).sum::<f64>()
    };
    // A box of L px has a correlation sum of L along each axis.
    let window = along(&correlation.along_u, share(s.row_px2))
        * along(&correlation.along_v, share(s.column_px2));
    s.window_px = Some(window.sqrt());
    s.jitter = jitter(field, &s, window);
    s
}

/// Frames that resemble one another more than this have little noise of their own.
const STILL: f64 = 0.6;

/// An image of the noise as it changes from frame to frame, so that nothing that stands still is
/// taken for it; the first frame where there is but one, or where nearly all stands still.
pub fn moving(frames: &[Vec<f32>], s: &Structure) -> Vec<f32> {
    match frames {
        [a, b, ..] if s.lagged[0].is_none_or(|c| c < STILL) => change(a, b),
        _ => frames[0].clone(),
    }
}

/// What changes between a view's frames, as orthogonal images that have one frame's variance each.
fn changes(frames: &[Vec<f32>]) -> Vec<Vec<f32>> {
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

/// From one frame to another, with the variance of one.
fn change(a: &[f32], b: &[f32]) -> Vec<f32> {
    a.iter().zip(b).map(|(a, b)| (b - a) * FRAC_1_SQRT_2).collect()
}

/// Residuals as an image, px, without what is smooth and what is known.
fn rough(field: &Field, residuals: &[f32], bias: &[f32]) -> Vec<f32> {
    let image = if bias.is_empty() {
        field.image(residuals)
    } else {
        let left: Vec<f32> = residuals.iter().zip(bias).map(|(r, b)| r - b).collect();
        field.image(&left)
    };
    high_pass(&image, field.width, field.height, SMOOTH_PX)
}

/// The view's mean, px, without what is known, gross errors, and all that does not change from pixel
/// to pixel.
pub(super) fn fine(field: &Field, bias: &[f32]) -> Vec<f32> {
    let image = calm(&rough(field, &field.mean, bias));
    high_pass(&image, field.width, field.height, PIXEL_BOX)
}

/// Without gross errors.
fn calm(image: &[f32]) -> Vec<f32> {
    let mut sizes: Vec<f32> = image.iter().filter(|r| r.is_finite()).map(|r| r.abs()).collect();
    let limit = 6.0 * MAD_TO_SIGMA as f32 * median_in_place(&mut sizes);
    let kept = |r: &f32| if limit > 0.0 && r.abs() > limit { f32::NAN } else { *r };
    image.iter().map(kept).collect()
}

/// Rows and columns shorter than this are left as they are, px: their mean is mostly noise.
const LONG_LINE: usize = 150;
/// The same where a pixel is held against itself, and a line's mean only stands in the way.
const SHORT_LINE: usize = 30;

/// Minus the mean of each long row and column: noise that a row shares is no window's.
fn without_lines(image: &[f32], width: usize, least: usize) -> Vec<f32> {
    let mut out = image.to_vec();
    let level = |sum: f64, n: usize| if n >= least { (sum / n as f64) as f32 } else { 0.0 };
    let mut columns = vec![(0.0, 0); width];
    for row in out.chunks_exact_mut(width.max(1)) {
        let (mut sum, mut n) = (0.0, 0);
        for r in row.iter().filter(|r| r.is_finite()) {
            sum += f64::from(*r);
            n += 1;
        }
        let mean = level(sum, n);
        for (r, (sum, n)) in row.iter_mut().zip(&mut columns) {
            *r -= mean;
            if r.is_finite() {
                *sum += f64::from(*r);
                *n += 1;
            }
        }
    }
    let means: Vec<f32> = columns.into_iter().map(|(sum, n)| level(sum, n)).collect();
    for row in out.chunks_exact_mut(width.max(1)) {
        row.iter_mut().zip(&means).for_each(|(r, mean)| *r -= mean);
    }
    out
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (mut sum, mut n) = (0.0, 0.0);
    for v in values.filter(|v| v.is_finite()) {
        sum += v;
        n += 1.0;
    }
    (n > 0.0).then(|| sum / n)
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

/// Mean product of each view's mean residual with the mean of the others', px^2.
fn across_views(means: &[Vec<f32>]) -> Vec<Option<f64>> {
    let n = means.iter().map(Vec::len).max().unwrap_or(0);
    let mut sum = vec![0f32; n];
    let mut count = vec![0u16; n];
    for image in means {
        for ((s, c), &r) in sum.iter_mut().zip(&mut count).zip(image) {
            if r.is_finite() {
                *s += r;
                *c += 1;
            }
        }
    }
    let of = |image: &Vec<f32>| {
        let (mut products, mut n) = (0.0, 0.0);
        for ((&s, &c), &r) in sum.iter().zip(&count).zip(image) {
            if r.is_finite() && c > 1 {
                // Pixels that many views saw say more.
                let others = f64::from(c - 1);
                products += f64::from(r) * f64::from(s - r);
                n += others;
            }
        }
        (n > 1000.0).then(|| products / n)
    };
    means.par_iter().map(of).collect()
}

/// A pixel's own error changes from pixel to pixel: the box whose mean is taken out, px.
const PIXEL_BOX: usize = 7;

/// Side of the patches whose own scale their residuals are held against: this share of the
/// picture's width, px.
const PATCHES_ACROSS: usize = 7;
const SMALLEST_PATCH: usize = 40;

/// Share of residuals beyond four standard deviations of their patch, their number, and how far
/// out they lie, in standard deviations.
pub fn tail(image: &[f32], camera: &Camera) -> (f64, f64, f64) {
    let (mut beyond, mut n, mut size) = (0.0, 0.0, 0.0);
    let side = (camera.width / PATCHES_ACROSS).max(SMALLEST_PATCH);
    for v0 in (0..camera.height).step_by(side) {
        for u0 in (0..camera.width).step_by(side) {
            let rows = v0..(v0 + side).min(camera.height);
            let patch: Vec<f32> = rows
                .flat_map(|v| {
                    let u1 = (u0 + side).min(camera.width);
                    image[v * camera.width + u0..v * camera.width + u1].iter().copied()
                })
                .filter(|r| r.is_finite())
                .map(f32::abs)
                .collect();
            if patch.len() < side * side / 4 {
                continue;
            }
            let mut sizes = patch.clone();
            let mad = MAD_TO_SIGMA as f32 * median_in_place(&mut sizes);
            // Coarse words make the median jump; the bulk's own spread bounds it below.
            let bulk = &mut sizes[..];
            bulk.sort_unstable_by(f32::total_cmp);
            let most = &bulk[..bulk.len() * 9 / 10];
            let square: f64 = most.iter().map(|r| f64::from(*r).powi(2)).sum();
            // Nine tenths of a Gaussian have 0.72 of its standard deviation... squared 0.6225.
            let spread = (square / most.len() as f64 / 0.6225).sqrt() as f32;
            let sigma = mad.max(0.8 * spread);
            if sigma <= 0.0 {
                continue;
            }
            for r in &patch {
                n += 1.0;
                if *r > TAIL_SIGMAS * sigma {
                    beyond += 1.0;
                    size += f64::from(r / sigma);
                }
            }
        }
    }
    if n > 0.0 { (beyond / n, n, size / f64::max(beyond, 1.0)) } else { (0.0, 0.0, 0.0) }
}

/// Lags well beyond a Kinect's window, px.
const FAR: [usize; 12] = [20, 22, 24, 27, 30, 33, 36, 39, 42, 46, 50, 54];
/// Lags within a window.
const NEAR: [usize; 4] = [1, 2, 3, 4];

/// An image with nothing where there is none: sums run over it without a question.
struct Filled {
    value: Vec<f32>,
    there: Vec<u8>,
}

impl Filled {
    fn of(image: &[f32]) -> Self {
        Filled {
            value: image.iter().map(|r| if r.is_finite() { *r } else { 0.0 }).collect(),
            there: image.iter().map(|r| u8::from(r.is_finite())).collect(),
        }
    }
}

/// Mean product of pixels that are so far apart along `step`, px^2.
fn covariance(image: &Filled, camera: &Camera, lags: &[usize], step: [usize; 2]) -> Option<f64> {
    let (w, h) = (camera.width, camera.height);
    let (mut sum, mut n) = (0.0, 0u64);
    for lag in lags {
        let (du, dv) = (lag * step[0], lag * step[1]);
        let across = w.saturating_sub(du);
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

/// How the frames' means move.
fn jitter(field: &Field, s: &Structure, correlation_sum: f64) -> Option<Jitter> {
    let frames: Vec<(f64, f64)> =
        field.frames.iter().copied().filter(|f| f.1.is_finite()).collect();
    let n = frames.len() as f64;
    let (t0, m0) = frames.iter().fold((0.0, 0.0), |(t, m), f| (t + f.0 / n, m + f.1 / n));
    let (mut tt, mut tm, mut mm) = (0.0, 0.0, 0.0);
    for (t, m) in frames {
        tt += (t - t0).powi(2);
        tm += (t - t0) * (m - m0);
        mm += (m - m0).powi(2);
    }
    let disparity = field.scale_px_m * field.plane.q.z;
    if n < 3.0 || tt <= 0.0 || disparity <= 0.0 || s.variance_px2 <= 0.0 {
        return None;
    }
    let still = s.lagged[0].unwrap_or(0.0).clamp(0.0, 1.0);
    let rows = field
        .pixels
        .last()
        .zip(field.pixels.first())
        .map_or(1.0, |(last, first)| f64::from(last - first) / field.width as f64 + 1.0);
    let own = s.variance_px2 * (1.0 - still) * correlation_sum / field.measured_pixels().max(1.0);
    let trend_px2 = tm * tm / tt;
    let z = field.scale_px_m / disparity;
    Some(Jitter {
        scatter_px2: (mm - trend_px2).max(0.0),
        freedom: n - 2.0,
        expected_px2: own + s.row_px2.unwrap_or(0.0).max(0.0) / rows,
        trend_px2,
        velocity_mps: -tm / tt / disparity * z,
    })
}
