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
            unit: "px",
            range: [0.0, 64.0],
            typical: 9.0,
            summary: "side of the window: beyond it neighbours are independent",
        },
        Parameter {
            name: "share",
            unit: "",
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

/// Mean over a square window of `side` px (a fraction weighs the outermost pixels), the variance
/// kept. The image is taken as wrapped, so that the border is like the middle.
fn window_mean(field: &mut [f32], width: usize, side: f64) {
    let window = Window::of(side);
    let mut line = Vec::with_capacity(width);
    for row in field.chunks_exact_mut(width) {
        line.clear();
        line.extend_from_slice(row);
        window.along_row(&line, row);
    }
    window.along_columns(field, width);
}

/// The weights of a moving mean: one, but `edge` at both ends.
struct Window {
    /// The outermost pixels lie this far from the middle.
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

    /// A running sum: a pixel comes in, a pixel goes out, whatever the window's side.
    fn along_row(&self, line: &[f32], out: &mut [f32]) {
        let at = |i: isize| f64::from(line[i.rem_euclid(line.len() as isize) as usize]);
        let reach = self.reach as isize;
        let mut inner: f64 = (1 - reach..reach).map(at).sum();
        let mut put = |i: usize, left: f64, right: f64, next_out: f64| {
            out[i] = ((inner + self.edge * (left + right)) * self.norm) as f32;
            inner += right - next_out;
        };
        for i in 0..line.len() {
            let middle = i as isize;
            let (first, last) = (i.wrapping_sub(self.reach), i + self.reach);
            if first < line.len() && last < line.len() {
                let [left, next, right] = [first, first + 1, last].map(|k| f64::from(line[k]));
                put(i, left, right, next);
            } else {
                put(i, at(middle - reach), at(middle + reach), at(middle - reach + 1));
            }
        }
    }

    /// The same down all columns at once, a row after another, as memory lies.
    fn along_columns(&self, field: &mut [f32], width: usize) {
        let source = field.to_vec();
        let height = source.len() / width;
        let row = |v: isize| {
            let v = v.rem_euclid(height as isize) as usize;
            &source[v * width..(v + 1) * width]
        };
        let reach = self.reach as isize;
        let mut inner = vec![0f64; width];
        for v in 1 - reach..reach {
            inner.iter_mut().zip(row(v)).for_each(|(sum, x)| *sum += f64::from(*x));
        }
        for (v, out) in field.chunks_exact_mut(width).enumerate() {
            let v = v as isize;
            let (top, next, bottom) = (row(v - reach), row(v - reach + 1), row(v + reach));
            for u in 0..width {
                let [top, next, bottom] = [top[u], next[u], bottom[u]].map(f64::from);
                out[u] = ((inner[u] + self.edge * (top + bottom)) * self.norm) as f32;
                inner[u] += bottom - next;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A single one spreads into the window's weights, the fraction at its ends, across the border.
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
