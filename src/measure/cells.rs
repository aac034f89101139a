//! Bins of depth inside a view, and their standard deviations.

/// Standard deviations of the residual, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Over the pixels of one frame, axial, about the plane: as in the paper, but along the axis.
    pub spatial_m: f64,
    /// Of one pixel over the frames; `None` with a single frame.
    pub temporal_m: Option<f64>,
    /// Over pixels and frames together.
    pub total_m: f64,
    /// Of the perpendicular residual, pixels and frames together.
    pub perpendicular_m: f64,
}

impl Spread {
    /// Share of the spatial variance that is constant over the frames, 0 to 1; `None` with a single frame.
    pub fn fixed_share(&self) -> Option<f64> {
        let temporal = self.temporal_m?;
        Some((1.0 - (temporal / self.spatial_m).powi(2)).clamp(0.0, 1.0))
    }
}

/// A bin of depth in a view (or the whole view).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cell {
    /// Mean depth of the samples, m.
    pub z_m: f64,
    pub spread: Spread,
    /// Standard error of the spatial sigma, m.
    pub std_error_m: f64,
    /// Standard error of the mean depth, m, and the part of it by shifts of whole frames.
    pub mean_std_error_m: f64,
    pub shift_std_error_m: f64,
    /// Samples (pixels times frames) used.
    pub n: usize,
    /// Effective number of independent samples for a variance.
    pub n_effective: f64,
    /// Effective number of independent samples for the temporal sigma: one frame per pixel is lost.
    pub n_effective_temporal: f64,
    /// Samples of target pixels without a depth.
    pub dropouts: usize,
    /// Samples farther than the cut from the plane.
    pub cut: usize,
}

impl Cell {
    /// Share of the target's samples that have a depth, 0 to 1.
    pub fn fill_rate(&self) -> f64 {
        let filled = self.n + self.cut;
        filled as f64 / (filled + self.dropouts).max(1) as f64
    }
}

/// A view is binned when its depths span more than this ratio ...
const BIN_WHEN_RATIO: f64 = 1.10;
/// ... into bins of at most this ratio: sigma ~ z^2 then varies by 10 % inside a bin, and the
/// root mean square differs from sigma at the mean depth by less than 0.1 %.
const BIN_RATIO: f64 = 1.05;
const MAX_BINS: usize = 48;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bins {
    low: f64,
    log_ratio: f64,
    pub count: usize,
}

impl Bins {
    pub fn between(low: f64, high: f64) -> Self {
        let range = (high / low).ln();
        let tilted = range > BIN_WHEN_RATIO.ln();
        if !tilted {
            return Bins { low, log_ratio: f64::INFINITY, count: 1 };
        }
        let count = ((range / BIN_RATIO.ln()).ceil() as usize).min(MAX_BINS);
        Bins { low, log_ratio: range / count as f64, count }
    }

    pub fn index(&self, z: f64) -> usize {
        if self.count == 1 {
            return 0;
        }
        (((z / self.low).ln() / self.log_ratio).max(0.0) as usize).min(self.count - 1)
    }
}

/// Sums over the samples of a cell, from which its [`Cell`] follows.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sums {
    pub n: f64,
    pub z: f64,
    /// Sums of the axial residual, its square, and the square of the perpendicular residual.
    pub e: f64,
    pub e2: f64,
    pub p2: f64,
    /// Within pixels over the frames: squared deviations and their degrees of freedom.
    pub within: f64,
    pub within_dof: f64,
    /// Between frames: n_f (mean_f - mean)^2.
    pub between: f64,
    pub dropouts: usize,
    pub cut: usize,
    /// Pixels that gave at least one sample.
    pub pixels: f64,
    /// Number of merged bins: each has its own frame means in `between`.
    pub bins: f64,
    /// Part of `between` by shifts of whole frames, bin by bin.
    pub shared: f64,
}

