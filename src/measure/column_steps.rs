//! Detects the column steps of a Kinect from a single depth image.
//!
//! Its firmware corrects the disparity linearly over the columns (GmcMode in OpenNI), in whole steps of the
//! read-out and anew for every image. Whole columns therefore step at even distances, counted from a step at
//! the middle column or next to it. No surface steps by as much at one column in all rows, so no plane is
//! needed to see them.

use statrs::distribution::{ContinuousCDF, Normal};

use crate::stats::{MAD_TO_SIGMA, median};

/// Steps at even distances from the middle of the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ColumnSteps {
    pub period_px: f64,
    /// Change of the disparity at a step, from left to right, px.
    pub step_px: f64,
    /// Mean of the steps over its standard error.
    pub t: f64,
    /// Position of the middle step between two columns, px: the next column is the first beyond it.
    middle_px: f64,
}

/// Read-out step of a Kinect v1 as a share of the width: an eighth of a px on 640 columns.
const READ_OUT_PX: f64 = 1.0 / 8.0 / 640.0;
/// Columns on either side used to detect a step (more average the noise), and to locate it.
const REACH: usize = 4;
const NEXT: usize = 1;
/// Largest change within a smooth side, and largest step of the firmware between both, in read-out steps.
const ROUGH: f64 = 2.0;
const TORN: f64 = 3.0;
/// A row's step is clipped to this, in read-out steps.
const CLIP: f64 = 1.5;
/// Least share of rows that must show a column.
const MIN_ROWS: f64 = 1.0 / 16.0;
const MIN_EDGES: usize = 3;
/// Resolution of the search for the middle and outermost steps, columns.
const FINE: f64 = 1.0 / 16.0;
/// Floor of the scatter of an image without noise, in read-out steps: the rounding left in a mean of rounded
/// numbers.
const ROUNDING: f64 = 1e-3;
/// Periods tried, as shares of the width: those of two Kinects are 41 to 110 of 640 px (72 images).
const PERIODS: [f64; 2] = [1.0 / 26.0, 1.0 / 3.2];
/// Threshold of t: 9.6 to 63 in 72 images of two Kinects; 5.0 or less in 157 simulated ones without steps,
/// most of them with other effects.
const CLEAR: f64 = 8.0;
/// Threshold of the median rise at the steps, in read-out steps: 0.87 or more in 38 images of a Kinect and
/// 0.51 in one; 0.05 or less for steep boards, whose noisier near columns pass for steps in their mean.
const WHOLE: f64 = 0.4;
/// Null distribution of t: the largest values of those 157 images match the maximum of this many independent
/// Gaussians of this standard deviation (half of them beyond 2.8, a hundredth beyond 4.4).
const LOOKS: f64 = 270.0;
const WIDER: f64 = 1.25;

impl ColumnSteps {
    /// Searches an image of disparities, px, NaN where there is none; `None` where no steps are significant.
    pub fn find(disparity: &[f32], width: usize) -> Option<Self> {
        let unit = READ_OUT_PX * width as f64;
        let steps = rises(disparity, width, unit, REACH);
        let mut seen = finite(&steps);
        if seen.len() < width / 4 {
            return None;
        }
        let middle = median(&mut seen);
        let mut off: Vec<f64> = seen.iter().map(|s| (s - middle).abs()).collect();
        let spread = (MAD_TO_SIGMA * median(&mut off)).max(ROUNDING * unit);
        // The outermost edges move by half a px from one trial period to the next.
        let [first, last] = PERIODS.map(|p| (p * width as f64).ln());
        let finer = 1.0 / width as f64;
        let tried =
            (0..=((last - first) / finer) as usize).map(|k| (first + k as f64 * finer).exp());
        let half = width as f64 / 2.0;
        let score = |period: f64| {
            // At the nearest columns.
            let edges = edges(&steps, [half - 0.5, period]);
            let (n, sum) = edges.fold((0, 0.0), |(n, s), e| (n + 1, s + e));
            let t = (sum / n as f64 - middle) * (n as f64).sqrt() / spread;
            (n >= MIN_EDGES && t.is_finite()).then_some((period, t))
        };
        let best = tried.filter_map(score).max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        let (period_px, t) = best.filter(|(_, t)| t.abs() > CLEAR)?;
        let step_px = unit.copysign(t);
        let next = rises(disparity, width, unit, NEXT);
        let slope = median(&mut finite(&next));
        let next: Vec<f64> = next.iter().map(|rise| (rise - slope) / step_px).collect();
        let [middle_px, period_px] = located(&next, period_px);
        let whole = median(&mut edges(&next, [middle_px, period_px]).collect::<Vec<_>>());
        let found = ColumnSteps { period_px, step_px, t: t.abs(), middle_px };
        (whole > WHOLE).then_some(found)
    }

