//! Structure of the noise: correlation between neighbours, frames, rows and views.
//!
//! Every statistic is one number per view, so the views are the sample.

use super::frame_series::{Jitter, Squares};
use super::moments::Moments;
use super::pairs::{Lines, NEIGHBOURS, Pairs};
use super::still::Still;
use super::tail_counts::{MIN_READINGS, TailCounts};
use super::texture::{
    FAR, Filled, PROFILE_LAGS, SHORT_LINE, area, changes, covariance, fine_scale,
    frame_log_variance, moving, same_pixel, without_lines,
};
use crate::diagnose::options::FRAMES_KEPT;
use crate::diagnose::steps::rounding::{
    before_rounding, correlation_of_rounding, share_of_rounding,
};
use crate::diagnose::views::box_sums::repeats_of_box;
use crate::diagnose::views::field::Field;
use crate::stats::{Correlation, LONGEST_LAG, mean, mean_square};

/// Statistics of one view; `None` where it cannot show them.
#[derive(Debug, Clone, Default)]
pub struct Structure {
    /// Number of pixels used.
    pub pixels: f64,
    /// Variance of the first frame's high-passed residual, px^2.
    pub variance_px2: f64,
    /// Part of it that the means of rows and columns hold, px^2.
    pub lines_px2: f64,
    /// Share of the rest that is the error of rounding to steps.
    pub rounding: f64,
    /// Step between the stored words, px.
    pub step_px: f64,
    /// Side of the window that would cause the correlation, px.
    pub window_px: Option<f64>,
    /// Correlation of the changes between frames at lags of 1, 2, 3, ... px, beyond that at far lags.
    pub correlation_profile: Option<[f64; PROFILE_LAGS]>,
    /// Mean correlation of near pixels in the changes between frames, the nearest weighted most.
    pub neighbour_correlation: Option<f64>,
    /// Its standard error in white noise.
    pub near_error: f64,
    /// Sum of the correlation over a pixel and all near ones.
    pub near_sum: Option<f64>,
    /// Correlation of a pixel with itself 1, 2 and 3 frames later, before rounding.
    pub lagged: [Option<f64>; 3],
    /// Same of the stored words.
    pub stored: [Option<f64>; 3],
    /// Correlation that rounding alone gives the frames' words.
    pub rounded: f64,
    /// Log ratio of each of the first frames' variance to that of the others.
    pub frame_log_variance: [Option<f64>; FRAMES_KEPT],
    /// Number of pixels that all of these frames measured.
    pub frame_pixels: f64,
    /// Covariance of the mean residual with the other views'.
    pub still: Still,
    /// Variance common to a row (a column) of one frame, px^2.
    pub row_px2: Option<f64>,
    pub column_px2: Option<f64>,
    /// Number of pixel pairs behind it in rows and in columns, each counted twice.
    pub line_pairs: [f64; 2],
    /// Means of the frames about a line in time.
    pub jitter: Option<Jitter>,
    /// Slopes of the frames over the picture.
    pub tilts: Option<Squares>,
    /// Residuals beyond four local standard deviations.
    pub tails: TailCounts,
    /// Number of places where they lie.
    pub far_places: f64,
    /// Moments of the residuals near the middle, for tails too weak to count.
    pub moments: Moments,
    /// Mean ratio of the disparity's standard deviation to the disparity.
    pub relative_sigma: f64,
}

impl Structure {
    /// Only the size of the noise.
    pub fn of_size(field: &Field, bias: &[f32]) -> Self {
        let cut = field.cut_to_target();
        let first = field.first.first().map(|frame| fine_scale(&cut, frame, bias));
        first.map_or_else(Structure::default, |frame| Structure::of_image(&frame))
    }

    /// The size of the noise in an image of it.
    fn of_image(image: &[f32]) -> Self {
        Structure {
            pixels: image.iter().filter(|r| r.is_finite()).count() as f64,
            variance_px2: mean_square(image).unwrap_or(0.0),
            ..Structure::default()
        }
    }

    /// Share beyond four local standard deviations; `None` with too few readings.
    pub fn tail_share(&self) -> Option<f64> {
        (self.tails.n > MIN_READINGS).then(|| self.tails.share())
    }

    /// Excess kurtosis of the disparity and of the depth, to second order in the relative noise. An error e
    /// of the disparity d is e / (1 + e / d) in the depth.
    pub fn excess(&self) -> Option<[f64; 2]> {
        let (disparity, skewness) = (self.moments.excess()?, self.moments.skewness()?);
        let s = self.relative_sigma;
        Some([disparity, disparity + 24.0 * s * (3.0 * s - skewness)])
    }

