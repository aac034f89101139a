//! Block-wise sums against sums over single samples.

use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::rng::Seed;

/// Hat functions along a line of samples, and one dense column.
#[test]
fn neighbourhoods_sum_to_what_single_samples_do() {
    const SAMPLES: usize = 200;
    const NODES: usize = 9;
    let mut rng = Seed(3).stream("rows");
    let mut draw = || -> f64 { StandardNormal.sample(&mut rng) };
    let response: Vec<f64> = (0..SAMPLES).map(|_| draw()).collect();
    // One in five has no weight.
    let weight: Vec<f64> =
        (0..SAMPLES).map(|i| if i % 5 == 0 { 0.0 } else { draw().abs() }).collect();
    let beside: Vec<f64> = (0..SAMPLES).flat_map(|i| [1.0, i as f64 / 100.0]).collect();
    let fill = |i: usize, row: &mut [f64]| {
        let place = i as f64 / SAMPLES as f64 * (NODES - 1) as f64;
        for (k, g) in row[..NODES].iter_mut().enumerate() {
            *g = (1.0 - (place - k as f64).abs()).max(0.0);
        }
        row[NODES] = (i as f64).cos();
    };
    // The second column of `beside` is a chosen term's, and is kept.
    let rows = Rows::new(&response, &weight, &beside, 2, &[0.5]).expect("a level");
    let plain = rows.reduce(NODES + 1, fill);
    for side in [1, 7, SAMPLES] {
        // The hats between the first and the last sample, and the dense column.
        let touched = |block: usize| -> Vec<usize> {
            let node = |i: usize| i.min(SAMPLES) * (NODES - 1) / SAMPLES;
            let last = (node((block + 1) * side) + 1).min(NODES - 1);
            (node(block * side)..=last).chain([NODES]).collect()
        };
        let few = |i: usize, row: &mut [f64]| {
            let mut whole = [0.0; NODES + 1];
            fill(i, &mut whole);
            row.iter_mut().zip(touched(i / side)).for_each(|(g, k)| *g = whole[k]);
        };
        let mut blocks = Evidence::zeros(NODES + 2);
        rows.add_by_blocks(&mut blocks, |i| i / side, touched, few);
        blocks.a.fill_upper_triangle_with_lower_triangle();
        approx::assert_relative_eq!(blocks.a, plain.a, epsilon = 1e-9);
        approx::assert_relative_eq!(blocks.b, plain.b, epsilon = 1e-9);
    }
}
