//! A map of depth multipliers over the picture and the distance (Teichman, Miller and Thrun,
//! "Unsupervised intrinsic calibration of depth sensors via SLAM", RSS 2013).
//!
//! Their map's depth is here that of the plane; a cell's multiplier is fitted to what falls near it,
//! and read linearly between cells. Of the noise it says nothing.

use super::learnt::{Learnt, each};
use super::tiles::Tiles;
use super::{Baseline, Fitted};
use crate::camera::Camera;
use crate::error::Result;
use crate::terms::PixelContext;

#[derive(Debug, Clone, Copy)]
pub struct Clams;

/// Theirs has cells of 8 x 6 px of 640 x 480 and 2 m, and an hour of driving around.
const ACROSS: usize = 17;
const DOWN: usize = 13;
const CELL_M: f64 = 0.5;
/// Measurements of a multiplier of one that a cell starts with.
const CAUTION: f64 = 50.0;

struct Grid {
    width: f64,
    height: f64,
    low_m: f64,
    deep: usize,
}

impl Grid {
    fn of(camera: &Camera, [low, high]: [f64; 2]) -> Self {
        let deep = ((high - low) / CELL_M).ceil().max(1.0) as usize + 1;
        Grid { width: camera.width as f64, height: camera.height as f64, low_m: low, deep }
    }

    fn len(&self) -> usize {
        ACROSS * DOWN * self.deep
    }

    /// The eight cells about a place, and their shares.
    fn about(&self, p: &PixelContext) -> [(usize, f64); 8] {
        let node = |share: f64, nodes: usize| {
            let place = share.clamp(0.0, 1.0) * (nodes - 1) as f64;
            let k = (place as usize).min(nodes - 2);
            (k, place - k as f64)
        };
        let (i, s) = node(p.u / (self.width - 1.0), ACROSS);
        let (j, t) = node(p.v / (self.height - 1.0), DOWN);
        let way = (p.z - self.low_m) / (CELL_M * (self.deep - 1) as f64);
        let (k, r) = node(way, self.deep);
        std::array::from_fn(|c| {
            let pick = |bit: usize, t: f64| if c >> bit & 1 == 1 { t } else { 1.0 - t };
            let at = |bit: usize, k: usize| k + (c >> bit & 1);
            let cell = (at(2, k) * DOWN + at(1, j)) * ACROSS + at(0, i);
            (cell, pick(0, s) * pick(1, t) * pick(2, r))
        })
    }
}

impl Baseline for Clams {
    fn name(&self) -> &'static str {
        "clams-grid"
    }

    fn fit(&self, tiles: &Tiles) -> Result<Fitted> {
        let grid = Grid::of(&tiles.sensor.camera, tiles.span(|p| p.z));
        let (mut sum, mut weight) = (vec![0.0; grid.len()], vec![0.0; grid.len()]);
        for t in &tiles.tiles {
            // The plane's depth over the measured one is 1 + this.
            let excess = t.mean / t.place.disparity;
            for (cell, share) in grid.about(&t.place) {
                sum[cell] += share * t.count * excess;
                weight[cell] += share * t.count;
            }
        }
        let cells: Vec<f64> =
            sum.iter().zip(&weight).map(|(s, w): (&f64, &f64)| s / (w + CAUTION)).collect();
        let parameters = weight.iter().filter(|w| **w > 0.0).count();
        let bias = move |p: &PixelContext| {
            let near = grid.about(p).iter().map(|&(k, share)| share * cells[k]).sum::<f64>();
            // From a factor on the depth to px of disparity.
            p.disparity * near
        };
        let predictor = Learnt {
            scale_px_m: tiles.scale_px_m,
            bias: Some(each(bias)),
            log_variance: None,
            stride: 1,
        };
        Ok(Fitted { predictor: Box::new(predictor), parameters, names: None })
    }
}
