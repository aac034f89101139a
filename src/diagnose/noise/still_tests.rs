//! Patterns of known size and shape, seen in views of different sizes.

use nalgebra::Vector3;
use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::diagnose::noise::structure::Structure;
use crate::diagnose::noise::view_mean::ViewMean;
use crate::plane::Plane;
use crate::simulate::kinect_v1;

const PATTERN_PX: f64 = 0.01;

const SIDES: [usize; 6] = [36, 48, 60, 100, 160, 220];

/// Measures targets of very different sizes, without noise, with this error at each pixel.
fn measured(pattern: impl Fn(usize) -> f64) -> Vec<Still> {
    let camera = kinect_v1(1).camera;
    let (width, height) = (camera.width, camera.height);
    let fields: Vec<Field> = SIDES
        .map(|side| {
            let at = |i: &usize| {
                let (u, v) = ((i % width).abs_diff(width / 2), (i / width).abs_diff(height / 2));
                2 * u.max(v) < side
            };
            let pixels: Vec<u32> = (0..width * height).filter(at).map(|i| i as u32).collect();
            let plane = Plane { q: Vector3::new(0.0, 0.0, 1.0) };
            let mut field = Field::unseen(plane, 40.0, [width, height], pixels);
            field.mean = field.pixels.iter().map(|&i| pattern(i as usize) as f32).collect();
            field
        })
        .into();
    still(&beside_bias(&fields, &[]), &KeptPattern::of(&fields))
}

/// Same, relative to the error's variance: pixels, columns, rows and means over a few pixels.
fn seen(pattern: impl Fn(usize) -> f64) -> Vec<[f64; 4]> {
    let all = |s: &Still| [s.fixed_px2, s.lines_px2[0], s.lines_px2[1], s.blotches_px2];
    let of_view = |s: &Still| all(s).map(|px2| px2.expect("large enough"));
    measured(pattern).iter().map(|s| of_view(s).map(|px2| px2 / PATTERN_PX.powi(2))).collect()
}

/// The means subtracted take 4 to 9 % of the variance of random signs (numpy), and lines share nothing.
#[test]
fn a_pattern_keeps_its_size_on_small_targets() {
    let mut rng = Seed(5).stream("still");
    let size = kinect_v1(1).camera;
    let mut toss = || if rng.random_bool(0.5) { PATTERN_PX } else { -PATTERN_PX };
    let pattern: Vec<f64> = (0..size.width * size.height).map(|_| toss()).collect();
    let seen = seen(|i| pattern[i]);
    // The coins' own products of different pixels add up to 0.03 on the smallest.
    for [fixed, columns, rows, _] in &seen {
        let of_lines = columns.abs().max(rows.abs());
        assert!((fixed - 1.0).abs() < 0.05 && of_lines < 0.05, "{seen:?}");
    }
    let mean = seen.iter().map(|s| s[0]).sum::<f64>() / seen.len() as f64;
    assert!((mean - 1.0).abs() < 0.02, "{mean}");
}

/// Over 60 independent patterns, the variance of a pattern and what its lines and its means over a few
/// pixels share scatter as stated. The coins, the same for all, have the error of one pattern.
#[test]
fn a_pattern_is_a_sample_of_its_pixels() {
    const PATTERNS: usize = 60;
    let mut rng = Seed(6).stream("still/sample");
    let size = kinect_v1(1).camera;
    let mut draw = || -> f64 { StandardNormal.sample(&mut rng) };
    let mut of_pattern = || {
        let pattern: Vec<f64> =
            (0..size.width * size.height).map(|_| PATTERN_PX * draw()).collect();
        let views: Vec<Structure> = measured(|i| pattern[i])
            .into_iter()
            .zip(SIDES)
            .map(|(still, side)| Structure {
                pixels: (side * side) as f64,
                still,
                ..Structure::default()
            })
            .collect();
        let mean = |of: fn(&Still) -> Option<f64>| {
            let share = |s: &Structure| Some(of(&s.still)? / PATTERN_PX.powi(2));
            ViewMean::of(&views, share).expect("views").value
        };
        let pixels = ViewMean::common_size(&views, |s| s.still.fixed_pixels);
        [
            [mean(|s| s.lines_px2[0]), mean(|s| Some(s.by_pattern_px2[0]))],
            [mean(|s| s.lines_px2[1]), mean(|s| Some(s.by_pattern_px2[1]))],
            [mean(|s| s.blotches_px2), mean(|s| Some(s.by_pattern_px2[2]))],
            [mean(|s| s.fixed_px2) - 1.0, (2.0 / pixels).sqrt()],
        ]
    };
    let all: Vec<[[f64; 2]; 4]> = (0..PATTERNS).map(|_| of_pattern()).collect();
    for k in 0..4 {
        let mean_of = |of: &dyn Fn(&[f64; 2]) -> f64| {
            all.iter().map(|found| of(&found[k])).sum::<f64>() / PATTERNS as f64
        };
        let (off, said) = (mean_of(&|[off, _]| *off), mean_of(&|[_, said]| *said));
        let scatter = mean_of(&|[x, _]| (x - off).powi(2)).sqrt();
        // For lines and means, the pattern's own error is one of two equal parts.
        let own = if k < 3 { said / 2f64.sqrt() } else { said };
        // A scatter of 60 has an error of a tenth. The common offset is the
        // error of the coins: beyond three standard errors with probability 0.0027 each.
        assert!((0.7..1.3).contains(&(scatter / own)), "{k}: {scatter}, said {own}");
        assert!(off.abs() < 3.0 * own, "{k}: off by {off}, said {own}");
    }
}

