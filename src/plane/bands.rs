//! Finds the target across bands of columns that the firmware shifts by a step, which are no edges of it.
//!
//! The steps may have any height and any columns. Those of a Kinect, of one step of its depth code, do not
//! stop the search and are found more precisely by `measure::ColumnSteps`.

use super::image::{InverseDepthImage, Target};
use super::target::target_in;
use crate::rng::Stream;
use crate::stats::{even, median_in_place, range};
use crate::view::Region;

/// Columns in each of two windows on either side of a step: the inner ones give the step, both the slope.
const WINDOW: usize = 4;
/// Rows used, evenly over the image: the median of 120 has a standard error of an eighth of sigma.
const ROWS: usize = 120;
/// Fewest rows to judge a column.
const MIN_ROWS: usize = 30;
/// Share of the rows that may step the other way, by noise: objects in the scene end somewhere, while a band
/// of the firmware spans the whole picture.
const TAIL: f64 = 0.1;
/// Largest ratio of a step to the median of the steps, which are all one step of the firmware; others are the
/// vertical edges of a board that is higher than the picture.
const MAX_UNEQUAL: f64 = 2.0;
/// Bands are equally wide, but some steps may be hidden: distances are multiples of the least one, to this
/// share of it.
const UNEVEN: f64 = 0.15;
/// Fewest steps: three doors give two, and a Kinect has up to eight bands (OpenNI, GmcMode).
const MIN_STEPS: usize = 3;
/// Least height of a band's step, in steps of the depth code: most contours of a tilted plane are of one.
const MIN_CODE_STEPS: f64 = 1.5;
/// Where a larger share of the pixels equals the next one, the noise is below the code's step, and steps are
/// its contours.
const MAX_EQUAL: f64 = 0.8;

/// Finds the plane in `region`, or else the one at the principal point; or says why there is none.
pub fn find_target(
    image: &InverseDepthImage<'_>,
    region: Option<&Region>,
    rng: &mut Stream,
) -> Result<Target, String> {
    let target = target_in(image, region, rng);
    let Some(w) = without_bands(image) else { return target };
    let size = |target: &Target| target.pixels.len() as f64;
    let whole = target_in(&InverseDepthImage { w: &w, ..*image }, region, rng);
    match (&target, whole) {
        (Ok(found), Ok(whole)) if size(&whole) < CUT_BY_BANDS * size(found) => target,
        (_, Ok(mut whole)) => {
            whole.notes.push("it was found across columns that step alike in all rows".into());
            Ok(whole)
        }
        (_, Err(_)) => target,
    }
}

/// Least growth of the target without bands if they cut it off (of three bands two are lost). Other steps at
/// one column, such as contours of a steep plane, cut nothing off.
const CUT_BY_BANDS: f64 = 1.2;

/// The image without its bands; `None` where it has none.
///
/// Steps of a saw-tooth are equal and go one way. They are removed together with the slope between them, so
/// that the mean plane stays.
fn without_bands(image: &InverseDepthImage<'_>) -> Option<Vec<f32>> {
    let (width, steps) = (image.camera.width, bands_of(image)?);
    let stairs: Vec<f64> = (0..width)
        .map(|u| steps.iter().filter(|(at, _)| *at <= u).map(|(_, s)| f64::from(*s)).sum())
        .collect();
    let teeth = less_line(&stairs);
    Some(image.w.iter().enumerate().map(|(i, w)| w - teeth[i % width]).collect())
}

