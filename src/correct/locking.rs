//! Inverts pixel locking, d - a sin(2 pi d).

use std::f64::consts::TAU;

/// Shifts to add to a locked disparity, tabulated over its phase.
#[derive(Debug, Clone)]
pub(crate) struct Locking {
    amplitude_px: f64,
    shifts: Vec<f64>,
}

/// Nodes for linear interpolation, a thousandth of a pixel apart. For an amplitude of a tenth of a pixel the
/// inverse has a curvature of a few px per px^2, and the error is 1e-6 px.
const NODES: usize = 1024;
/// Bisection steps: they shrink the bracket of twice the amplitude to below a millionth of it.
const HALVINGS: usize = 24;

impl Locking {
    pub fn new(amplitude_px: f64) -> Self {
        let node = |k: usize| shift(k as f64 / NODES as f64, amplitude_px);
        Locking { amplitude_px, shifts: (0..=NODES).map(node).collect() }
    }

    pub fn amplitude_px(&self) -> f64 {
        self.amplitude_px
    }

    /// Shifts at phases evenly spaced from 0 to 1, px.
    pub fn shifts(&self) -> &[f64] {
        &self.shifts
    }

    /// The disparity before locking, px.
    pub fn unlock(&self, locked: f64) -> f64 {
        let place = locked.rem_euclid(1.0) * NODES as f64;
        let k = (place as usize).min(NODES - 1);
        let t = place - k as f64;
        locked + self.shifts[k] * (1.0 - t) + self.shifts[k + 1] * t
    }
}

/// Shift from a locked disparity to one that locks to it. Above an amplitude of 1/(2 pi) px there are
/// several; bisection finds one of them.
fn shift(locked: f64, amplitude: f64) -> f64 {
    let (mut low, mut high) = (locked - amplitude, locked + amplitude);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if middle - amplitude * (TAU * middle).sin() < locked {
            low = middle
        } else {
            high = middle
        }
    }
    0.5 * (low + high) - locked
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_locked_comes_free() {
        for amplitude in [0.0, 0.05, 0.12] {
            let locking = Locking::new(amplitude);
            for k in 0..500 {
                let d = 10.0 + 0.0137 * f64::from(k);
                let locked = d - amplitude * (TAU * d).sin();
                assert!((locking.unlock(locked) - d).abs() < 2e-4, "{amplitude} {d}");
            }
        }
    }
}
