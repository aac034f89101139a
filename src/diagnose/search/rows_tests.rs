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
        // The first half of the samples also lists hats that are zero.
        let columns = |i: usize, row: &mut Entries| {
            let mut whole = [0.0; NODES + 1];
            fill(i, &mut whole);
            row.extend(whole.into_iter().enumerate().filter(|(_, g)| i < SAMPLES / 2 || *g != 0.0));
        };
        let mut blocks = Evidence::zeros(NODES + 2);
        rows.add_by_blocks(&mut blocks, |i| i / side, columns);
        blocks.a.fill_upper_triangle_with_lower_triangle();
        approx::assert_relative_eq!(blocks.a, plain.a, epsilon = 1e-9);
        approx::assert_relative_eq!(blocks.b, plain.b, epsilon = 1e-9);
        let scores = rows.scores_on(NODES + 1, columns);
        approx::assert_relative_eq!(
            scores,
            plain.b.rows(1, NODES + 1).into_owned(),
            epsilon = 1e-9
        );
    }
}
