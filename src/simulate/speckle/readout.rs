//! From shifts to 11-bit words.

use super::reference::REFERENCE_M;
use crate::frame::{DepthCode, KINECT_NO_MEASUREMENT};

/// The word that stands for infinity on a Kinect v1 (Fisher's 3.331 / 0.003071, OpenKinect).
const WORD_AT_INFINITY: f64 = 1084.6;

/// How a shift becomes a word, and a word a depth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReadOut {
    step_px: f64,
    /// fx * baseline, px m.
    disparity_px_m: f64,
    /// Of a surface where the reference was.
    word_at_reference: f64,
}

impl ReadOut {
    /// `nearest_px`: the largest shift there is.
    pub fn new(step_px: f64, disparity_px_m: f64, nearest_px: f64) -> Self {
        let usual = WORD_AT_INFINITY - disparity_px_m / REFERENCE_M / step_px;
        // Finer steps need more words; the nearest surface gets at least word 1.
        let least = nearest_px / step_px + 1.0;
        ReadOut { step_px, disparity_px_m, word_at_reference: usual.max(least).round() }
    }

    pub fn word(&self, shift_px: f32) -> u16 {
        let word = self.word_at_reference - (f64::from(shift_px) / self.step_px).round();
        let fits = word > 0.0 && word < f64::from(KINECT_NO_MEASUREMENT);
        if fits { word as u16 } else { KINECT_NO_MEASUREMENT }
    }

    /// shift = fx b (1/z - 1/reference) and shift = (word_at_reference - word) step, hence
    /// 1/z = 1/reference + (word_at_reference - word) step / (fx b).
    pub fn code(&self) -> DepthCode {
        let per_word = self.step_px / self.disparity_px_m;
        DepthCode::Disparity {
            offset: 1.0 / REFERENCE_M + self.word_at_reference * per_word,
            slope: -per_word,
            invalid: KINECT_NO_MEASUREMENT,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against triangulation, written down again.
    #[test]
    fn words_and_depths_agree_with_triangulation() {
        let read_out = ReadOut::new(0.125, 43.5, 90.0);
        for z in [0.5, 1.0, 2.0, 3.3] {
            let shift = 580.0 * 0.075 / z - 580.0 * 0.075 / REFERENCE_M;
            let word = read_out.word(shift as f32);
            let found = read_out.code().metres(word).unwrap();
            assert!((found - z).abs() <= 0.5 * 2.88e-3 * z * z, "{z}: {found}");
        }
        let DepthCode::Disparity { offset, slope, .. } = read_out.code() else { unreachable!() };
        assert!((offset / -slope - 1084.6).abs() < 1.0, "infinity is where a Kinect has it");
    }
}
