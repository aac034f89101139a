//! The infrared amplitude at every pixel of a target.

use crate::diagnose::options::FRAMES_KEPT;
use crate::frame::Frame;
use crate::io::read_infrared;
use crate::stats::{MAD_TO_SIGMA, median_in_place};
use crate::view::View;

/// Half the side of the window that a pixel's light is read from, px: five across, or 100 readings in
/// four frames. This reduces a Kinect's read noise of 10.4 (Landau et al. 2015), the amplitude of paper at
/// 4 m, to 1.3; its matching window is 9 px.
const LIGHT_REACH: usize = 2;
/// Floor of the light in standard errors of that median; darker pixels cannot be told apart.
const SURE_LIGHT_ERRORS: f64 = 2.0;
/// Standard error of a Gaussian's median over that of its mean: the root of pi / 2.
const MEDIAN_ERROR: f64 = 1.2533;

/// Infrared amplitude at each pixel of a target, in the image's own units: the median of its neighbours
/// on the target in the view's first frames. The mean of dark pixels is too large because their noise is
/// clipped at zero. `None` without a readable image.
pub fn amplitudes(view: &View, on_target: &[bool], width: usize) -> Option<Vec<f32>> {
    let height = on_target.len() / width.max(1);
    let read = |f| read_infrared(f, [width, height]).ok();
    let images: Vec<Frame> =
        view.infrared.iter().filter_map(|f| read(&f.path)).take(FRAMES_KEPT).collect();
    let first = images.first()?;
    let mut near: Vec<u16> = Vec::new();
    let median = |i: usize| {
        let (u, v) = (i % width, i / width);
        let columns = u.saturating_sub(LIGHT_REACH)..(u + LIGHT_REACH + 1).min(width);
        near.clear();
        for row in v.saturating_sub(LIGHT_REACH)..(v + LIGHT_REACH + 1).min(height) {
            let places = row * width + columns.start..row * width + columns.end;
            for (k, _) in places.clone().zip(&on_target[places]).filter(|(_, on)| **on) {
                near.extend(images.iter().map(|image| image.raw[k]));
            }
        }
        let middle = near.len() / 2;
        *near.select_nth_unstable(middle).1
    };
    let pixels = || (0..on_target.len()).filter(|i| on_target[*i]);
    let medians: Vec<f32> = pixels().map(median).map(f32::from).collect();
    let apart = pixels().zip(&medians).map(|(i, m)| (f32::from(first.raw[i]) - m).abs());
    let noise = MAD_TO_SIGMA * f64::from(median_in_place(&mut apart.collect::<Vec<f32>>()));
    let readings = ((2 * LIGHT_REACH + 1).pow(2) * images.len()) as f64;
    let min = (SURE_LIGHT_ERRORS * MEDIAN_ERROR * noise / readings.sqrt()) as f32;
    Some(medians.into_iter().map(|m| m.max(min)).collect())
}

#[cfg(test)]
mod tests {
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::io::encode_png16;
    use crate::rng::Seed;
    use crate::view::{FrameRef, ViewNotes};

    const SIZE: [usize; 2] = [64, 48];
    /// Read noise, and the light of the two halves of the target, in words that start at zero.
    const NOISE: f64 = 10.4;
    const GREYS: [f64; 2] = [6.0, 40.0];

    /// Clipping at zero does not brighten the half that is darker than its own noise; the bright half keeps
    /// its light up to the edge between the two.
    #[test]
    fn light_is_the_middle_of_its_neighbours() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut rng = Seed(5).stream("light");
        let mut infrared = Vec::new();
        let mut mean = [0.0; 2];
        for k in 0..FRAMES_KEPT {
            let word = |i: usize| {
                let half = 2 * (i % SIZE[0]) / SIZE[0];
                let noise: f64 = StandardNormal.sample(&mut rng);
                let word = (GREYS[half] + NOISE * noise).round().max(0.0);
                mean[half] += 2.0 * word / (SIZE[0] * SIZE[1] * FRAMES_KEPT) as f64;
                word as u16
            };
            let raw = (0..SIZE[0] * SIZE[1]).map(word).collect();
            let path = folder.path().join(format!("{k}.png"));
            let image = Frame { width: SIZE[0], height: SIZE[1], raw };
            std::fs::write(&path, encode_png16(&image).expect("encoded")).expect("written");
            infrared.push(FrameRef { timestamp: 0.0, path, within: None });
        }
        assert!(mean[0] > 1.2 * GREYS[0], "a mean is too large where it is dark: {mean:?}");
        let view =
            View { name: "0".into(), depth: Vec::new(), infrared, notes: ViewNotes::default() };
        // The top rows are not on the target and get no values.
        let off = 4 * SIZE[0];
        let on_target: Vec<bool> = (0..SIZE[0] * SIZE[1]).map(|i| i >= off).collect();
        let light = amplitudes(&view, &on_target, SIZE[0]).expect("infrared");
        assert_eq!(light.len(), SIZE[0] * SIZE[1] - off);
        for (half, grey) in GREYS.iter().enumerate() {
            let column = |k: usize| k % SIZE[0];
            let inside = |k: &usize| column(*k).abs_diff(SIZE[0] / 2) > LIGHT_REACH;
            let mine = (0..light.len()).filter(|k| 2 * column(*k) / SIZE[0] == half && inside(k));
            let mine: Vec<f64> = mine.map(|k| f64::from(light[k])).collect();
            let n = mine.len() as f64;
            let level = mine.iter().sum::<f64>() / n;
            let scatter = (mine.iter().map(|l| (l - level).powi(2)).sum::<f64>() / n).sqrt();
            // Whole numbers, each with an error of 1.3: their mean is known to less than a tenth.
            assert!((level - grey).abs() < 0.3, "{level} of {grey}");
            assert!(scatter < 1.25 * MEDIAN_ERROR * NOISE / 10.0, "{scatter} at {grey}");
        }
        let without = View { infrared: Vec::new(), ..view };
        assert!(amplitudes(&without, &on_target, SIZE[0]).is_none());
    }
}
