//! Neighbours share a matching window.

use super::{Card, Draw, Effect, Exposure, Parameter, Scope, Settings, Stage, normals};

pub struct SpatialCorrelation;

pub(super) static CARD: Card = Card {
    id: "spatial-correlation",
    title: "noise correlated between neighbours",
    stage: Stage::NoiseInSpace,
    summary: "neighbouring pixels are matched with overlapping windows and err together",
    parameters: &[
        Parameter {
            name: "length_px",
            range: [0.0, 64.0],
            typical: 9.0,
            summary: "side of the window: beyond it neighbours are independent",
        },
        Parameter {
            name: "share",
            range: [0.0, 1.0],
            typical: 1.0,
            summary: "of the variance that comes through the window; the rest is each pixel's own",
        },
    ],
    statistic: "correlation",
    axis: "pixel-lag",
    confused_with: "smooth errors that stand still (radial-disparity-bias, fixed-pattern-noise): those stay in the mean over frames and views",
    reference: "Konolige and Mihelich: 9 x 9 or 9 x 7 window",
    ..Card::BASE
};

impl Effect for SpatialCorrelation {
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, draw: &Draw) {
        let (side, share, width) = (settings.at(0), settings.at(1), exposure.seen.width);
        if side <= 1.0 {
            return;
        }
        if share >= 1.0 {
            window_mean(&mut exposure.noise, width, side);
            return;
        }
        let mut matched = normals(exposure.noise.len(), draw.stream(Scope::Frame, "matched"));
        window_mean(&mut matched, width, side);
        let (own, through) = ((1.0 - share).sqrt() as f32, share.sqrt() as f32);
        exposure.noise.iter_mut().zip(matched).for_each(|(x, m)| *x = own * *x + through * m);
    }
}

/// Moving mean over a square window of `side` px (a fraction weights the outermost pixels), rescaled to
/// keep the variance. The image wraps around, so that the border is like the middle.
fn window_mean(field: &mut [f32], width: usize, side: f64) {
    let (window, pixels) = (Window::of(side), field.len());
    (0..pixels).step_by(width).for_each(|row| window.along(field, row..row + width));
    (0..width).for_each(|column| window.along(field, (column..pixels).step_by(width)));
}

/// The weights of a moving mean: one, except `edge` at both ends.
struct Window {
    /// Distance of the outermost pixels from the middle.
    reach: usize,
    edge: f64,
    /// Makes the squares of all weights sum to one.
    norm: f64,
}

impl Window {
    fn of(side: f64) -> Self {
        let reach = ((side - 1.0) / 2.0).ceil();
        let edge = 0.5 * side + 0.5 - reach;
        let squares = 2.0 * reach - 1.0 + 2.0 * edge * edge;
        Window { reach: reach as usize, edge, norm: 1.0 / squares.sqrt() }
    }

    /// Running sum over a line of pixels, at a cost independent of the window's side.
    fn along(&self, field: &mut [f32], line: impl Iterator<Item = usize>) {
        let line: Vec<usize> = line.collect();
        let wrapped = |i: usize| (i as isize - self.reach as isize).rem_euclid(line.len() as isize);
        let pixel = |i: usize| f64::from(field[line[wrapped(i) as usize]]);
        let wide: Vec<f64> = (0..line.len() + 2 * self.reach).map(pixel).collect();
        let mut inner: f64 = wide[1..2 * self.reach].iter().sum();
        for (i, &pixel) in line.iter().enumerate() {
            let (first, last) = (wide[i], wide[i + 2 * self.reach]);
            field[pixel] = ((inner + self.edge * (first + last)) * self.norm) as f32;
            inner += last - wide[i + 1];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A unit impulse spreads into the window's weights, the fraction at its ends, across the border.
    #[test]
    fn a_point_becomes_the_window() {
        for side in [1.5, 3.0, 4.0, 8.4, 9.0] {
            let (width, height) = (24, 20);
            let mut field = vec![0f32; width * height];
            field[2 * width + 1] = 1.0;
            window_mean(&mut field, width, side);
            let weight = |k: f64| (0.5 * side + 0.5 - k).clamp(0.0, 1.0);
            let squares: f64 = (-9i32..=9).map(|k| weight(f64::from(k.abs())).powi(2)).sum();
            let apart = |a: usize, b: usize, n: usize| {
                let d = a.abs_diff(b);
                d.min(n - d) as f64
            };
            for (i, got) in field.iter().enumerate() {
                let (du, dv) = (apart(i % width, 1, width), apart(i / width, 2, height));
                let expected = weight(du) * weight(dv) / squares;
                assert!((f64::from(*got) - expected).abs() < 1e-6, "side {side}: {i}");
            }
        }
    }
}
