//! Converts corrected depths to raw values that never mean "no measurement".

use crate::frame::{DepthCode, FARTHEST_M};

/// A depth code with its range.
#[derive(Debug, Clone)]
pub(super) struct RawCode {
    pub code: DepthCode,
    /// Raw values of the smallest and the largest depth.
    near: u16,
    far: u16,
}

impl RawCode {
    pub fn of(code: DepthCode) -> Self {
        let metres = |word: &u16| code.metres(*word).unwrap_or(f64::NAN);
        let valid = || (0..=u16::MAX).filter(|&w| code.metres(w).is_some_and(|z| code.raw(z) == w));
        let near = valid().min_by(|a, b| metres(a).total_cmp(&metres(b)));
        let far = valid().max_by(|a, b| metres(a).total_cmp(&metres(b)));
        RawCode { code, near: near.unwrap_or(0), far: far.unwrap_or(0) }
    }

    /// Raw value nearest to a positive depth (m), and whether the depth was clamped to the code's range.
    pub fn nearest(&self, z: f32) -> (u16, bool) {
        let metres = |word| self.code.metres(word).unwrap_or(f64::NAN);
        for (end, beyond) in
            [(self.near, z < metres(self.near) as f32), (self.far, z > metres(self.far) as f32)]
        {
            if beyond {
                return (end, true);
            }
        }
        let z = f64::from(z);
        let word = self.code.raw(z);
        if self.code.metres(word).is_some() {
            return (word, false);
        }
        // The neighbouring value that does not mean "no measurement": one step of the code nearer.
        let step = self.code.step_inverse(z) * z * z;
        (self.code.raw((z - step).max(metres(self.near))), false)
    }
}

/// Candidate raw values per metre, the finest first.
const UNITS: [f64; 6] = [10_000.0, 5000.0, 2000.0, 1000.0, 500.0, TOP / FARTHEST_M];
/// Largest raw value of a depth.
const TOP: f64 = 65534.0;

/// The finest metric code that reaches `max_m`.
pub(super) fn metric(max_m: f64) -> DepthCode {
    let fits = |units: &&f64| max_m * **units <= TOP;
    let units_per_metre = *UNITS.iter().find(fits).unwrap_or(&UNITS[UNITS.len() - 1]);
    DepthCode::Metric { units_per_metre, invalid: 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KINECT: DepthCode =
        DepthCode::Disparity { offset: 3.3309495161, slope: -0.0030711016, invalid: 2047 };

    #[test]
    fn every_depth_has_a_raw_value_that_is_a_measurement() {
        let odd = DepthCode::Metric { units_per_metre: 1000.0, invalid: 2000 };
        for code in [KINECT, odd, metric(4.0), metric(99.0)] {
            let raw = RawCode::of(code);
            for z in [1e-6, 0.3, 0.5, 1.999, 2.0, 2.001, 8.0, 70.0, 1e6, f32::INFINITY] {
                let (word, clamped) = raw.nearest(z);
                let back = code.metres(word).expect("a measurement");
                let off = (back - f64::from(z)).abs();
                let step = code.step_inverse(back) * back * back;
                assert!(clamped || off <= 1.01 * step, "{code:?} {z}: {back}");
            }
        }
    }

    #[test]
    fn raw_values_that_are_measurements_stay() {
        for code in [KINECT, metric(4.0)] {
            let raw = RawCode::of(code);
            for word in 1..1000 {
                let z = code.metres(word).expect("a measurement") as f32;
                assert_eq!(raw.nearest(z), (word, false));
            }
        }
    }

    #[test]
    fn the_finest_code_that_reaches_is_taken() {
        let units = |z| match metric(z) {
            DepthCode::Metric { units_per_metre, .. } => units_per_metre,
            DepthCode::Disparity { .. } => f64::NAN,
        };
        assert_eq!([units(4.0), units(8.0), units(20.0), units(60.0)], [1e4, 5e3, 2e3, 1e3]);
    }
}
