//! Chooses the 16-bit unit for float depths that loses least precision.

use crate::frame::{DepthCode, FARTHEST_M};

/// Statistics of a film's depths.
#[derive(Debug, Clone)]
pub struct Scale {
    /// Number of depths in each centimetre.
    counts: Vec<u64>,
    /// Number of depths that are whole multiples of each unit in [`EXACT`].
    whole: [u64; EXACT.len()],
    all: u64,
    /// Number of values beyond any measurable depth.
    far: u64,
}

/// Units per metre in which sensors measure: millimetres; TUM's; tenths of a millimetre.
const EXACT: [f64; 3] = [1000.0, 5000.0, 10_000.0];
/// If none is exact, the finest of these that reaches far enough.
const UNITS: [f64; 6] = [50_000.0, 20_000.0, 10_000.0, 5000.0, 2000.0, 1000.0];
/// Largest share of depths allowed beyond the range of the words, or off the lattice.
const MAX_STRAYS: f64 = 1e-4;
const BINS_PER_METRE: f64 = 100.0;

impl Scale {
    pub fn new() -> Self {
        let bins = (FARTHEST_M * BINS_PER_METRE) as usize;
        Scale { counts: vec![0; bins], whole: [0; EXACT.len()], all: 0, far: 0 }
    }

    pub fn add(&mut self, metres: &[f32]) {
        for z in metres.iter().map(|&z| f64::from(z)) {
            if !(z > 0.0 && z < FARTHEST_M) {
                self.far += u64::from(z >= FARTHEST_M && z.is_finite());
                continue;
            }
            self.all += 1;
            self.counts[(z * BINS_PER_METRE) as usize] += 1;
            for (whole, units) in self.whole.iter_mut().zip(EXACT) {
                let steps = z * units;
                // Within the precision of a 32-bit float.
                let near = (steps - steps.round()).abs() <= steps * f64::from(f32::EPSILON);
                *whole += u64::from(near);
            }
        }
    }

    pub fn merged(mut self, other: Self) -> Self {
        self.counts.iter_mut().zip(&other.counts).for_each(|(a, b)| *a += b);
        self.whole.iter_mut().zip(other.whole).for_each(|(a, b)| *a += b);
        self.all += other.all;
        self.far += other.far;
        self
    }

    /// Number of depths beyond the range of words in this unit.
    fn beyond(&self, units: f64) -> u64 {
        let last = (f64::from(u16::MAX) / units * BINS_PER_METRE) as usize;
        self.counts.iter().skip(last).sum()
    }

    /// The depth code, and a remark on it. Fails if these are not depths in metres.
    pub fn code(&self) -> Result<(DepthCode, Option<String>), String> {
        let few = |n: u64| n as f64 <= MAX_STRAYS * self.all as f64;
        let reaches = |units: f64| few(self.beyond(units));
        let mut exact = EXACT.iter().zip(self.whole);
        let fits = |&(&units, whole): &(&f64, u64)| few(self.all - whole) && reaches(units);
        let code = |units_per_metre| DepthCode::Metric { units_per_metre, invalid: 0 };
        if self.far > self.all {
            return Err(format!("most values are above {FARTHEST_M}, which metres are not"));
        }
        if self.all == 0 {
            return Err("no image holds a depth".into());
        }
        if let Some((&units, _)) = exact.find(fits) {
            return Ok((code(units), None));
        }
        let coarsest = UNITS[UNITS.len() - 1];
        let units = UNITS.into_iter().find(|&u| reaches(u)).unwrap_or(coarsest);
        let mut said = format!("depths are floats and are held in steps of {} mm", 1e3 / units);
        match self.beyond(units) {
            0 => {}
            n => said += &format!("; {n} beyond {:.1} m are left out", 65_535.0 / units),
        }
        Ok((code(units), Some(said)))
    }
}

/// Depths as words; 0 if there is no depth or it is out of range.
pub fn words(metres: &[f32], units_per_metre: f64) -> Vec<u16> {
    let word = |&z: &f32| {
        let steps = (f64::from(z) * units_per_metre).round();
        if (1.0..65_536.0).contains(&steps) { steps as u16 } else { 0 }
    };
    metres.iter().map(word).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn code(depths: impl Iterator<Item = f32>) -> (f64, Option<String>) {
        let mut scale = Scale::new();
        scale.add(&depths.collect::<Vec<f32>>());
        match scale.code().unwrap() {
            (DepthCode::Metric { units_per_metre, .. }, said) => (units_per_metre, said),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn millimetres_in_metres_come_back_exactly() {
        let mm = 300..9000u16;
        let metres: Vec<f32> = mm.clone().map(|v| f32::from(v) * 0.001).collect();
        assert_eq!(code(metres.iter().copied()), (1000.0, None));
        assert_eq!(words(&metres, 1000.0), mm.collect::<Vec<u16>>());
        assert_eq!(code((300..9000u16).map(|v| f32::from(v) / 10_000.0)), (10_000.0, None));
    }

    #[test]
    fn other_depths_take_the_finest_unit_that_reaches() {
        let spread =
            |far: f32| (0..5000).map(move |i| 0.3 + (far - 0.3) * (i as f32 / 5000.0).sqrt());
        assert_eq!(code(spread(1.2)).0, 50_000.0);
        assert_eq!(code(spread(6.0)).0, 10_000.0);
        let (units, said) = code(spread(12.0));
        assert_eq!(units, 5000.0);
        assert!(said.unwrap().contains("steps of 0.2 mm"));
        assert_eq!(words(&[f32::NAN, f32::INFINITY, -1.0, 0.0, 14.0], 5000.0), [0; 5]);
    }
}
