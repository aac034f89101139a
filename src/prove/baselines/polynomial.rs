//! Cubic polynomials in the picture's coordinates and the inverse depth, of the bias and of the log
//! variance.

use super::learnt::{Learnt, each};
use super::linear::{Design, fit_log, ratios, solve};
use super::tiles::{Tile, Tiles};
use super::{Baseline, Fitted};
use crate::error::Result;
use crate::terms::PixelContext;

/// All monomials of up to the third degree.
#[derive(Debug, Clone, Copy)]
pub struct Polynomial;

/// Takes the recording's span to -1 .. 1.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    middle: [f64; 3],
    half: [f64; 3],
}

impl Frame {
    pub fn of(tiles: &Tiles) -> Self {
        let camera = &tiles.sensor.camera;
        let [low, high] = tiles.span(|p| p.disparity);
        let (w, h) = (camera.width as f64 / 2.0, camera.height as f64 / 2.0);
        let half = [w, w, (0.5 * (high - low)).max(1e-6)];
        Frame { middle: [w, h, 0.5 * (low + high)], half }
    }

    pub fn of_place(&self, p: &PixelContext) -> [f64; 3] {
        let raw = [p.u, p.v, p.disparity];
        std::array::from_fn(|k| (raw[k] - self.middle[k]) / self.half[k])
    }
}

const DEGREE: u8 = 3;

/// Exponents, the constant first.
fn monomials() -> Vec<[u8; 3]> {
    let mut all = Vec::new();
    for i in 0..=DEGREE {
        for j in 0..=DEGREE - i {
            for k in 0..=DEGREE - i - j {
                all.push([i, j, k]);
            }
        }
    }
    all
}

fn fill(frame: &Frame, exponents: &[[u8; 3]], place: &PixelContext, row: &mut [f64]) {
    let x = frame.of_place(place);
    for (value, e) in row.iter_mut().zip(exponents) {
        *value = (0..3).map(|k| x[k].powi(i32::from(e[k]))).product();
    }
}

impl Baseline for Polynomial {
    fn name(&self) -> &'static str {
        "polynomial"
    }

    fn fit(&self, tiles: &Tiles) -> Result<Fitted> {
        let (frame, exponents) = (Frame::of(tiles), monomials());
        let n = exponents.len();
        let row = |t: &Tile, row: &mut [f64]| fill(&frame, &exponents, &t.place, row);
        let design = Design::of_bias(tiles, n, &row).columns;
        let residual = Design::residual(tiles);
        let bias = solve(&design.tr_mul(&design), &design.tr_mul(&residual));
        let left = ratios(tiles, (&design * &bias.beta).as_slice());
        let variance = fit_log(tiles, &left, &Design::of_variance(tiles, n, &row).columns);
        let value = move |beta: Vec<f64>| {
            let exponents = monomials();
            move |p: &PixelContext| {
                let mut row = [0.0; 20];
                fill(&frame, &exponents, p, &mut row);
                row.iter().zip(&beta).map(|(g, b)| g * b).sum()
            }
        };
        let predictor = Learnt {
            scale_px_m: tiles.scale_px_m,
            bias: Some(each(value(bias.beta.as_slice().to_vec()))),
            log_variance: Some(each(value(variance.beta.as_slice().to_vec()))),
            stride: 1,
        };
        let parameters = bias.rank + variance.rank;
        Ok(Fitted { predictor: Box::new(predictor), parameters, names: None })
    }
}
