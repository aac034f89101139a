//! Neighbours share a matching window.

use super::{Card, Draw, Effect, Exposure, Parameter, Settings, Stage};

pub struct SpatialCorrelation;

static CARD: Card = Card {
    id: "spatial-correlation",
    stage: Stage::NoiseInSpace,
    words: "neighbouring pixels are matched with overlapping windows and err together",
    parameters: &[Parameter {
        name: "length_px",
        unit: "px",
        range: [0.0, 64.0],
        typical: 9.0,
        words: "side of the window: beyond it neighbours are independent",
    }],
    statistic: "correlation",
    axis: "pixel-lag",
    confused_with: "smooth errors that stand still (radial-disparity-bias, fixed-pattern-noise): those stay in the mean over frames and views",
    reference: "Konolige and Mihelich: 9 x 9 or 9 x 7 window",
};

impl Effect for SpatialCorrelation {
    fn card(&self) -> &'static Card {
        &CARD
    }

    fn forward(&self, settings: &Settings, exposure: &mut Exposure, _: &Draw) {
        let side = settings.at(0);
        if side > 1.0 {
            let (width, height) = (exposure.seen.width, exposure.seen.height);
            window_mean(&mut exposure.noise, width, height, side);
        }
    }
}

/// Mean over a window of `side` px (a fraction weighs the outermost pixels), the variance kept.
/// The image is taken as wrapped, so that the border is like the middle.
fn window_mean(field: &mut [f32], width: usize, height: usize, side: f64) {
    let taps = taps(side);
    let mut row = vec![0f32; width];
    for line in field.chunks_exact_mut(width) {
        row.copy_from_slice(line);
        convolve(&row, &taps, |i, v| line[i] = v);
    }
    let mut column = vec![0f32; height];
    for u in 0..width {
        for (v, c) in column.iter_mut().enumerate() {
            *c = field[v * width + u];
        }
        convolve(&column, &taps, |v, mean| field[v * width + u] = mean);
    }
}

/// Weights of a box of `side`, their squares summing to one.
fn taps(side: f64) -> Vec<f32> {
    let reach = ((side - 1.0) / 2.0).ceil() as i64;
    let weight = |k: i64| (0.5 * side + 0.5 - (k.abs() as f64)).clamp(0.0, 1.0);
    let weights: Vec<f64> = (-reach..=reach).map(weight).collect();
    let norm = weights.iter().map(|w| w * w).sum::<f64>().sqrt();
    weights.iter().map(|w| (w / norm) as f32).collect()
}

fn convolve(line: &[f32], taps: &[f32], mut put: impl FnMut(usize, f32)) {
    let (n, reach) = (line.len(), taps.len() / 2);
    for i in 0..n {
        let sum = taps
            .iter()
            .enumerate()
            .map(|(k, w)| w * line[(i + n * taps.len() + k - reach) % n])
            .sum();
        put(i, sum);
    }
}