    /// Error of a column's disparity, px: the steps less the line that they approximate.
    pub fn error_px(&self, column: usize) -> f64 {
        let steps = (column as f64 - self.middle_px) / self.period_px;
        self.step_px * (steps.floor() - steps + 0.5)
    }

    /// p-value: the probability that an image without steps shows as much.
    pub fn p(&self) -> f64 {
        (LOOKS * Normal::standard().sf(self.t / WIDER)).clamp(1e-300, 1.0)
    }
}

fn finite(rises: &[f64]) -> Vec<f64> {
    rises.iter().copied().filter(|rise| rise.is_finite()).collect()
}

/// The rises of the columns at the steps.
fn edges(rises: &[f64], [middle, period]: [f64; 2]) -> impl Iterator<Item = f64> {
    let reach = (rises.len() as f64 / 2.0 / period) as i64;
    let columns = (-reach..=reach).map(move |k| (middle + k as f64 * period).ceil() as usize);
    columns.filter_map(|u| rises.get(u).copied()).filter(|rise| rise.is_finite())
}

/// The middle and the period whose steps are at the largest rises between adjacent columns; the mean of all
/// that give equally large rises.
fn located(rises: &[f64], period_px: f64) -> [f64; 2] {
    let half = rises.len() as f64 / 2.0;
    let reach = (half / period_px).floor();
    // Offsets of the middle step and of the outermost, up to this many columns.
    let off = |columns: f64| {
        let n = (columns / FINE) as i32;
        (-n..=n).map(|k| f64::from(k) * FINE)
    };
    let tried = off(1.0).flat_map(|m| off(1.5).map(move |p| [half + m, period_px + p / reach]));
    let scored: Vec<([f64; 2], f64)> = tried.map(|at| (at, edges(rises, at).sum())).collect();
    let best = scored.iter().map(|s| s.1).fold(f64::NEG_INFINITY, f64::max);
    let alike: Vec<[f64; 2]> = scored.iter().filter(|s| s.1 >= best).map(|s| s.0).collect();
    [0, 1].map(|k| alike.iter().map(|a| a[k]).sum::<f64>() / alike.len() as f64)
}

/// Rise at each column: the mean of the `reach` columns from it on less that of those before, without the
/// slope; mean over the rows, px. NaN where few rows are smooth.
fn rises(disparity: &[f32], width: usize, unit: f64, reach: usize) -> Vec<f64> {
    let mut sums = vec![(0.0, 0.0); width];
    for row in disparity.chunks_exact(width) {
        for (u, pixels) in row.windows(2 * reach).enumerate() {
            let (left, right) = pixels.split_at(reach);
            let rises = [left, right].map(|side| f64::from(side[reach - 1] - side[0]));
            let sum = |side: &[f32]| side.iter().map(|d| f64::from(*d)).sum::<f64>();
            let apart = (sum(right) - sum(left)) / reach as f64;
            let smooth = rises.iter().all(|r| r.abs() <= ROUGH * unit) && apart.abs() < TORN * unit;
            if smooth && apart.is_finite() {
                // A single column on each side has no slope.
                let slope = 0.5 * (rises[0] + rises[1]) / (reach.max(2) - 1) as f64;
                let step = apart - slope * reach as f64;
                let (sum, n) = &mut sums[u + reach];
                *sum += step.clamp(-CLIP * unit, CLIP * unit);
                *n += 1.0;
            }
        }
    }
    let rows = disparity.len() as f64 / width as f64;
    let mean = |(sum, n): (f64, f64)| if n > MIN_ROWS * rows { sum / n } else { f64::NAN };
    sums.into_iter().map(mean).collect()
}

