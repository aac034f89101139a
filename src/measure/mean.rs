//! The mean of a view's first frames, pixel by pixel, in which one bad frame counts for little.

use super::Workbench;
use crate::frame::Frame;
use crate::plane::MAD_TO_SIGMA;
use crate::stats::{median_in_place, range};

/// A reading so many usual deviations from the median of its pixel shows another scene.
const STRAY_SIGMAS: f32 = 10.0;
/// ... if it is so many steps of the sensor from it, too.
const STRAY_STEPS: f64 = 3.0;
/// Pixels that tell the usual deviation.
const ASKED: usize = 5000;

/// Mean over the frames, where at least half of them measured; 1/m, NaN elsewhere. Of three readings or more
/// those far from their median do not count: a stale or damaged frame would move the target.
pub(super) fn mean_inverse_depth(
    frames: &[Frame],
    bench: &Workbench<'_>,
    words_a_step: f64,
) -> Vec<f32> {
    let pixels = frames[0].raw.len();
    let mut w = Vec::with_capacity(frames.len());
    let read = |i: usize, w: &mut Vec<f32>| {
        w.clear();
        w.extend(frames.iter().map(|f| 1.0 / bench.table.metres(f.raw[i])));
        w.retain(|w| w.is_finite());
    };
    let mut off = Vec::new();
    for i in (0..pixels).step_by((pixels / ASKED).max(1)) {
        read(i, &mut w);
        let median = median_in_place(&mut w);
        off.extend(w.iter().map(|w| (w - median).abs()));
    }
    let usual = STRAY_SIGMAS * MAD_TO_SIGMA as f32 * median_in_place(&mut off);
    let mean = |i| {
        read(i, &mut w);
        if w.is_empty() || 2 * w.len() < frames.len() {
            return f32::NAN;
        }
        let [low, high] = range(w.iter().map(|&w| f64::from(w)));
        let far = usual.max((STRAY_STEPS * bench.step(words_a_step, low)) as f32);
        if w.len() > 2 && (high - low) as f32 > far {
            let median = median_in_place(&mut w.clone());
            let mut off: Vec<f32> = w.iter().map(|w| (w - median).abs()).collect();
            // Nearer or steeper places may be noisier than most.
            let far = far.max(STRAY_SIGMAS * MAD_TO_SIGMA as f32 * median_in_place(&mut off));
            w.retain(|w| (w - median).abs() <= far);
        }
        w.iter().sum::<f32>() / w.len() as f32
    };
    (0..pixels).map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::MeasureOptions;
    use crate::simulate::kinect_v1;

    #[test]
    fn a_stale_frame_does_not_move_the_mean_and_noise_is_averaged() {
        let sensor = kinect_v1(4);
        let bench = Workbench::new(&sensor, MeasureOptions::default());
        let (width, height) = (sensor.camera.width, sensor.camera.height);
        let frame = |word: u16| Frame { width, height, raw: vec![word; width * height] };
        let mean = |words: &[u16]| {
            let frames: Vec<Frame> = words.iter().map(|&word| frame(word)).collect();
            mean_inverse_depth(&frames, &bench, 1.0)[0]
        };
        let of = |words: &[u16]| {
            words.iter().map(|&w| 1.0 / bench.table.metres(w)).sum::<f32>() / words.len() as f32
        };
        assert_eq!(mean(&[7500, 7503, 7504, 12_000, 7498]), of(&[7500, 7503, 7504, 7498]));
        assert_eq!(mean(&[7500, 7503, 7504, 0, 7498]), of(&[7500, 7503, 7504, 7498]), "a hole");
        assert!(mean(&[7500, 0, 0]).is_nan());
        // Nobody knows which of two is right.
        assert_eq!(mean(&[7500, 12_000]), of(&[7500, 12_000]));
    }
}
