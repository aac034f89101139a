//! Time series of a view's frames: a line in time and the scatter about it.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::diagnose::views::field::{CLIP_SIGMAS, Field};
use crate::solve::plane_equations;

/// Factor by which a variance must exceed that of the noise, which lacks correlation beyond a window's reach;
/// heavy tails double the scatter of its size.
pub const MUCH: f64 = 2.0;

/// Sum of squares of the values of one view.
#[derive(Debug, Clone, Copy)]
pub struct Squares {
    pub sum: f64,
    pub freedom: f64,
    /// Sum over freedom expected from noise.
    pub expected: f64,
}

impl Squares {
    /// Excess over the expected, per degree of freedom.
    pub fn beyond(&self) -> f64 {
        self.sum / self.freedom - self.expected
    }

    /// Scatter of the slopes of a view's frames about a line in time, over both axes of the picture: px^2 at
    /// one standard deviation of the target's pixels from its centre.
    ///
    /// Uses the frames kept; `mean_px2` is the variance of a frame's mean. `None` with fewer than three. The error
    /// of the slopes is larger where the noise grows away from the centre, as on a tilted target.
    pub fn of_slopes(field: &Field, mean_px2: f64) -> Option<Self> {
        let axes = axes(field)?;
        let slopes = field.first.iter().map(|r| slopes(field, r, &axes));
        let frames: Vec<(f64, [f64; 2])> = (field.frames.iter().zip(slopes))
            .filter(|((_, mean), (n, _))| mean.is_finite() && *n > 0.0)
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

/// Scatter of values beyond their noise.
pub struct Excess {
    /// Standard deviation beyond the noise, and its standard error.
    pub size: f64,
    pub std_error: f64,
    /// P-value for noise of `much` times the known variance.
    pub p: f64,
    pub nats: f64,
}

impl Excess {
    /// Tests at this level whether all views together scatter by more than `much` times what is expected.
    pub fn of(views: impl Iterator<Item = Squares>, much: f64, level: f64) -> Option<Self> {
        let (mut ratio, mut freedom, mut beyond) = (0.0, 0.0, 0.0);
        for s in views {
            ratio += s.sum / s.expected;
            freedom += s.freedom;
            beyond += s.sum - s.freedom * s.expected;
        }
        let p = ChiSquared::new(freedom).map_or(1.0, |d| d.sf(ratio / much)).max(1e-300);
        let (size, larger) = ((beyond / freedom).sqrt(), ratio / freedom);
        (p < level && beyond > 0.0).then(|| Excess {
            size,
            std_error: size * of_excess(larger, freedom),
            p,
            nats: 0.5 * freedom * (larger - 1.0 - larger.ln()),
        })
    }
}

/// Relative standard error of a standard deviation that is the excess of a variance, `larger` times what is
/// expected and known with so many degrees of freedom.
pub fn of_excess(larger: f64, freedom: f64) -> f64 {
    larger / (larger - 1.0) / (2.0 * freedom).sqrt()
}

/// A line fitted to values in time.
pub struct AboutLine {
    /// Sums of squares about the line, and explained by it.
    pub scatter: f64,
    pub trend: f64,
    /// Change of the values per second.
    pub slope: f64,
}

impl AboutLine {
    /// Fits (time, value) pairs; `None` with fewer than three.
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

/// Mean residual of the target, frame by frame.
#[derive(Debug, Clone, Copy)]
pub struct Jitter {
    /// Squares about the line, px^2.
    pub about: Squares,
    /// Sum of squares explained by the line, px^2.
    pub trend_px2: f64,
    /// Velocity along the optical axis, m/s.
    pub velocity_mps: f64,
}

impl Jitter {
    /// Motion of the frames' means; `expected_px2` is the variance of each from its pixels' noise.
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
            about: Squares {
                sum: line.scatter,
                freedom: frames.len() as f64 - 2.0,
                expected: expected_px2,
            },
            trend_px2: line.trend,
            velocity_mps: -line.slope / disparity * z,
        })
    }
}

/// Positions of the target's pixels along two axes, uncorrelated and of unit variance.
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

/// Number of pixels used of a frame, and the slopes of their residuals, px at one standard
/// deviation from the centre.
fn slopes(field: &Field, residuals: &[f32], axes: &[[f64; 2]]) -> (f64, [f64; 2]) {
    let pixels = residuals.iter().zip(axes).zip(&field.sigma);
    let seen = pixels.filter(|((e, _), sigma)| e.abs() <= CLIP_SIGMAS * sigma.max(field.spread_px));
    let (a, b) = plane_equations(seen.map(|((&e, at), _)| (*at, f64::from(e), 1.0)));
    let n = a[(0, 0)];
    // Lost pixels shift the centre.
    (n, [1, 2].map(|axis| (b[axis] - a[(0, axis)] * b[0] / n) / n))
}

#[cfg(test)]
mod tests {
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::rng::Seed;

    /// Variances with 36 degrees of freedom, twice what is expected: the stated errors against the scatter of the
    /// sizes, which 400 draws show to 4 %.
    #[test]
    fn an_excess_errs_as_it_says() {
        let mut rng = Seed(1).stream("frame-series/excess");
        let mut draw = || {
            let mut square = || {
                let x: f64 = StandardNormal.sample(&mut rng);
                2.0 * x * x
            };
            let sum = (0..36).map(|_| square()).sum();
            let view = Squares { sum, freedom: 36.0, expected: 1.0 };
            Excess::of([view].into_iter(), 1.0, 1.0)
        };
        let all: Vec<Excess> = (0..400).filter_map(|_| draw()).collect();
        let n = all.len() as f64;
        let mean = all.iter().map(|e| e.size).sum::<f64>() / n;
        let scatter = (all.iter().map(|e| (e.size - mean).powi(2)).sum::<f64>() / n).sqrt();
        let truth = of_excess(2.0, 36.0);
        assert!(n > 395.0 && (scatter / truth - 1.0).abs() < 0.15, "{scatter} for {truth}");
    }
}