impl Sums {
    pub fn merge(&mut self, other: &Sums) {
        self.n += other.n;
        self.z += other.z;
        self.e += other.e;
        self.e2 += other.e2;
        self.p2 += other.p2;
        self.within += other.within;
        self.within_dof += other.within_dof;
        self.between += other.between;
        self.dropouts += other.dropouts;
        self.cut += other.cut;
        self.pixels += other.pixels;
        self.bins += other.bins;
        self.shared += other.shared;
    }
}

/// Properties of a view needed to evaluate its cells.
pub(super) struct Context {
    pub frames: f64,
    /// Share of the variance left by the cut of the tails.
    pub cut_factor: f64,
    /// Pixels per independent sample of a mean and of a variance.
    pub correlation_sum: f64,
    pub correlation_squares: f64,
    /// Correlation of the moving part one frame apart, taken as a first-order filter.
    pub temporal_rho: f64,
    /// Pixels of the whole view: all cells share the plane's three parameters.
    pub view_pixels: f64,
}

const PLANE_PARAMETERS: f64 = 3.0;
/// Largest share of the variance that the plane may have absorbed: beyond, the residual is a smooth error
/// rather than correlated noise, and the count of parameters says nothing.
const MAX_ABSORBED: f64 = 0.05;

impl Context {
    pub fn cell(&self, s: &Sums) -> Option<Cell> {
        if s.n < 3.0 {
            return None;
        }
        let total = s.e2 / s.n / self.cut_factor;
        let frames = (s.n / s.pixels.max(1.0)).max(1.0);
        let within = (self.frames >= 2.0 && s.within_dof > 0.0).then(|| s.within / s.within_dof);
        let temporal = within.map(|w| self.temporal(w, total, frames));
        // Share of the variance that is constant over the frames.
        let frozen = temporal.map_or(1.0, |t| (1.0 - t / total).clamp(0.0, 1.0));
        let moving_frames = 1.0 + (frames - 1.0) * self.temporal_dilution();
        let absorbed = self.absorbed(frozen, moving_frames);
        let unbias = 1.0 / (1.0 - absorbed);
        let spatial = ((s.e2 - s.shared.max(0.0)).max(0.0) / s.n / self.cut_factor) * unbias;
        let total = total * unbias;
        // Squares of the covariance between two frames: frozen^2 off the diagonal.
        let moving = 1.0 - frozen;
        let between = 2.0 * frozen * moving / self.independent_frames(frames);
        let worth = frozen * frozen + moving * moving / moving_frames + between;
        let n_effective = (s.pixels / self.correlation_squares / worth).min(s.n).max(1.0);
        let root = |variance: f64| variance.sqrt() * crate::stats::std_unbias(n_effective);
        let spatial_m = root(spatial);
        let [mean_std_error_m, shift_std_error_m] =
            self.mean_std_errors_m(s, spatial, frozen, within.unwrap_or(0.0));
        Some(Cell {
            z_m: s.z / s.n,
            spread: Spread {
                spatial_m,
                temporal_m: temporal.map(f64::sqrt),
                total_m: root(total),
                perpendicular_m: root(s.p2 / s.n / self.cut_factor * unbias),
            },
            std_error_m: spatial_m / (2.0 * n_effective).sqrt(),
            mean_std_error_m,
            shift_std_error_m,
            n: s.n as usize,
            n_effective,
            n_effective_temporal: (s.pixels / self.correlation_squares * (moving_frames - 1.0))
                .max(1.0),
            dropouts: s.dropouts,
            cut: s.cut,
        })
    }

