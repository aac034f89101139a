//! Robust mean of a view's first frames, pixel by pixel.

use super::Workbench;
use super::follow::MAJORITY;
use crate::frame::{DepthTable, Frame};
use crate::plane::MAD_TO_SIGMA;
use crate::stats::median_in_place;

/// A reading shows another scene if it is this many typical standard deviations from its pixel's median ...
const STRAY_SIGMAS: f32 = 10.0;
/// ... and also this many steps of the sensor.
const STRAY_STEPS: f32 = 3.0;
/// Pixels sampled for the typical standard deviation.
const ASKED: usize = 5000;
/// A frame with a larger share of strays is left out entirely: it has none where its scene crosses the right
/// one.
const MAX_STRAYS: f64 = 0.2;

/// Mean over the frames, 1/m, where at least half of them have a depth; NaN elsewhere. With three readings or
/// more, those far from their median do not count: a stale or damaged frame would move the target.
pub(super) fn mean_inverse_depth(
    frames: &[Frame],
    bench: &Workbench<'_>,
    words_a_step: f64,
) -> Vec<f32> {
    let asked = asked(frames, &bench.table);
    let usual = usual_scatter(&asked);
    let far = |w: f32| {
        f32::max(STRAY_SIGMAS * usual, STRAY_STEPS * bench.step(words_a_step, f64::from(w)) as f32)
    };
    let frames = &of_one_scene(frames, &asked, far)[..];
    let mut w: Vec<f32> = Vec::with_capacity(frames.len());
    let mean = |i: usize| {
        w.clear();
        w.extend(
            frames.iter().map(|f| 1.0 / bench.table.metres(f.raw[i])).filter(|w| w.is_finite()),
        );
        let n = w.len();
        if n == 0 || 2 * n < frames.len() {
            return f32::NAN;
        }
        let [low, high] = w.iter().fold([f32::INFINITY, 0.0], |[a, b], w| [a.min(*w), b.max(*w)]);
        if n >= MAJORITY && high - low > STRAY_SIGMAS * usual && high - low > far(low) {
            return without_strays(w.clone(), far(low));
        }
        w.iter().sum::<f32>() / n as f32
    };
    (0..frames[0].raw.len()).map(mean).collect()
}

/// Samples pixels spread over the picture: for each, the median over the frames, 1/m, and each frame's
/// difference from it, NaN where it has no depth.
fn asked(frames: &[Frame], table: &DepthTable) -> Vec<(f32, Vec<f32>)> {
    let pixels = frames[0].raw.len();
    let of_pixel = |i: usize| {
        let w: Vec<f32> = frames.iter().map(|f| 1.0 / table.metres(f.raw[i])).collect();
        let mut measured: Vec<f32> = w.iter().copied().filter(|w| w.is_finite()).collect();
        let median = median_in_place(&mut measured);
        (median, w.into_iter().map(|w| w - median).collect())
    };
    (0..pixels).step_by((pixels / ASKED).max(1)).map(of_pixel).collect()
}

/// The frames without those that show another scene than most.
fn of_one_scene<'f>(
    frames: &'f [Frame],
    asked: &[(f32, Vec<f32>)],
    far: impl Fn(f32) -> f32,
) -> Vec<&'f Frame> {
    let measured = |off: &&Vec<f32>| off.iter().filter(|off| off.is_finite()).count();
    let told: Vec<(f32, &Vec<f32>)> = asked
        .iter()
        .map(|(median, off)| (far(*median), off))
        .filter(|(_, off)| measured(off) >= MAJORITY)
        .collect();
    let right = |frame: usize| {
        let off = || told.iter().map(|(far, off)| (far, off[frame].abs()));
        let measured = off().filter(|(_, off)| off.is_finite()).count();
        let strays = off().filter(|(far, off)| off.is_finite() && off > *far).count();
        strays as f64 <= MAX_STRAYS * measured as f64
    };
    let kept: Vec<&Frame> = (0..frames.len()).filter(|&k| right(k)).map(|k| &frames[k]).collect();
    if 2 * kept.len() > frames.len() { kept } else { frames.iter().collect() }
}

/// Typical standard deviation of a reading about its pixel's median, 1/m: the median over the picture.
fn usual_scatter(asked: &[(f32, Vec<f32>)]) -> f32 {
    let off = asked.iter().flat_map(|(_, off)| off).map(|off| off.abs());
    let mut off: Vec<f32> = off.filter(|off| off.is_finite()).collect();
    MAD_TO_SIGMA as f32 * median_in_place(&mut off)
}

/// Mean of the readings within `far` of their median, or within the scatter of a noisier pixel.
fn without_strays(mut w: Vec<f32>, far: f32) -> f32 {
    let median = median_in_place(&mut w.clone());
    let mut off: Vec<f32> = w.iter().map(|w| (w - median).abs()).collect();
    let far = far.max(STRAY_SIGMAS * MAD_TO_SIGMA as f32 * median_in_place(&mut off));
    w.retain(|w| (w - median).abs() <= far);
    w.iter().sum::<f32>() / w.len() as f32
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
        // Of two readings, either may be right.
        assert_eq!(mean(&[7500, 12_000]), of(&[7500, 12_000]));
    }
}
