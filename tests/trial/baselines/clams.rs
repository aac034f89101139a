//! A map of depth multipliers over the picture and the distance (Teichman, Miller and Thrun,
//! "Unsupervised intrinsic calibration of depth sensors via SLAM", RSS 2013).
//!
//! Their map's depth is here that of the plane; a cell's multiplier is fitted to what falls near it,
//! and read linearly between cells. Of the noise it says nothing.

use super::{Learnt, Tiles};

pub struct Clams;

/// Theirs has cells of 8 x 6 px of 640 x 480 and 2 m, and an hour of driving around.
const ACROSS: usize = 17;
const DOWN: usize = 13;
const CELL_M: f64 = 0.5;
/// Measurements of a multiplier of one that a cell starts with.
const CAUTION: f64 = 50.0;

struct Grid {
    size: [f64; 2],
    low_m: f64,
    deep: usize,
    scale_px_m: f64,
}

impl Grid {
    fn of(tiles: &Tiles) -> Self {
        let z = tiles.tiles.iter().map(|t| tiles.scale_px_m / t.at[2]);
        let (low, high) = z.fold((f64::MAX, f64::MIN), |(l, h), z| (l.min(z), h.max(z)));
        let camera = &tiles.sensor.camera;
        Grid {
            size: [camera.width as f64, camera.height as f64],
            low_m: low,
            deep: ((high - low) / CELL_M).ceil().max(1.0) as usize + 1,
            scale_px_m: tiles.scale_px_m,
        }
    }

    /// The eight cells about a place, and their shares.
    fn about(&self, [u, v, disparity]: [f64; 3]) -> [(usize, f64); 8] {
        let node = |share: f64, nodes: usize| {
            let place = share.clamp(0.0, 1.0) * (nodes - 1) as f64;
            let k = (place as usize).min(nodes - 2);
            (k, place - k as f64)
        };
        let (i, s) = node(u / (self.size[0] - 1.0), ACROSS);
        let (j, t) = node(v / (self.size[1] - 1.0), DOWN);
        let z = self.scale_px_m / disparity;
        let (k, r) = node((z - self.low_m) / (CELL_M * (self.deep - 1) as f64), self.deep);
        std::array::from_fn(|c| {
            let pick = |bit: usize, t: f64| if c >> bit & 1 == 1 { t } else { 1.0 - t };
            let at = |bit: usize, k: usize| k + (c >> bit & 1);
            let cell = (at(2, k) * DOWN + at(1, j)) * ACROSS + at(0, i);
            (cell, pick(0, s) * pick(1, t) * pick(2, r))
        })
    }
}

impl Clams {
    pub fn fit(tiles: &Tiles) -> Learnt {
        let grid = Grid::of(tiles);
        let n = ACROSS * DOWN * grid.deep;
        let (mut sum, mut weight) = (vec![0.0; n], vec![0.0; n]);
        for t in &tiles.tiles {
            // The plane's depth over the measured one is 1 + this.
            let excess = t.mean / t.at[2];
            for (cell, share) in grid.about(t.at) {
                sum[cell] += share * t.count * excess;
                weight[cell] += share * t.count;
            }
        }
        let cells: Vec<f64> =
            sum.iter().zip(&weight).map(|(s, w): (&f64, &f64)| s / (w + CAUTION)).collect();
        let bias = move |at: [f64; 3]| {
            // From a factor on the depth to px of disparity.
            at[2] * grid.about(at).iter().map(|&(k, share)| share * cells[k]).sum::<f64>()
        };
        Learnt { scale_px_m: tiles.scale_px_m, bias: Box::new(bias), log_variance: None, stride: 1 }
    }
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
            Tile { view: k % 3, at, mean: 0.01 * d, ratio: 1.0, variance: 0.01, count: 1e4 }
        };
        let tiles = Tiles { sensor, scale_px_m, tiles: (0..900).map(tile).collect() };
        let bias = Clams::fit(&tiles).bias;
        let at = [80.0, 60.0, scale_px_m / 1.5];
        assert!((bias(at) / at[2] - 0.01).abs() < 2e-4, "{}", bias(at) / at[2]);
    }
}
