//! A distance somebody measured by other means, beside the one measured here.

/// Depth of the target's plane on the optical axis, twice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReferenceDistance {
    /// What `view.json` says, m.
    pub reference_m: f64,
    /// What the fitted plane says, m.
    pub measured_m: f64,
}

/// A tape is held to a case whose optical centre is not marked.
const TAPE_M: f64 = 0.005;
/// Of the distance: twice the most by which the 30 views of a calibrated Kinect v1 whose distance
/// is known (Herrera, Kannala and Heikkila 2012) differ, 0.46 %.
const SCALE_SHARE: f64 = 0.01;

impl ReferenceDistance {
    /// Measured minus reference, m: positive where the sensor sees the target too far away.
    pub fn off_m(&self) -> f64 {
        self.measured_m - self.reference_m
    }

    /// By how much the two may differ before something is wrong, m.
    pub fn tolerance_m(&self) -> f64 {
        TAPE_M + SCALE_SHARE * self.reference_m
    }

    /// Do the two differ by more than both can be wrong?
    pub fn contradicts(&self) -> bool {
        self.off_m().abs() > self.tolerance_m()
    }

    /// The tolerance in words.
    pub fn tolerance_words() -> String {
        format!("{:.0} mm and {:.0} % of the distance", 1e3 * TAPE_M, 1e2 * SCALE_SHARE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tape_may_be_off_by_a_little_on_either_side() {
        let off = |measured_m| ReferenceDistance { reference_m: 2.0, measured_m }.contradicts();
        assert!(!off(2.024) && !off(1.976));
        assert!(off(2.026) && off(1.974));
    }
}