/// Steps of the firmware: equal, one way, at even distances, and larger than the code's.
fn bands_of(image: &InverseDepthImage<'_>) -> Option<Vec<(usize, f32)>> {
    let contour = MIN_CODE_STEPS * (image.step)(median_inverse_depth(image));
    let mut steps = steps(image);
    steps.retain(|(_, step)| f64::from(step.abs()) > contour);
    let usual = f64::from(median_in_place(&mut steps.iter().map(|s| s.1).collect::<Vec<_>>()));
    steps.retain(|(_, step)| {
        let share = f64::from(*step) / usual;
        (1.0 / MAX_UNEQUAL..=MAX_UNEQUAL).contains(&share)
    });
    let apart: Vec<f64> = steps.windows(2).map(|pair| (pair[1].0 - pair[0].0) as f64).collect();
    let [least, _] = range(apart.iter().copied());
    let even = |gap: &f64| (gap / least - (gap / least).round()).abs() < UNEVEN;
    if steps.len() < MIN_STEPS || !apart.iter().all(even) {
        return None;
    }
    let equal = image.w.windows(2).filter(|pair| pair[0] == pair[1]).count() as f64;
    let measured = image.w.iter().filter(|w| w.is_finite()).count() as f64;
    (equal < MAX_EQUAL * measured).then_some(steps)
}

fn median_inverse_depth(image: &InverseDepthImage<'_>) -> f64 {
    let stride = (image.w.len() / 3000).max(1);
    let mut some: Vec<f32> =
        image.w.iter().step_by(stride).copied().filter(|w| w.is_finite()).collect();
    median_in_place(&mut some).into()
}

/// First column after each step, and its height, 1/m.
fn steps(image: &InverseDepthImage<'_>) -> Vec<(usize, f32)> {
    let (width, height) = (image.camera.width, image.camera.height);
    if width < 4 * WINDOW {
        return Vec::new();
    }
    let rows = even([0.0, (height - 1) as f64], ROWS.min(height)).map(|row| row as usize);
    let heights: Vec<Vec<f32>> =
        rows.map(|row| heights(&image.w[row * width..(row + 1) * width])).collect();
    let step_at = |u: usize| {
        let mut there: Vec<f32> =
            heights.iter().map(|row| row[u]).filter(|h| h.is_finite()).collect();
        let tail = (TAIL * there.len() as f64) as usize;
        if there.len() < MIN_ROWS {
            return 0.0;
        }
        let median = median_in_place(&mut there);
        let other_way = there.iter().filter(|h| **h * median <= 0.0).count();
        if other_way > tail { 0.0 } else { median }
    };
    let all: Vec<f32> = (0..width).map(step_at).collect();
    // Next to a step the slopes of the windows give two of half its height.
    let highest = |u: usize| {
        let around = u.saturating_sub(2 * WINDOW)..=(u + 2 * WINDOW).min(width - 1);
        all[u] != 0.0 && around.into_iter().all(|other| all[other].abs() <= all[u].abs())
    };
    (0..width).filter(|u| highest(*u)).map(|u| (u, all[u])).collect()
}

/// Step of a row before each column, less its slope on either side; NaN where a pixel is missing.
fn heights(row: &[f32]) -> Vec<f32> {
    let mean = |from: usize| row[from..from + WINDOW].iter().sum::<f32>() / WINDOW as f32;
    let height = |u: usize| {
        if u < 2 * WINDOW || u + 2 * WINDOW > row.len() {
            return f32::NAN;
        }
        let [far_left, left] = [mean(u - 2 * WINDOW), mean(u - WINDOW)];
        let [right, far_right] = [mean(u), mean(u + WINDOW)];
        (right - left) - 0.5 * ((far_right - right) + (left - far_left))
    };
    (0..row.len()).map(height).collect()
}

/// Subtracts the best-fitting line.
fn less_line(values: &[f64]) -> Vec<f32> {
    let n = values.len() as f64;
    let (middle, mean) = (0.5 * (n - 1.0), values.iter().sum::<f64>() / n);
    let along = |i: usize| i as f64 - middle;
    let slope = values.iter().enumerate().map(|(i, v)| along(i) * v).sum::<f64>()
        / (0..values.len()).map(|i| along(i).powi(2)).sum::<f64>();
    values.iter().enumerate().map(|(i, v)| (v - mean - slope * along(i)) as f32).collect()
}

#[cfg(test)]
mod tests {
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::camera::Camera;
    use crate::rng::Seed;

    const NOISE: f64 = 0.001;

