//! What a view's frames measure one after the other, as a line in time and the scatter about it.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::diagnose::views::field::{CLIP_SIGMAS, Field};
use crate::solve::plane_equations;

/// Frames scatter by this factor more before it is told: what pixels share beyond a window's reach is not in their
/// noise, and heavy tails double what the size of it scatters by.
const MUCH: f64 = 2.0;

/// Squares that values of one view scatter by.
#[derive(Debug, Clone, Copy)]
pub struct Squares {
    pub sum: f64,
    pub freedom: f64,
    /// What noise lets one expect for the sum over the freedom.
    pub expected: f64,
}

impl Squares {
    /// Per degree of freedom, beyond what is expected.
    pub fn beyond(&self) -> f64 {
        self.sum / self.freedom - self.expected
    }
}

/// Values that scatter by more than their noise.
pub struct Excess {
    /// Standard deviation beside the noise, and its standard error.
    pub size: f64,
    pub std_error: f64,
    /// Chance of it for noise twice as large as is known.
    pub p: f64,
    pub nats: f64,
}

impl Excess {
    /// Of all views together, at this level.
    pub fn of(views: impl Iterator<Item = Squares>, level: f64) -> Option<Self> {
        let (mut ratio, mut freedom, mut beyond) = (0.0, 0.0, 0.0);
        for s in views {
            ratio += s.sum / s.expected;
            freedom += s.freedom;
            beyond += s.sum - s.freedom * s.expected;
        }
        let p = ChiSquared::new(freedom).map_or(1.0, |d| d.sf(ratio / MUCH)).max(1e-300);
        let (size, larger) = ((beyond / freedom).sqrt(), ratio / freedom);
        (p < level && beyond > 0.0).then(|| Excess {
            size,
            std_error: size / (2.0 * freedom).sqrt(),
            p,
            nats: 0.5 * freedom * (larger - 1.0 - larger.ln()),
        })
    }
}

/// A line through values in time.
pub struct AboutLine {
    /// Sums of squares about the line, and of what it explains.
    pub scatter: f64,
    pub trend: f64,
    /// Of the values, a second.
    pub slope: f64,
}

impl AboutLine {
    /// Of (time, value), three or more.
    pub fn of(series: &[(f64, f64)]) -> Option<Self> {
        let n = series.len() as f64;
        let (t0, x0) = series.iter().fold((0.0, 0.0), |(t, x), s| (t + s.0 / n, x + s.1 / n));
        let (mut tt, mut tx, mut xx) = (0.0, 0.0, 0.0);
        for (t, x) in series {
            tt += (t - t0).powi(2);
            tx += (t - t0) * (x - x0);
            xx += (x - x0).powi(2);
        }
        let trend = tx * tx / tt;
        let line = AboutLine { scatter: (xx - trend).max(0.0), trend, slope: tx / tt };
        (n >= 3.0 && tt > 0.0).then_some(line)
    }
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

impl Jitter {
    /// How the frames' means move, where their pixels' noise lets one expect `expected_px2` of each.
    pub fn of(field: &Field, expected_px2: f64) -> Option<Self> {
        let frames: Vec<(f64, f64)> =
            field.frames.iter().copied().filter(|f| f.1.is_finite()).collect();
        let line = AboutLine::of(&frames)?;
        let disparity = field.scale_px_m * field.plane.q.z;
        if disparity <= 0.0 || expected_px2 <= 0.0 {
            return None;
        }
        let z = field.scale_px_m / disparity;
        Some(Jitter {
            scatter_px2: line.scatter,
            freedom: frames.len() as f64 - 2.0,
            expected_px2,
            trend_px2: line.trend,
            velocity_mps: -line.slope / disparity * z,
        })
    }
}

impl Squares {
    /// How the slopes of a view's frames scatter about a line in time, along both axes of the picture together: px^2
    /// at one standard deviation of the target's pixels from its middle.
    ///
    /// Of the frames that are kept; `mean_px2` is what a frame's mean errs by. `None` with fewer than three, of
    /// which those that lost many pixels are none. Where the noise is larger far from the middle, as on a tilted
    /// target, slopes err by more.
    pub fn of_slopes(field: &Field, mean_px2: f64) -> Option<Self> {
        let axes = axes(field)?;
        let slopes = field.first.iter().map(|r| slopes(field, r, &axes));
        let whole = |n: f64| n >= MIN_SHARE * field.measured_pixels();
        let frames: Vec<(f64, [f64; 2])> = (field.frames.iter().zip(slopes))
            .filter(|(_, (n, _))| *n > 0.0 && whole(*n))
            .map(|((t, _), (_, slopes))| (*t, slopes))
            .collect();
        let of_axis = |axis: usize| {
            let series: Vec<(f64, f64)> = frames.iter().map(|(t, s)| (*t, s[axis])).collect();
            AboutLine::of(&series).map(|line| line.scatter)
        };
        let sum = of_axis(0)? + of_axis(1)?;
        let freedom = 2.0 * (frames.len() as f64 - 2.0);
        let noise = || field.sigma.iter().map(|s| f64::from(*s).powi(2));
        let apart = axes.iter().zip(noise()).map(|([u, v], px2)| 0.5 * (u * u + v * v) * px2);
        let lever = apart.sum::<f64>() / noise().sum::<f64>();
        let expected = lever * mean_px2;
        (expected > 0.0).then_some(Squares { sum, freedom, expected })
    }
}

/// Places of the target's pixels along two axes, uncorrelated and of unit variance.
fn axes(field: &Field) -> Option<Vec<[f64; 2]>> {
    let n = field.pixels.len() as f64;
    let width = field.width as u32;
    let at = |&i: &u32| [f64::from(i % width), f64::from(i / width)];
    let mut all: Vec<[f64; 2]> = field.pixels.iter().map(at).collect();
    for axis in [0, 1] {
        let mean = all.iter().map(|p| p[axis]).sum::<f64>() / n;
        all.iter_mut().for_each(|p| p[axis] -= mean);
        if axis == 1 {
            let shared = all.iter().map(|p| p[0] * p[1]).sum::<f64>() / n;
            all.iter_mut().for_each(|p| p[1] -= shared * p[0]);
        }
        let spread = (all.iter().map(|p| p[axis].powi(2)).sum::<f64>() / n).sqrt();
        if !spread.is_normal() {
            return None;
        }
        all.iter_mut().for_each(|p| p[axis] /= spread);
    }
    Some(all)
}

/// A frame with a smaller share of the pixels that others have errs by more than they do.
const MIN_SHARE: f64 = 0.8;

/// How many pixels of a frame are looked at, and the slopes of their residuals, px at one standard deviation from
/// the middle.
fn slopes(field: &Field, residuals: &[f32], axes: &[[f64; 2]]) -> (f64, [f64; 2]) {
    let pixels = residuals.iter().zip(axes).zip(&field.sigma);
    let seen = pixels.filter(|((e, _), sigma)| e.abs() <= CLIP_SIGMAS * sigma.max(field.spread_px));
    let (a, b) = plane_equations(seen.map(|((&e, at), _)| (*at, f64::from(e), 1.0)));
    let n = a[(0, 0)];
    // Pixels that are lost move the middle.
    (n, [1, 2].map(|axis| (b[axis] - a[(0, axis)] * b[0] / n) / n))
}
