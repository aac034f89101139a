//! Shares of rows, patterns and rounding against simulated pixels.

use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::plane::Plane;
use crate::rng::Seed;

/// Four frames of a target with these pixels, `value` at the pixel of each index.
fn seen(sides: [usize; 2], pixels: Vec<u32>, mut value: impl FnMut(usize) -> f64) -> Field {
    let mut field = Field::unseen(Plane::default(), 40.0, sides, pixels);
    let n = field.pixels.len();
    field.first = (0..4).map(|_| (0..n).map(|k| value(k) as f32).collect()).collect();
    field.sigma = vec![1.0; n];
    field
}

/// Frames of a tilted plane in words of one step, half of whose noise is the same in all: the share is that of
/// the noise, whatever rounding adds. Twelve views give it to .002.
#[test]
fn rounding_lowers_no_share_that_stands_still() {
    const SIDE: usize = 120;
    const STILL: f64 = 0.5;
    const STEP_PX: f64 = 0.125;
    for steps in [0.35, 0.6, 0.8, 1.5] {
        let view = |seed: u64| {
            let mut rng = Seed(seed).stream("structure/rounding");
            let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
            let pixels: Vec<u32> = (0..(SIDE * SIDE) as u32).collect();
            let still: Vec<f64> = (0..SIDE * SIDE).map(|_| STILL.sqrt() * normal()).collect();
            let word = |i: usize| {
                let plane = 0.137 * (i % SIDE) as f64 + 0.071 * (i / SIDE) as f64;
                let noise = still[i] + (1.0 - STILL).sqrt() * normal();
                STEP_PX * ((plane + steps * noise).round() - plane)
            };
            let mut field = seen([SIDE; 2], pixels, word);
            let variance = STEP_PX.powi(2) * (steps.powi(2) + 1.0 / 12.0);
            field.sigma = vec![variance.sqrt() as f32; SIDE * SIDE];
            field.step_px = STEP_PX;
            structure(&field, &[]).0
        };
        let views: Vec<Structure> = (0..12).map(view).collect();
        for lag in 0..3 {
            let share = mean(views.iter().filter_map(|s| s.lagged[lag])).expect("four frames");
            assert!((share - STILL).abs() < 0.008, "{share} at lag {lag}, {steps} steps");
        }
    }
    let rounded = |steps: f64| before_rounding(0.4, 1.0, steps.powi(2) + 1.0 / 12.0);
    assert!(rounded(0.3).is_some() && rounded(0.28).is_none());
}

/// By hand: the noise of one frame is 1 px^2, that of a mean of four .25, and five other views share .16.
#[test]
fn an_error_that_views_share_inflates_their_mean() {
    let structure = Structure { variance_px2: 1.16, ..Structure::default() };
    let excess = structure.excess_of_pattern(0.16, 4.0, 6.0, &Correlation::white());
    approx::assert_relative_eq!(excess, 1.0 + 5.0 * 0.16 / (0.25 + 0.16), epsilon = 1e-12);
}

/// A square of white pixels whose rows share an error half as large: variance of a row's mean, and of its
/// mean square, over that of as many independent pixels.
#[test]
fn rows_that_err_alike_are_worth_less() {
    const SIDE: usize = 60;
    const ROWS: usize = 40_000;
    const ROW_PX: f64 = 0.5;
    let mut rng = Seed(3).stream("structure/rows");
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let (mut means, mut squares) = (Vec::new(), Vec::new());
    for _ in 0..ROWS {
        let row = ROW_PX * normal();
        let pixels: Vec<f64> = (0..SIDE).map(|_| row + normal()).collect();
        means.push(pixels.iter().sum::<f64>() / SIDE as f64);
        squares.push(pixels.iter().map(|p| p * p).sum::<f64>() / SIDE as f64);
    }
    let spread = |all: &[f64]| {
        let level = all.iter().sum::<f64>() / ROWS as f64;
        all.iter().map(|x| (x - level).powi(2)).sum::<f64>() / ROWS as f64
    };
    let power = 1.0 + ROW_PX * ROW_PX;
    let apart = [power / SIDE as f64, 2.0 * power * power / SIDE as f64];
    let truth = [spread(&means) / apart[0], spread(&squares) / apart[1]];
    let s = Structure {
        pixels: (SIDE * SIDE) as f64,
        variance_px2: power,
        row_px2: Some(ROW_PX * ROW_PX),
        ..Structure::default()
    };
    for (got, truth) in s.excess_of_rows(&Correlation::white()).iter().zip(truth) {
        // The pixel itself is one of the sixty in its row.
        assert!((got / truth - 1.0).abs() < 0.06, "{got}, by simulation {truth}");
    }
    let none = Structure { row_px2: Some(-1e-4), ..s };
    assert_eq!(none.excess_of_rows(&Correlation::white()), [1.0; 2]);
}

/// A target of the same noise elsewhere in the picture: images of it are cut to it.
#[test]
fn a_target_has_the_same_structure_wherever_it_is_seen() {
    const SIDE: usize = 80;
    let at = |[u0, v0]: [usize; 2]| {
        let mut rng = Seed(7).stream("structure/place");
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let [width, height] = [160, 120];
        let of_row = |v: usize| (v0 + v) * width + u0;
        // A corner of the target is missing.
        let pixels = (0..SIDE).flat_map(|v| (of_row(v)..of_row(v) + SIDE).skip(v / 4));
        let pixels: Vec<u32> = pixels.map(|i| i as u32).collect();
        let field = seen([width, height], pixels, |_| normal());
        let cut = field.cut_to_target();
        let kept: Vec<f32> =
            cut.image(&field.first[0]).into_iter().filter(|r| r.is_finite()).collect();
        assert!(kept == field.first[0] && [cut.width, cut.height] == [SIDE; 2]);
        structure(&field, &[]).0
    };
    let (here, there) = (at([0, 0]), at([71, 33]));
    assert!(here.lagged[0].is_some() && here.row_px2.is_some());
    let told =
        |s: &Structure| (s.pixels, s.variance_px2, s.lagged, s.row_px2, s.correlation_profile);
    assert_eq!(told(&here), told(&there));
}

/// The longest lag is 54 px.
#[test]
fn a_target_narrower_than_the_lags_has_a_structure() {
    for [width, height] in [[16, 110], [40, 110], [110, 40], [40, 16]] {
        let mut rng = Seed(8).stream("structure/narrow");
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let pixels = (0..height).flat_map(|v| (v * 160..).take(width));
        let pixels = pixels.map(|i| i as u32).collect();
        let field = seen([160, 120], pixels, |_| normal());
        let (s, _) = structure(&field, &[]);
        assert!(s.variance_px2 > 0.5 && s.lagged.iter().all(Option::is_some), "{width} x {height}");
    }
}