#[cfg(test)]
mod tests {
    use rand::Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::rng::{Seed, Stream};

    const WIDTH: usize = 640;
    const HEIGHT: usize = 240;
    const STEP_PX: f64 = 0.125;

    /// Disparities of a tilted wall with a box in front of it, in eighths of a px.
    fn image(rng: &mut Stream, stretch_px: impl Fn(f64) -> f64) -> Vec<f32> {
        let tilt: f64 = rng.random_range(-0.01..0.01);
        let mut pixel = |i: usize| {
            let (u, v) = ((i % WIDTH) as f64, (i / WIDTH) as f64);
            let near = if (200.0..330.0).contains(&u) && v > 150.0 { 9.0 } else { 0.0 };
            let noise: f64 = StandardNormal.sample(rng);
            let d = 30.0 + tilt * u + 0.004 * v + near + 0.06 * noise;
            ((d / STEP_PX).round() * STEP_PX + stretch_px(u)) as f32
        };
        (0..WIDTH * HEIGHT).map(&mut pixel).collect()
    }

    #[test]
    fn steps_are_found_whichever_way_they_go_and_taken_out() {
        let mut rng = Seed(2).stream("column-steps");
        for sign in [1.0, -1.0] {
            for (period, middle) in [(43.5, 320.0), (71.3, 319.6), (72.15, 319.8), (110.0, 320.7)] {
                let stretch = |u: f64| sign * STEP_PX * ((u - middle) / period).floor();
                let stepped = image(&mut rng, stretch);
                let found = ColumnSteps::find(&stepped, WIDTH).expect("steps");
                assert!((found.period_px / period - 1.0).abs() < 0.003, "{found:?}");
                assert_eq!(found.step_px, sign * STEP_PX);
                let line = |u: usize| sign * STEP_PX * ((u as f64 - middle) / period - 0.5);
                let off = |u: usize| stretch(u as f64) - line(u) - found.error_px(u);
                // No step is located even one column off.
                let largest = (0..WIDTH).map(|u| off(u).abs()).fold(0.0, f64::max);
                assert!(largest < 0.05 * STEP_PX, "{largest}");
            }
        }
    }

    /// A steep board in front of a wall, seen by a sensor whose noise grows with the disparity. In its near
    /// columns only rows that are smooth by chance count, and they are biased.
    #[test]
    fn noisy_columns_are_no_steps() {
        let mut rng = Seed(4).stream("column-steps/steep");
        for _ in 0..20 {
            let [near, edge]: [f64; 2] =
                [rng.random_range(50.0..90.0), rng.random_range(100.0..250.0)];
            let mut pixel = |i: usize| {
                let along = ((i % WIDTH) as f64 - edge) / (WIDTH as f64 - edge);
                let d = if along < 0.0 { 15.0 } else { 20.0 + (near - 20.0) * along };
                let noise: f64 = StandardNormal.sample(&mut rng);
                (d + (0.03 + 0.3 * (d / near).powi(2)) * noise) as f32
            };
            let steep: Vec<f32> = (0..WIDTH * HEIGHT).map(&mut pixel).collect();
            assert_eq!(ColumnSteps::find(&steep, WIDTH), None);
        }
    }

    #[test]
    fn a_scene_without_steps_shows_none() {
        let mut rng = Seed(3).stream("column-steps/none");
        for _ in 0..40 {
            assert_eq!(ColumnSteps::find(&image(&mut rng, |_| 0.0), WIDTH), None);
        }
        assert_eq!(ColumnSteps::find(&[], WIDTH), None);
        assert_eq!(ColumnSteps::find(&vec![f32::NAN; WIDTH * HEIGHT], WIDTH), None);
        assert_eq!(ColumnSteps::find(&vec![30.0; WIDTH * HEIGHT], WIDTH), None);
    }
}