    /// Number of pixels per independent squared residual: the sum of a box's squared correlation.
    pub fn repeats(&self) -> f64 {
        repeats_of_box(self.window_px.unwrap_or(1.0).max(1.0))
    }

    /// Skewness of the disparity and of the depth; for noise of s times the disparity the latter is 6 s less.
    pub fn skewness(&self) -> Option<[f64; 2]> {
        let disparity = self.moments.skewness()?;
        Some([disparity, disparity - 6.0 * self.relative_sigma])
    }

    /// Variance without whole lines and before rounding, px^2.
    pub fn noise_px2(&self) -> f64 {
        (self.variance_px2 - self.lines_px2) * (1.0 - self.rounding)
    }

    pub fn take_lines(&mut self, lines: Lines) {
        (self.row_px2, self.column_px2, self.line_pairs) = (lines.row, lines.column, lines.pairs);
    }

    /// Standard error of the share of the variance common to rows (columns: 1) where there is none: that of
    /// the mean of so many products of two distant pixels. With a window of side W, the correlation of the
    /// products sums to W along the line at either end, and across it to the sum of the squared correlation.
    pub fn line_error(&self, axis: usize) -> f64 {
        let side = self.window_px.unwrap_or(1.0).max(1.0);
        let alike = side * side * self.repeats().sqrt();
        (2.0 * alike / self.line_pairs[axis]).sqrt()
    }

    /// Weight of a view for that variance, px^-4, where a pixel's variance is at least `variance_px2`: a view
    /// whose readings are all one step gets no extra weight.
    pub fn line_size(&self, axis: usize, variance_px2: f64) -> f64 {
        (self.line_error(axis) * self.variance_px2.max(variance_px2).max(1e-12)).powi(-2)
    }

    /// Variance inflation of a mean and of a log variance by row noise, beyond that of pixels with this
    /// `correlation`, for a shape that varies by row. All pixels along a row share its error, on a
    /// target about as wide as high.
    pub fn excess_of_rows(&self, correlation: &Correlation) -> [f64; 2] {
        let shared = self.row_share();
        let along = self.pixels.sqrt();
        [
            1.0 + along * shared / correlation.sum.max(1.0),
            1.0 + along * shared * shared / correlation.sum_of_squares.max(1.0),
        ]
    }

    /// Sum of the correlation that row noise causes, up to the longest lag.
    pub fn row_correlation(&self) -> f64 {
        1.0 + 2.0 * LONGEST_LAG as f64 * self.row_share()
    }

    fn row_share(&self) -> f64 {
        self.row_px2.unwrap_or(0.0).max(0.0) / self.variance_px2.max(1e-12)
    }

    /// Variance inflation of the mean of this and the other `views` where their pixels share an error of
    /// variance `px2`; each of the `frames` has its own noise.
    pub fn excess_of_pattern(
        &self,
        px2: f64,
        frames: f64,
        views: f64,
        correlation: &Correlation,
    ) -> f64 {
        let own = correlation.sum.max(1.0) * (self.variance_px2 - px2).max(0.0) / frames;
        1.0 + (views - 1.0) * px2 / (own + px2).max(1e-12)
    }
}

