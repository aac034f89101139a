//! Map of depth multipliers over the image and the distance (Teichman, Miller and Thrun, "Unsupervised
//! intrinsic calibration of depth sensors via SLAM", RSS 2013).
//!
//! Here the plane takes the place of their map's depth. A cell's multiplier is fitted to the measurements
//! near it and interpolated linearly between cells.

use super::{Learnt, Tiles};

/// Size of the grid. Theirs has cells of 8 x 6 px of 640 x 480 and 2 m, and an hour of driving around.
const ACROSS: usize = 17;
const DOWN: usize = 13;
const CELL_M: f64 = 0.5;
/// Prior of each cell: this many measurements of a multiplier of one.
const CAUTION: f64 = 50.0;

pub fn fit(tiles: &Tiles) -> Learnt {
    let (camera, scale_px_m) = (&tiles.sensor.camera, tiles.scale_px_m);
    let [low, high] = kinoise::stats::range(tiles.tiles.iter().map(|t| scale_px_m / t.at[2]));
    let deep = ((high - low) / CELL_M).ceil().max(1.0) as usize + 1;
    let size = [camera.width as f64 - 1.0, camera.height as f64 - 1.0];
    // The eight cells around a place, with their interpolation weights.
    let about = move |[u, v, disparity]: [f64; 3]| -> [(usize, f64); 8] {
        let node = |share: f64, nodes: usize| {
            let place = share.clamp(0.0, 1.0) * (nodes - 1) as f64;
            let k = (place as usize).min(nodes - 2);
            (k, place - k as f64)
        };
        let (i, s) = node(u / size[0], ACROSS);
        let (j, t) = node(v / size[1], DOWN);
        let (k, r) = node((scale_px_m / disparity - low) / (CELL_M * (deep - 1) as f64), deep);
        std::array::from_fn(|c| {
            let pick = |bit: usize, t: f64| if c >> bit & 1 == 1 { t } else { 1.0 - t };
            let at = |bit: usize, k: usize| k + (c >> bit & 1);
            let cell = (at(2, k) * DOWN + at(1, j)) * ACROSS + at(0, i);
            (cell, pick(0, s) * pick(1, t) * pick(2, r))
        })
    };
    let mut sums = vec![[0.0; 2]; ACROSS * DOWN * deep];
    for t in &tiles.tiles {
        for (cell, share) in about(t.at) {
            // The plane's depth over the measured one is 1 + mean / disparity.
            sums[cell][0] += share * t.count * t.mean / t.at[2];
            sums[cell][1] += share * t.count;
        }
    }
    let cells: Vec<f64> = sums.iter().map(|[sum, weight]| sum / (weight + CAUTION)).collect();
    // From a factor on the depth to px of disparity.
    let bias = move |at: [f64; 3]| {
        at[2] * about(at).iter().map(|&(k, share)| share * cells[k]).sum::<f64>()
    };
    Learnt { scale_px_m, bias: Box::new(bias), stride: 1 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::baselines::Tile;
    use kinoise::simulate::kinect_v1;

    #[test]
    fn a_constant_factor_on_the_depth_is_learnt() {
        let sensor = kinect_v1(4);
        let scale_px_m = crate::predictor::scale_px_m(&sensor);
        let tile = |k: usize| {
            let d = scale_px_m / (1.0 + 0.5 * (k % 3) as f64);
            let at = [(k * 7 % 160) as f64, (k * 11 % 120) as f64, d];
            Tile { view: k % 3, at, mean: 0.01 * d, variance: 0.01, count: 1e4 }
        };
        let tiles = Tiles { sensor, scale_px_m, tiles: (0..900).map(tile).collect() };
        let bias = fit(&tiles).bias;
        let at = [80.0, 60.0, scale_px_m / 1.5];
        assert!((bias(at) / at[2] - 0.01).abs() < 2e-4, "{}", bias(at) / at[2]);
    }
}
