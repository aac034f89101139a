//! Temporal noise as defined by the Depth Quality Tool (`calculate_temporal_noise`): the median over the
//! pixels of the standard deviation of a pixel's depths over their median.

use crate::frame::DepthCode;
use crate::stats::median;

/// The raw values of a set of pixels over a view's frames.
pub(super) struct TemporalNoise {
    measured: Vec<Vec<u16>>,
    frames: usize,
}

/// Most frames kept: ten times what a vendor takes; a view's memory stays below 100 MB.
const MAX_FRAMES: usize = 100;

impl TemporalNoise {
    pub fn of(pixels: usize) -> Self {
        TemporalNoise { measured: vec![Vec::new(); pixels], frames: 0 }
    }

    /// Adds a frame's raw values, `None` where there is no depth.
    pub fn add(&mut self, raw: impl Iterator<Item = Option<u16>>) {
        if self.frames < MAX_FRAMES {
            self.frames += 1;
            self.measured.iter_mut().zip(raw).for_each(|(own, raw)| own.extend(raw));
        }
    }

    /// The noise as a share of the depth; `None` for a single frame. Pixels that were never measured are
    /// skipped.
    pub fn median_share(&self, code: &DepthCode) -> Option<f64> {
        let depths = |raw: &Vec<u16>| raw.iter().filter_map(|&r| code.metres(r)).collect();
        let measured = self.measured.iter().filter(|raw| !raw.is_empty());
        let mut shares: Vec<f64> = measured.map(|raw| share(depths(raw))).collect();
        (self.frames > 1 && !shares.is_empty()).then(|| median(&mut shares))
    }
}

fn share(mut depths: Vec<f64>) -> f64 {
    let count = depths.len() as f64;
    let mean = depths.iter().sum::<f64>() / count;
    let variance = depths.iter().map(|z| (z - mean).powi(2)).sum::<f64>() / count;
    variance.sqrt() / median(&mut depths)
}
