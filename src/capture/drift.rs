//! Detects warm-up drift: while nothing moves, the measured plane should not move either.

/// Shortest still period that shows a drift, s.
const MIN_S: f64 = 20.0;
/// Smallest drift that counts, m/min at 1 m (it grows as z^2): in the half hour that a session lasts it adds
/// up to about a Kinect's sigma there (Khoshelham and Elberink: 1.4 mm z^2).
const MIN_DRIFT_M_PER_MINUTE: f64 = 5e-5;
/// ... and it must exceed this many standard errors.
const MIN_STD_ERRORS: f64 = 4.0;

/// Apparent drift of a still plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drift {
    /// Drift of the depth on the optical axis, m/min; positive if the plane seems to recede.
    pub per_minute_m: f64,
    /// Its standard error, m/min.
    pub std_error_m: f64,
    /// Depth of the plane, m.
    pub z_m: f64,
    /// Observation time, s.
    pub seconds: f64,
}

impl Drift {
    /// Whether the sensor is still warming up.
    pub fn is_warming(&self) -> bool {
        let size = self.per_minute_m.abs();
        size > MIN_STD_ERRORS * self.std_error_m
            && size > MIN_DRIFT_M_PER_MINUTE * self.z_m * self.z_m
    }
}

/// Fits a line to inverse depth over time.
#[derive(Debug, Clone, Default)]
pub struct DriftMonitor {
    /// Time, s, and inverse depth on the axis, 1/m.
    points: Vec<(f64, f64)>,
    reported_at_s: f64,
}

impl DriftMonitor {
    /// Adds one frame. The drift is reported after 20 s of stillness, and again
    /// whenever the time has doubled.
    pub fn add(&mut self, stamp: f64, inverse_depth: f64) -> Option<Drift> {
        self.points.push((stamp, inverse_depth));
        let seconds = stamp - self.points[0].0;
        if seconds < MIN_S.max(2.0 * self.reported_at_s) {
            return None;
        }
        self.reported_at_s = seconds;
        self.drift()
    }

    /// The drift so far, if there is enough data.
    pub fn drift(&self) -> Option<Drift> {
        let seconds = self.points.last()?.0 - self.points[0].0;
        let n = self.points.len() as f64;
        let mean = |of: &dyn Fn(f64, f64) -> f64| {
            self.points.iter().map(|&(t, w)| of(t, w)).sum::<f64>() / n
        };
        let (t, w) = (mean(&|t, _| t), mean(&|_, w| w));
        let spread = mean(&|ti, _| (ti - t).powi(2));
        if seconds < MIN_S || n < 10.0 || spread <= 0.0 {
            return None;
        }
        let slope = mean(&|ti, wi| (ti - t) * (wi - w)) / spread;
        let left = mean(&|ti, wi| (wi - w - slope * (ti - t)).powi(2));
        let error = (left / (n - 2.0) / spread).sqrt();
        let z_m = 1.0 / w;
        let per_minute = 60.0 * z_m * z_m;
        let (per_minute_m, std_error_m) = (-slope * per_minute, error * per_minute);
        Some(Drift { per_minute_m, std_error_m, z_m, seconds })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Seed;
    use rand_distr::{Distribution, StandardNormal};

    /// 40 s of a plane at 2 m that recedes by `rate` m/min, jittering by 0.1 mm a frame.
    fn watched(rate: f64) -> Drift {
        let mut rng = Seed(5).stream("jitter");
        let mut monitor = DriftMonitor::default();
        let mut reported = None;
        for k in 0..=1200 {
            let t = f64::from(k) / 30.0;
            let jitter: f64 = StandardNormal.sample(&mut rng);
            let z = 2.0 + rate * t / 60.0 + 1e-4 * jitter;
            reported = monitor.add(1e9 + t, 1.0 / z).or(reported);
        }
        reported.expect("reported after 20 and 40 s")
    }

    /// The slope's own standard error over 40 s is 1e-4 sqrt(12/1200)/40 * 60 = 1.5e-5 m/min.
    #[test]
    fn a_drift_is_measured_with_its_error() {
        let drift = watched(1e-3);
        assert!((drift.per_minute_m - 1e-3).abs() < 6e-5, "{drift:?}");
        assert!((drift.std_error_m / 1.5e-5 - 1.0).abs() < 0.2, "{drift:?}");
        assert!(drift.is_warming());
        assert!(watched(-1e-3).per_minute_m < 0.0);
    }

    #[test]
    fn a_steady_sensor_is_called_steady() {
        assert!(!watched(0.0).is_warming());
    }

    #[test]
    fn nothing_is_said_before_its_time() {
        let mut monitor = DriftMonitor::default();
        assert!((0..500).all(|k| monitor.add(f64::from(k) / 30.0, 0.5).is_none()));
    }
}
