//! Bins of depth inside a view, and the arithmetic of their spread.

/// Several views of one standard deviation, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Of one frame over the pixels, axial, about the plane: the paper's notion, along the axis.
    pub spatial_m: f64,
    /// Of one pixel over the frames; `None` with a single frame.
    pub temporal_m: Option<f64>,
    /// Over pixels and frames together.
    pub total_m: f64,
    /// Of the perpendicular residual, pixels and frames together.
    pub perpendicular_m: f64,
}

/// A bin of depth in a view (or the whole view).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cell {
    /// Mean depth of the samples, m.
    pub z_m: f64,
    pub spread: Spread,
    /// Standard error of the spatial sigma, m.
    pub std_error_m: f64,
    /// Samples (pixels times frames) used.
    pub n: usize,
    /// Independent samples they are worth for a variance.
    pub n_effective: f64,
    /// Samples of target pixels without a depth.
    pub missing: usize,
    /// Samples farther than the cut from the plane.
    pub cut: usize,
}

/// A view is binned when its depth runs over more than this ratio ...
const BIN_WHEN_RATIO: f64 = 1.10;
/// ... into bins of at most this ratio: sigma ~ z^2 then varies by 10 % inside a bin, and the
/// root mean square differs from sigma at the mean depth by less than 0.1 %.
const BIN_RATIO: f64 = 1.05;
const MOST_BINS: usize = 48;

/// How depth is cut into bins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bins {
    low: f64,
    log_ratio: f64,
    pub count: usize,
}

impl Bins {
    /// For depths between `low` and `high`, m.
    pub fn between(low: f64, high: f64) -> Self {
        let range = (high / low).ln();
        let tilted = range > BIN_WHEN_RATIO.ln();
        if !tilted {
            return Bins { low, log_ratio: f64::INFINITY, count: 1 };
        }
        let count = ((range / BIN_RATIO.ln()).ceil() as usize).min(MOST_BINS);
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
    /// Of the axial residual, its square, and the square of the perpendicular one.
    pub e: f64,
    pub e2: f64,
    pub p2: f64,
    /// Within pixels over frames: squared deviations and their degrees of freedom.
    pub within: f64,
    pub within_dof: f64,
    /// Between frames: n_f (mean_f - mean)^2.
    pub between: f64,
    pub missing: usize,
    pub cut: usize,
    /// Pixels that gave at least one sample.
    pub pixels: f64,
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
        self.missing += other.missing;
        self.cut += other.cut;
        self.pixels += other.pixels;
    }
}

/// What is known about a view when its cells are evaluated.
#[derive(Debug, Clone, Copy)]
pub(super) struct Context {
    pub frames: f64,
    /// Variance left by the cut of the tails, as a share.
    pub cut_factor: f64,
    /// Pixels per independent sample of a mean and of a variance.
    pub correlation_sum: f64,
    pub correlation_squares: f64,
    /// Independent frames per frame, for the part that changes with time.
    pub temporal_dilution: f64,
    /// Pixels of the whole view: the plane's three parameters are shared by all cells.
    pub view_pixels: f64,
    pub per_frame_planes: bool,
}

/// Parameters of a plane.
const PLANE_PARAMETERS: f64 = 3.0;
/// The plane cannot have absorbed more than this share of the variance: beyond, the residual is
/// smooth error rather than correlated noise, and the count of parameters says nothing.
const MOST_ABSORBED: f64 = 0.05;

impl Context {
    pub fn cell(&self, s: &Sums) -> Option<Cell> {
        if s.n < 3.0 {
            return None;
        }
        let total = s.e2 / s.n / self.cut_factor;
        let temporal = (self.frames >= 2.0 && s.within_dof > 0.0)
            .then(|| s.within / s.within_dof / self.cut_factor);
        // Share of the variance that stands still from frame to frame.
        let frozen = temporal.map_or(1.0, |t| (1.0 - t / total).clamp(0.0, 1.0));
        let frames = (s.n / s.pixels.max(1.0)).max(1.0);
        let moving_frames = 1.0 + (frames - 1.0) * self.temporal_dilution;
        let absorbed = self.absorbed(frozen, moving_frames);
        let unbias = 1.0 / (1.0 - absorbed);
        let spatial = ((s.e2 - s.between).max(0.0) / s.n / self.cut_factor) * unbias;
        let total = total * unbias;
        // Squares of the covariance between two frames: frozen^2 off the diagonal.
        let moving = 1.0 - frozen;
        let worth = frozen * frozen + moving * (moving + 2.0 * frozen) / moving_frames;
        let n_effective = (s.pixels / self.correlation_squares / worth).min(s.n).max(1.0);
        let root = |variance: f64| variance.sqrt() * crate::stats::std_unbias(n_effective);
        let spatial_m = root(spatial);
        Some(Cell {
            z_m: s.z / s.n,
            spread: Spread {
                spatial_m,
                temporal_m: temporal.map(f64::sqrt),
                total_m: root(total),
                perpendicular_m: root(s.p2 / s.n / self.cut_factor * unbias),
            },
            std_error_m: spatial_m / (2.0 * n_effective).sqrt(),
            n: s.n as usize,
            n_effective,
            missing: s.missing,
            cut: s.cut,
        })
    }

    /// Share of one frame's variance that the plane fit took away.
    fn absorbed(&self, frozen: f64, moving_frames: f64) -> f64 {
        let per_plane = PLANE_PARAMETERS * self.correlation_sum / self.view_pixels.max(1.0);
        let share =
            if self.per_frame_planes { 1.0 } else { frozen + (1.0 - frozen) / moving_frames };
        (per_plane * share).min(MOST_ABSORBED)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frontal_view_is_one_bin_and_a_tilted_one_many() {
        assert_eq!(Bins::between(1.0, 1.05).count, 1);
        let bins = Bins::between(0.8, 1.6);
        assert_eq!(bins.count, 15);
        assert_eq!(bins.index(0.8), 0);
        assert_eq!(bins.index(1.6), 14);
        assert_eq!(bins.index(0.1), 0, "outside is clamped");
    }

    #[test]
    fn white_noise_in_time_counts_every_frame_and_frozen_noise_only_one() {
        let context = Context {
            frames: 10.0,
            cut_factor: 1.0,
            correlation_sum: 1.0,
            correlation_squares: 1.0,
            temporal_dilution: 1.0,
            view_pixels: 1000.0,
            per_frame_planes: false,
        };
        let base = Sums {
            n: 10_000.0,
            z: 10_000.0,
            e2: 10_000.0,
            p2: 10_000.0,
            pixels: 1000.0,
            within_dof: 9000.0,
            ..Sums::default()
        };
        let white = context.cell(&Sums { within: 9000.0, ..base }).unwrap();
        assert!((white.n_effective - 10_000.0).abs() < 1.0, "{white:?}");
        let frozen = context.cell(&Sums { within: 0.0, ..base }).unwrap();
        assert!((frozen.n_effective - 1000.0).abs() < 1.0, "{frozen:?}");
    }
}