/// A view's structure, and what its lines share by pairs in short blocks.
pub fn structure(field: &Field, bias: &[f32]) -> (Structure, Lines) {
    let cut = field.cut_to_target();
    let frames: Vec<Vec<f32>> = field.first.iter().map(|r| fine_scale(&cut, r, bias)).collect();
    let mut short = Lines::default();
    let Some(first) = frames.first() else { return (Structure::default(), short) };
    let mut s = Structure { step_px: field.step_px, ..Structure::of_image(first) };
    let level: Vec<Vec<f32>> =
        frames.iter().map(|f| without_lines(f, cut.width, SHORT_LINE)).collect();
    let left_px2 = mean_square(&level[0]).unwrap_or(0.0);
    s.lines_px2 = (s.variance_px2 - left_px2).max(0.0);
    s.rounding = share_of_rounding(s.step_px, left_px2);
    s.stored = [1, 2, 3].map(|lag| {
        let pairs = 0..frames.len().saturating_sub(lag);
        mean(pairs.map(|k| same_pixel(&level[k], &level[k + lag])))
    });
    s.lagged = s.stored.map(|rho| before_rounding(rho?, s.step_px, left_px2));
    s.rounded = correlation_of_rounding(s.step_px, left_px2);
    (s.frame_log_variance, s.frame_pixels) = frame_log_variance(&frames);
    let images: Vec<Vec<f32>> = field.first.iter().map(|r| cut.image(r)).collect();
    let pairs: Option<Vec<Pairs>> =
        changes(&images).iter().map(|change| Pairs::of(change, cut.width, s.step_px)).collect();
    if let Some(pairs) = pairs.filter(|p| !p.is_empty()) {
        let all = |of: &dyn Fn(&Pairs) -> Option<f64>| mean(pairs.iter().filter_map(of));
        let [long, by_short] = [0, 1].map(|k| Lines {
            row: all(&|p| p.lines[k].row),
            column: all(&|p| p.lines[k].column),
            pairs: [0, 1].map(|axis| pairs.iter().map(|p| p.lines[k].pairs[axis]).sum()),
        });
        s.take_lines(long);
        short = by_short;
        let correlation = |k: usize| {
            let of =
                |p: &Pairs| p.near[k] / beside_lines(p.power, [p.lines[0].row, p.lines[0].column]);
            all(&|p| Some(of(p)))
        };
        s.neighbour_correlation = correlation(0);
        let variance: f64 = pairs.iter().map(|p| p.near_variance).sum();
        s.near_error = variance.sqrt() / pairs.len() as f64;
        s.near_sum = correlation(1).map(|rho| 1.0 + NEIGHBOURS as f64 * rho);
        s.correlation_profile =
            correlation_profile(&changes(&frames), cut.width, [s.row_px2, s.column_px2]);
    }
    let share = |px2: Option<f64>| (px2.unwrap_or(0.0) / s.variance_px2.max(1e-12)).max(0.0);
    let shares = [share(s.row_px2), share(s.column_px2)];
    let window = area(&moving(&frames, s.stored[0]), cut.width, shares);
    s.window_px = Some(window.sqrt());
    // A window for only part of the noise is too weak to see lag by lag.
    let of_mean_px2 = frame_mean_px2(field, &s, window.max(s.near_sum.unwrap_or(1.0)));
    s.jitter = Jitter::of(field, of_mean_px2);
    let columns = (s.pixels / rows(field)).max(1.0);
    let of_columns_px2 = s.column_px2.unwrap_or(0.0).max(0.0) / columns;
    s.tilts = Squares::of_slopes(field, of_mean_px2 + of_columns_px2);
    (s, short)
}

/// Variance of a frame's mean due to the noise of its pixels and rows, px^2.
fn frame_mean_px2(field: &Field, s: &Structure, correlation_sum: f64) -> f64 {
    let still = s.stored[0].unwrap_or(0.0).clamp(0.0, 1.0);
    let own = s.variance_px2 * (1.0 - still) * correlation_sum / field.measured_pixels().max(1.0);
    own + s.row_px2.unwrap_or(0.0).max(0.0) / rows(field)
}

/// Number of rows from the target's first to its last.
fn rows(field: &Field) -> f64 {
    let ends = field.pixels.last().zip(field.pixels.first());
    ends.map_or(1.0, |(last, first)| f64::from(last - first) / field.width as f64 + 1.0)
}

/// Part of `power` that rows and columns do not share, px^2.
fn beside_lines(power: f64, lines: [Option<f64>; 2]) -> f64 {
    let shared: f64 = lines.iter().flatten().map(|px2| px2.max(0.0)).sum();
    (power - shared).max(1e-12)
}

/// Correlation at lags of 1, 2, 3, ... px along rows and columns, without that at far lags and without the
/// variance common to whole lines, px^2.
fn correlation_profile(
    changes: &[Vec<f32>],
    width: usize,
    [row, column]: [Option<f64>; 2],
) -> Option<[f64; PROFILE_LAGS]> {
    let filled: Vec<Filled> = changes.iter().map(|c| Filled::of(c)).collect();
    let over = |lags: &[usize], step: [usize; 2]| {
        let all: Option<Vec<f64>> =
            filled.iter().map(|c| covariance(c, width, lags, step)).collect();
        mean(all?.into_iter())
    };
    // The high-pass leaves a little correlation everywhere: what the diagonal shows is not a window's.
    let apart = over(&FAR, [1, 1])?;
    let power = mean_square(changes.iter().flatten())?;
    let power = beside_lines(power, [row, column]);
    let at = |lag: usize| {
        let along = |step, line: f64| Some(over(&[lag], step)? - apart - line.max(0.0));
        let both = along([1, 0], row?)? + along([0, 1], column?)?;
        Some(0.5 * both / power)
    };
    let correlation_profile: Option<Vec<f64>> = (1..=PROFILE_LAGS).map(at).collect();
    correlation_profile?.try_into().ok()
}

#[cfg(test)]
#[path = "structure_tests.rs"]
mod tests;