    /// Standard error of the mean depth and its part by shifts, from the variance `spatial` of a frame, its share
    /// `frozen` that more frames do not average out, and the shifts of whole frames beyond the variance `within`
    /// pixels.
    fn mean_std_errors_m(&self, s: &Sums, spatial: f64, frozen: f64, within: f64) -> [f64; 2] {
        let frames = (s.n / s.pixels.max(1.0)).max(1.0);
        let further = frames - 1.0;
        let pixels = (s.pixels / self.correlation_sum.max(1.0)).max(1.0);
        let moving = (1.0 - frozen) / self.independent_frames(frames);
        let of_pixels = spatial * (frozen + moving) / pixels;
        let shared = self.beyond_chance(s, within);
        let of_frames = if further > 0.0 { shared / s.n / further } else { 0.0 };
        [of_pixels + of_frames, of_frames].map(f64::sqrt)
    }

    /// Sum of squares between the frames' means beyond noise; zero within three standard errors of noise,
    /// because about half of all chi-squares exceed their mean.
    fn beyond_chance(&self, s: &Sums, within: f64) -> f64 {
        const CLEARLY: f64 = 3.0;
        let freedom = (self.frames - 1.0).max(0.0) * s.bins.max(1.0);
        let noise = within * self.correlation_sum.min(s.pixels);
        let clear = s.between > noise * (freedom + CLEARLY * (2.0 * freedom).sqrt());
        if clear { s.between - noise * freedom } else { 0.0 }
    }

    /// Independent frames for the mean of the moving part: of a first-order filter (1 - rho)/(1 + rho) per further
    /// frame.
    fn independent_frames(&self, frames: f64) -> f64 {
        1.0 + (frames - 1.0) * (1.0 - self.temporal_rho) / (1.0 + self.temporal_rho)
    }

    /// Independent frames per frame, for the variance of the moving part: the squares of a first-order correlation
    /// sum to (1 + rho^2) / (1 - rho^2).
    fn temporal_dilution(&self) -> f64 {
        let square = self.temporal_rho * self.temporal_rho;
        (1.0 - square) / (1.0 + square)
    }

    /// Temporal variance of a pixel, from its variance `within` a few correlated frames about their mean.
    /// That is too small by the frames' mean correlation and by the cut: cutting the sum of two Gaussian
    /// parts narrows each in proportion to its share.
    fn temporal(&self, within: f64, total: f64, frames: f64) -> f64 {
        let moving = (within / total).clamp(0.0, 1.0);
        let cut = 1.0 - (1.0 - self.cut_factor) * moving;
        within / cut / (1.0 - mean_correlation(self.temporal_rho, frames))
    }

    /// Sum of squares between the frames of a bin beyond that of noise correlated between neighbours: shifts of
    /// whole frames, which are no spread over the pixels.
    pub fn shared_by_a_frame(&self, s: &Sums) -> f64 {
        let within = if s.within_dof > 0.0 { s.within / s.within_dof } else { 0.0 };
        let by_noise = (self.frames - 1.0) * within * self.correlation_sum.min(s.pixels);
        s.between - by_noise
    }

    /// Share of one frame's variance that the plane fit absorbed.
    fn absorbed(&self, frozen: f64, moving_frames: f64) -> f64 {
        let per_plane = PLANE_PARAMETERS * self.correlation_sum / self.view_pixels.max(1.0);
        (per_plane * (frozen + (1.0 - frozen) / moving_frames)).min(MAX_ABSORBED)
    }
}

/// Mean correlation between different frames, of `frames` frames of a first-order filter.
fn mean_correlation(rho: f64, frames: f64) -> f64 {
    let n = frames.round().max(2.0);
    // The sum of (n - k) rho^k over k = 1 .. n - 1, in closed form.
    let sum = rho * (n * (1.0 - rho) - (1.0 - rho.powf(n))) / (1.0 - rho).powi(2);
    (2.0 * sum / (n * (n - 1.0))).clamp(0.0, MAX_SHARED)
}

/// Largest mean correlation corrected: a filter slower than the view leaves too little noise to scale up.
const MAX_SHARED: f64 = 0.8;

#[cfg(test)]
#[path = "cells_tests.rs"]
mod tests;
