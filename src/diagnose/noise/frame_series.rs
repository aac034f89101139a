//! What a view's frames measure one after the other, as a line in time and the scatter about it.

use crate::diagnose::views::field::Field;

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
