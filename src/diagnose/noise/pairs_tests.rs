//! Images of noise whose products are known.

use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::diagnose::noise::structure::Structure;
use crate::rng::Seed;
use crate::stats::noise_through_boxes;

const WIDTH: usize = 120;
const HEIGHT: usize = 90;
const BOX: usize = 5;

/// Statistics of a hundred images: unit noise on a plane, with holes, plus `more` of (u, v).
fn pairs(name: &str, rows: f64, more: impl Fn(usize, usize) -> f64) -> Vec<Pairs> {
    let one = |n: u64| {
        let mut rng = Seed(n).stream(name);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let shift: Vec<f64> = (0..HEIGHT).map(|_| rows * normal()).collect();
        let image: Vec<f32> = (0..WIDTH * HEIGHT)
            .map(|i| {
                let (u, v) = (i % WIDTH, i / WIDTH);
                let r = normal() + 0.02 * u as f64 + shift[v] + more(u, v);
                if u < 20 || (u + v) % 31 == 0 { f32::NAN } else { r as f32 }
            })
            .collect();
        Pairs::of(&image, WIDTH, 0.0).unwrap()
    };
    (0..100).map(one).collect()
}

#[track_caller]
fn near(all: &[Pairs], of: impl Fn(&Pairs) -> f64, truth: f64) {
    let values: Vec<f64> = all.iter().map(of).collect();
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let square = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let error = (square / n).sqrt();
    assert!((mean - truth).abs() < 4.0 * error, "{mean} +- {error}, not {truth}");
}

#[test]
fn white_noise_on_a_plane_shares_nothing() {
    let all = pairs("pairs/white", 0.0, |_, _| 0.0);
    for k in 0..2 {
        near(&all, |p| p.lines[k].row.unwrap(), 0.0);
        near(&all, |p| p.lines[k].column.unwrap(), 0.0);
        near(&all, |p| p.near[k], 0.0);
    }
}

/// Statistics of images of noise through boxes.
fn through_boxes(sides: [usize; 2], side: usize, images: u64) -> Vec<Pairs> {
    let one = |n: u64| {
        let mut rng = Seed(n).stream("pairs/window");
        let noise = noise_through_boxes(sides, side, &mut rng);
        let image: Vec<f32> = noise.into_iter().map(|r| r as f32).collect();
        Pairs::of(&image, sides[0], 0.0).unwrap()
    };
    (0..images).map(one).collect()
}

/// In a picture of three blocks a line, pairs of the first and the last lie at opposite
/// ends of the plane's slope.
#[test]
fn noise_through_a_window_shares_nothing_along_a_line() {
    let all = through_boxes([48, 48], BOX, 2000);
    near(&all, |p| p.lines[0].row.unwrap(), 0.0);
    near(&all, |p| p.lines[0].column.unwrap(), 0.0);
}

/// Eight hundred images give it to 2.5 %. The plane takes two of 47 independent rows,
/// and its slopes a little.
#[test]
fn what_lines_share_errs_as_is_said() {
    let all = through_boxes([160, 160], BOX, 800);
    let row = |p: &Pairs| p.lines[0].row.unwrap();
    let said = Structure {
        variance_px2: all.iter().map(|p| p.power).sum::<f64>() / all.len() as f64,
        window_px: Some(BOX as f64),
        line_pairs: all[0].lines[0].pairs,
        ..Structure::default()
    };
    let square = all.iter().map(|p| row(p).powi(2)).sum::<f64>() / all.len() as f64;
    let ratio = square.sqrt() / (said.variance_px2 * said.line_error(0));
    assert!((0.88..1.05).contains(&ratio), "{ratio}");
}

/// Eight hundred images of white noise give both errors to 2.5 %.
#[test]
fn white_noise_errs_as_is_said() {
    let all = through_boxes([96, 96], 1, 800);
    let power = all.iter().map(|p| p.power).sum::<f64>() / all.len() as f64;
    let said = Structure {
        pixels: (96 * 96) as f64,
        variance_px2: power,
        line_pairs: all[0].lines[1].pairs,
        ..Structure::default()
    };
    let rms = |of: &dyn Fn(&Pairs) -> f64| {
        (all.iter().map(|p| of(p).powi(2)).sum::<f64>() / all.len() as f64).sqrt() / power
    };
    let near = rms(&|p| p.near[0]) / all[0].near_variance.sqrt();
    assert!((0.9..1.1).contains(&near), "{near}");
    let row = rms(&|p| p.lines[1].row.unwrap()) / said.line_error(0);
    assert!((0.9..1.1).contains(&row), "{row}");
}

#[test]
fn what_rows_share_is_theirs_alone() {
    let all = pairs("pairs/rows", 0.2, |_, _| 0.0);
    for k in 0..2 {
        near(&all, |p| p.lines[k].row.unwrap(), 0.04 * (1.0 - 2.0 / HEIGHT as f64));
        near(&all, |p| p.lines[k].column.unwrap(), 0.0);
        near(&all, |p| p.near[k], 0.0);
    }
}