/// A wave of 16 px along the diagonal of the picture: what means over 7 px leave of it, less
/// means over 49 px, both in one dimension along either axis, squared. A pattern of single
/// pixels contributes nothing.
#[test]
fn waves_between_pixels_and_what_is_smooth_are_blotches() {
    let width = kinect_v1(1).camera.width;
    let period = 16.0 * 2f64.sqrt();
    let phase = |i: usize| std::f64::consts::TAU * (i % width + i / width) as f64 / period;
    let seen_wave = seen(|i| PATTERN_PX * 2f64.sqrt() * phase(i).sin());
    let along = |side: f64| {
        let x = std::f64::consts::PI / period;
        ((side * x).sin() / (side * x.sin())).powi(2)
    };
    let passed = (along(7.0) * (1.0 - along(49.0))).powi(2);
    let [_, _, _, largest] = seen_wave[5];
    assert!((largest / passed - 1.0).abs() < 0.1, "{largest} of {passed}");
    let mut rng = Seed(7).stream("still/pixels");
    let pixels: Vec<f64> = (0..width * 480)
        .map(|_| if rng.random_bool(0.5) { PATTERN_PX } else { -PATTERN_PX })
        .collect();
    assert!(seen(|i| pixels[i]).iter().all(|s| s[3].abs() < 0.01));
}

/// Columns alternate by two heights: 2/3 of four times their variance. Means over 49 and 7 px are 1/49
/// and -1/7 of a column's own error.
#[test]
fn columns_of_two_readouts_are_lines_and_no_pattern() {
    let width = kinect_v1(1).camera.width;
    let seen = seen(|i| if (i % width).is_multiple_of(2) { PATTERN_PX } else { -PATTERN_PX });
    let passed: f64 = (1.0 - 1.0 / 49.0) * (1.0 + 1.0 / 7.0);
    for [fixed, columns, rows, _] in &seen {
        assert!(fixed.abs().max(rows.abs()) < 0.01, "{seen:?}");
        assert!((columns - 8.0 / 3.0 * passed * passed).abs() < 0.04, "{seen:?}");
    }
}

/// Bands of many columns are shapes of the mean residual and hardly show in single lines.
#[test]
fn wide_bands_are_no_single_lines() {
    let width = kinect_v1(1).camera.width as f64;
    let wave = |i: usize| (i as f64 % width / 48.0 * std::f64::consts::TAU).sin();
    let seen = seen(|i| PATTERN_PX * wave(i));
    assert!(seen.iter().all(|[_, columns, ..]| columns.abs() < 0.002), "{seen:?}");
}

/// Each pair of views counts twice: of 400 recordings, 20 false alarms are expected at 5 %, and more than 36
/// have a chance of 3e-4. Without the factor for pairs there are 51.
#[test]
fn what_views_share_errs_as_pairs_do() {
    const OF: usize = 8;
    const PIXELS: usize = 400;
    let alarms = (0..400)
        .filter(|&seed| {
            let mut rng = Seed(seed).stream("noise/pairs");
            let images: Vec<Vec<f64>> = (0..OF)
                .map(|_| (0..PIXELS).map(|_| StandardNormal.sample(&mut rng)).collect())
                .collect();
            let sum: Vec<f64> = (0..PIXELS).map(|i| images.iter().map(|m| m[i]).sum()).collect();
            let with_others = |image: &Vec<f64>| {
                let products = image.iter().zip(&sum).map(|(r, s)| r * (s - r)).sum::<f64>();
                products / (PIXELS * (OF - 1)) as f64
            };
            let views: Vec<Structure> = images
                .iter()
                .map(|m| Structure {
                    pixels: PIXELS as f64,
                    still: Still { fixed_px2: Some(with_others(m)), ..Still::default() },
                    ..Structure::default()
                })
                .collect();
            ViewMean::of_pairs(&views, |s| s.still.fixed_px2).expect("a mean").p_above(0.0) < 0.05
        })
        .count();
    assert!(alarms <= 36, "{alarms} of 400");
}
