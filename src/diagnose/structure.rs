//! How the noise hangs together: between neighbours, frames, rows, and views.
//!
//! Every statistic is one number a view, so that views are the sample: its mean over views against
//! its standard error, by Student's t.

use rayon::prelude::*;

use super::field::Field;
use super::smooth::{SMOOTH_PX, high_pass};
use crate::camera::Camera;
use crate::stats::measure_correlation;

/// What one view tells; `None` where it cannot.
#[derive(Debug, Clone, Default)]
pub struct Structure {
    /// Side of the window that would make the correlation, px.
    pub window_px: Option<f64>,
    /// Correlation of a pixel with itself 1, 2 and 3 frames later.
    pub lagged: [Option<f64>; 3],
    /// Variance that a row (a column) of one frame shares, px^2.
    pub row_px2: Option<f64>,
    pub column_px2: Option<f64>,
    /// Variance of a frame's mean beyond what its pixels explain, px^2.
    pub frame_px2: Option<f64>,
    /// Change of the plane's disparity, as relative velocity of its depth, 1/s.
    pub approach_per_s: Option<f64>,
    /// Share of residuals beyond four standard deviations, and the share a Gaussian has there.
    pub tail: f64,
    /// Variance of the first frame's rough residual, px^2.
    pub variance_px2: f64,
}

/// A Gaussian's share beyond four standard deviations.
pub const GAUSSIAN_TAIL: f64 = 6.334e-5;
const TAIL_SIGMAS: f32 = 4.0;

/// Measure all views.
pub fn structures(fields: &[Field], camera: &Camera) -> Vec<Structure> {
    fields.par_iter().map(|f| structure(f, camera)).collect()
}

fn structure(field: &Field, camera: &Camera) -> Structure {
    let rough: Vec<Vec<f32>> = field.first.iter().map(|r| image(field, r, camera)).collect();
    let Some(first) = rough.first() else { return Structure::default() };
    let correlation = measure_correlation(first, camera.width);
    let mut s = Structure {
        // A box of L px has a correlation sum of L along each axis.
        window_px: Some(correlation.sum.sqrt()),
        tail: tail(first),
        variance_px2: mean(first.iter().map(|&r| f64::from(r).powi(2))).unwrap_or(0.0),
        ..Structure::default()
    };
    for lag in 1..rough.len().min(4) {
        let pairs = (0..rough.len() - lag).map(|k| same_pixel(&rough[k], &rough[k + lag]));
        s.lagged[lag - 1] = mean(pairs);
    }
    if let [a, b, ..] = field.first.as_slice() {
        let difference: Vec<f32> = a.iter().zip(b).map(|(a, b)| b - a).collect();
        let change = image(field, &difference, camera);
        // A difference of two frames has twice the variance of one.
        s.row_px2 = far_covariance(&change, camera, true).map(|c| 0.5 * c);
        s.column_px2 = far_covariance(&change, camera, false).map(|c| 0.5 * c);
    }
    s.frame_px2 = frame_scatter(field, correlation.sum, s.lagged[0].unwrap_or(0.0), s.variance_px2);
    s.approach_per_s = approach(field);
    s
}

/// Residuals as an image, px, without what is smooth.
fn image(field: &Field, residuals: &[f32], camera: &Camera) -> Vec<f32> {
    let mut image = vec![f32::NAN; camera.pixels()];
    for (k, &i) in field.pixels.iter().enumerate() {
        image[i as usize] = residuals[k];
    }
    high_pass(&image, camera.width, camera.height, SMOOTH_PX)
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

fn tail(image: &[f32]) -> f64 {
    let mut sizes: Vec<f32> = image.iter().filter(|r| r.is_finite()).map(|r| r.abs()).collect();
    if sizes.is_empty() {
        return 0.0;
    }
    let sigma = crate::plane::MAD_TO_SIGMA as f32 * crate::stats::median_in_place(&mut sizes);
    let beyond = sizes.iter().filter(|r| **r > TAIL_SIGMAS * sigma).count();
    beyond as f64 / sizes.len() as f64
}

/// Lags well beyond a Kinect's window, px.
const FAR: [usize; 4] = [20, 27, 34, 41];

/// Mean product of pixels of one row (column) that are far apart, px^2.
fn far_covariance(image: &[f32], camera: &Camera, along_row: bool) -> Option<f64> {
    let (w, h) = (camera.width, camera.height);
    let (mut sum, mut n) = (0.0, 0.0);
    for lag in FAR {
        let (step, us, vs) = if along_row {
            (lag, w.saturating_sub(lag), h)
        } else {
            (lag * w, w, h.saturating_sub(lag))
        };
        for v in 0..vs {
            for u in 0..us {
                let i = v * w + u;
                let product = image[i] * image[i + step];
                if product.is_finite() {
                    sum += f64::from(product);
                    n += 1.0;
                }
            }
        }
    }
    (n > 1000.0).then(|| sum / n)
}

/// Variance of the frames' means minus what the moving part of the pixels' noise explains.
fn frame_scatter(
    field: &Field,
    correlation_sum: f64,
    frozen: f64,
    variance_px2: f64,
) -> Option<f64> {
    let means: Vec<f64> = field.frames.iter().map(|f| f.1).filter(|m| m.is_finite()).collect();
    let n = means.len() as f64;
    if n < 3.0 {
        return None;
    }
    let mean = means.iter().sum::<f64>() / n;
    let scatter = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let moving = variance_px2 * (1.0 - frozen.clamp(0.0, 1.0));
    Some(scatter - moving * correlation_sum / field.pixels.len() as f64)
}

/// Least squares of the frames' means on time, over the view's mean disparity: d' / d = -z' / z.
fn approach(field: &Field) -> Option<f64> {
    let frames: Vec<(f64, f64)> =
        field.frames.iter().copied().filter(|f| f.1.is_finite()).collect();
    let n = frames.len() as f64;
    if n < 3.0 {
        return None;
    }
    let (t0, m0) = frames.iter().fold((0.0, 0.0), |(t, m), f| (t + f.0 / n, m + f.1 / n));
    let (mut tt, mut tm) = (0.0, 0.0);
    for (t, m) in frames {
        tt += (t - t0).powi(2);
        tm += (t - t0) * (m - m0);
    }
    let disparity = field.scale_px_m * field.plane.q.z;
    (tt > 0.0 && disparity > 0.0).then(|| tm / tt / disparity)
}