    /// A wall of slope `slope` (1/m per column) with noise and an added term.
    fn wall(slope: f64, more: impl Fn(usize, usize) -> f64) -> (Camera, Vec<f32>) {
        let camera = Camera::centred(320, 240, 290.0);
        let mut rng = Seed(7).stream("bands");
        let at = |i: usize| {
            let (u, v) = (i % 320, i / 320);
            let noise: f64 = StandardNormal.sample(&mut rng);
            (0.5 + slope * u as f64 + NOISE * noise + more(u, v)) as f32
        };
        (camera, (0..320 * 240).map(at).collect())
    }

    fn found(image: &(Camera, Vec<f32>)) -> Option<Vec<f32>> {
        in_code(image, 0.0)
    }

    /// With a depth code of this step, 1/m.
    fn in_code((camera, w): &(Camera, Vec<f32>), step: f64) -> Option<Vec<f32>> {
        let rays = camera.rays();
        without_bands(&InverseDepthImage { w, rays: &rays, camera, step: &|_| step })
    }

    /// Less than a sigma is left of a saw-tooth of either direction on a tilted wall.
    #[test]
    fn a_saw_tooth_goes_and_the_plane_stays() {
        for (slope, tooth) in [(0.0, 0.01), (5e-4, 0.01), (-5e-4, -0.03)] {
            let saw = |u: usize, _: usize| tooth * ((u + 13) as f64 / 53.0).fract();
            let found = found(&wall(slope, saw)).expect("bands");
            for (u, v) in [(40, 20), (160, 120), (300, 200)] {
                let mean: f32 = (u - 12..u + 12)
                    .flat_map(|u| (v - 12..v + 12).map(move |v| v * 320 + u))
                    .map(|i| found[i])
                    .sum::<f32>()
                    / 576.0;
                let plane = 0.5 + 0.5 * tooth + slope * (u as f64 - 0.5);
                assert!((f64::from(mean) - plane).abs() < NOISE, "{slope} {tooth} at {u}: {mean}");
            }
        }
    }

    /// The wall is found whole, with a note; a wall without bands is found as usual.
    #[test]
    fn bands_do_not_cut_the_target_off() {
        for (tooth, banded) in [(0.02, true), (0.0, false)] {
            let saw = |u: usize, _: usize| tooth * ((u + 13) as f64 / 53.0).fract();
            let (camera, w) = wall(0.0, saw);
            let rays = camera.rays();
            let image = InverseDepthImage { w: &w, rays: &rays, camera: &camera, step: &|_| 1e-3 };
            let target = find_target(&image, None, &mut Seed(1).stream("target")).expect("a wall");
            assert!(target.pixels.len() > 60_000, "{tooth}: {} pixels", target.pixels.len());
            assert_eq!(target.notes.iter().any(|note| note.contains("step alike")), banded);
        }
    }

    /// Contours of a depth code on a tilted plane have the height of its step.
    #[test]
    fn steps_of_the_code_are_no_bands() {
        let saw = |u: usize, _: usize| 0.01 * ((u + 13) as f64 / 53.0).fract();
        assert!(in_code(&wall(5e-4, saw), 0.005).is_some());
        assert!(in_code(&wall(5e-4, saw), 0.01).is_none());
    }

    /// Edges of a board, of shelves, of one door or of three are no bands of the firmware.
    #[test]
    fn what_stands_in_the_scene_is_no_band() {
        assert!(found(&wall(2e-4, |_, _| 0.0)).is_none());
        let board = |u: usize, _: usize| if (100..220).contains(&u) { 0.3 } else { 0.0 };
        assert!(found(&wall(0.0, board)).is_none());
        let shelf = |u: usize, v: usize| if v > 60 { 0.02 * (u / 80) as f64 } else { 0.0 };
        assert!(found(&wall(0.0, shelf)).is_none());
        let door = |u: usize, _: usize| if u > 200 { 0.02 } else { 0.0 };
        assert!(found(&wall(0.0, door)).is_none());
        let doors = |u: usize, _: usize| 0.02 * (u / 110) as f64;
        assert!(found(&wall(0.0, doors)).is_none());
    }
}
