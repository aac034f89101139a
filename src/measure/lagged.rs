//! Correlation of a pixel with itself from frame to frame.

/// Half squared differences of a pixel's residual over one and two frames, over the first frames.
///
/// They estimate variance times 1 - rho(lag) without knowing the pixel's own mean, and for a
/// first-order filter rho(2) = rho(1)^2, so that their ratio is 1 + rho(1).
#[derive(Debug, Default)]
pub(super) struct Lagged {
    pub frames: usize,
    previous: Vec<f32>,
    before: Vec<f32>,
    one: Mean,
    two: Mean,
}

#[derive(Debug, Clone, Copy, Default)]
struct Mean {
    sum: f64,
    n: f64,
}

impl Mean {
    fn half_squared_differences(&mut self, a: &[f32], b: &[f32]) {
        for (&a, &b) in a.iter().zip(b) {
            let d = f64::from(b - a);
            if d.is_finite() {
                self.sum += 0.5 * d * d;
                self.n += 1.0;
            }
        }
    }

    fn value(&self) -> Option<f64> {
        (self.n > 0.0 && self.sum > 0.0).then(|| self.sum / self.n)
    }
}

impl Lagged {
    pub fn follow(&mut self, residuals: Vec<f32>) {
        self.one.half_squared_differences(&self.previous, &residuals);
        self.two.half_squared_differences(&self.before, &residuals);
        self.before = std::mem::replace(&mut self.previous, residuals);
    }

    /// Correlation of the moving part one frame apart; `None` with fewer than four frames.
    pub fn correlation(&self) -> Option<f64> {
        if self.frames < 4 {
            return None;
        }
        Some((self.two.value()? / self.one.value()? - 1.0).clamp(-1.0, 1.0))
    }
}
