//! Constant column errors under noise of known size.

use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::diagnose::noise::still::beside_bias;
use crate::plane::Plane;
use crate::rng::{Seed, Stream};

const SIZE: [usize; 2] = [64, 48];
const NOISE_PX: f64 = 0.04;

/// A view of the whole picture, facing the sensor.
fn field(rng: &mut Stream, error_px: impl Fn(usize) -> f64) -> Field {
    let [width, height] = SIZE;
    let n = width * height;
    let noisy = |i: usize| {
        let noise: f64 = StandardNormal.sample(rng);
        (error_px(i % width) + NOISE_PX * noise) as f32
    };
    Field {
        sigma: vec![NOISE_PX as f32; n],
        spread_px: NOISE_PX as f32,
        mean: (0..n).map(noisy).collect(),
        square: vec![0.01; n],
        count: vec![1; n],
        measured: vec![1; n],
        region_given: true,
        ..Field::unseen(Plane::tilted(1.0, 0.0, 0.0), 10.0, SIZE, (0..n as u32).collect())
    }
}

/// Columns with errors of alternating sign, which have no smooth part. Five standard errors (0.0013 px) for
/// 176 lines: a chance of 1e-4.
#[test]
fn each_column_is_met_and_rows_are_let_be() {
    let error_px = |u: usize| if u.is_multiple_of(2) { 0.05 } else { -0.05 };
    let mut rng = Seed(1).stream("lines");
    let fields: Vec<Field> = (0..20).map(|_| field(&mut rng, error_px)).collect();
    let learnt = |bias: &[Vec<f32>], axis| {
        LearntLines::of(&beside_bias(&fields, bias), axis).expect("views").profile
    };
    let [columns, rows] = [Axis::Column, Axis::Row].map(|axis| learnt(&[], axis));
    assert_eq!((columns.coefficients.len(), rows.coefficients.len()), (SIZE[0], SIZE[1]));
    let limit = 5.0 * NOISE_PX / f64::sqrt((20 * SIZE[1]) as f64);
    for (u, c) in columns.coefficients.iter().enumerate() {
        // At the borders boxes are short: a twentieth.
        assert!((c - error_px(u)).abs() < limit + 0.06 * 0.05, "{u}: {c}");
    }
    assert!(rows.coefficients.iter().all(|c| c.abs() < limit));
    // Known already: nothing is left.
    let known: Vec<Vec<f32>> = fields
        .iter()
        .map(|f| f.pixels.iter().map(|i| error_px(*i as usize % SIZE[0]) as f32).collect())
        .collect();
    assert!(learnt(&known, Axis::Column).coefficients.iter().all(|c| c.abs() < limit));
    assert!(LearntLines::of(&[], Axis::Row).is_none());
}

/// Alternating values on 640 lines through both boxes and back, without noise: right to 2e-3 inside, and to a
/// twentieth at the borders, where boxes are short.
#[test]
fn what_the_boxes_took_is_put_back() {
    const LINES: usize = 640;
    let truth = |k: usize| if k.is_multiple_of(2) { 1.0 } else { -1.0 };
    let beside_box = |values: &[f32], side: usize| -> Vec<f32> {
        let mean_of = |k: usize| {
            let near = &values[k.saturating_sub(side / 2)..LINES.min(k + side / 2 + 1)];
            near.iter().sum::<f32>() / near.len() as f32
        };
        (0..LINES).map(|k| values[k] - mean_of(k)).collect()
    };
    let lines: Vec<f32> = (0..LINES).map(truth).collect();
    let back = with_own_share(&beside_box(&beside_box(&lines, SMOOTH_PX), PIXEL_BOX));
    for (k, line) in back.iter().enumerate() {
        let limit = if (60..LINES - 60).contains(&k) { 2e-3 } else { 0.06 };
        assert!((line - truth(k)).abs() < limit, "{k}: {line}");
    }
}

/// A line of one view has no scatter, which is no certainty. The variance of two views of 10 to 1000 readings of
/// unit variance: within a tenth of the true one on average over 4000 draws, where the relative scatter of one is
/// 1.4, so that a tenth are 4.5 standard errors.
#[test]
fn a_lines_variance_is_that_of_its_mean() {
    assert_eq!(of_line([(300.0, 400.0)].into_iter()), (0.0, 0.0));
    let mut rng = Seed(3).stream("lines/variance");
    for sizes in [[400.0, 10.0], [500.0, 500.0], [1000.0, 100.0]] {
        let mut said = 0.0;
        for _ in 0..4000 {
            let sums = sizes.map(|k| {
                let noise: f64 = StandardNormal.sample(&mut rng);
                (f64::sqrt(k) * noise, k)
            });
            said += of_line(sums.into_iter()).1 / 4000.0;
        }
        let truth = 1.0 / sizes.iter().sum::<f64>();
        assert!((said / truth - 1.0).abs() < 0.1, "{sizes:?}: {said} for {truth}");
    }
}
