//! Frames whose slope over the picture changes by more than the pixels' noise explains.

use super::frame_series::{Excess, MUCH, Squares};
use super::structure::Structure;
use super::texture_finding::TextureFinding;
use super::view_mean::variance_px2;
use crate::diagnose::finding::parameters::one;
use crate::terms::{Axis, Statistic};

/// Tests whether slopes scatter by more than noise and a jitter of the frames' means of `jitter_px2` explain.
pub fn frame_tilts(views: &[Structure], jitter_px2: f64, level: f64) -> Option<TextureFinding> {
    let tilts = views.iter().filter_map(|s| s.tilts);
    let beside = tilts.map(|t| Squares { expected: t.expected + jitter_px2, ..t });
    let Excess { size, std_error, p, nats } = Excess::of(beside, MUCH, level)?;
    Some(TextureFinding {
        parameters: one("sigma_px", size, std_error),
        size_sigma: size / variance_px2(views).max(1e-12).sqrt(),
        p,
        nats,
        words: Some("the slope over the picture changes from frame to frame".into()),
        ..TextureFinding::named(vec![], Statistic::Correlation, Axis::Frame)
    })
}

#[cfg(test)]
mod tests {
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::diagnose::views::field::Field;
    use crate::plane::Plane;
    use crate::rng::Seed;

    const SIZE: [usize; 2] = [60, 40];
    const NOISE_PX: f64 = 0.05;

    /// Forty views of four frames each. The noise is five times as large in the outer tenths left
    /// and right; the slopes have this standard deviation, px from the centre to one standard
    /// deviation of the positions.
    fn views(slope_px: f64) -> Vec<Structure> {
        let mut rng = Seed(8).stream("frame-tilts");
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let [width, height] = SIZE;
        let n = width * height;
        let outer = |i: usize| !(width / 10..width - width / 10).contains(&(i % width));
        let size = |i: usize| NOISE_PX * if outer(i) { 5.0 } else { 1.0 };
        let place = |i: usize| {
            ((i % width) as f64 - 0.5 * (width as f64 - 1.0)) / (width as f64 / 12f64.sqrt())
        };
        let view = |_| {
            let mut frame = || {
                let slope = slope_px * normal();
                (0..n).map(|i| (slope * place(i) + size(i) * normal()) as f32).collect()
            };
            let field = Field {
                sigma: (0..n).map(|i| size(i) as f32).collect(),
                spread_px: NOISE_PX as f32,
                measured: vec![4; n],
                first: (0..4).map(|_| frame()).collect(),
                frames: (0..4).map(|k| (f64::from(k) / 30.0, 0.0)).collect(),
                ..Field::unseen(Plane::tilted(1.0, 0.0, 0.0), 10.0, SIZE, (0..n as u32).collect())
            };
            let variance_px2 = (0..n).map(|i| size(i).powi(2)).sum::<f64>() / n as f64;
            let tilts = Squares::of_slopes(&field, variance_px2 / n as f64);
            Structure { variance_px2, tilts, ..Structure::default() }
        };
        (0..40).map(view).collect()
    }

    /// Slopes scatter as expected, by 1.6 times what the mean noise of the picture would give: the ratio of
    /// 160 degrees of freedom is 1 +- 0.11.
    #[test]
    fn slopes_are_found_with_their_size_and_noise_has_none() {
        let still = views(0.0);
        let ratio = |s: &Structure| s.tilts.map(|t| t.sum / t.freedom / t.expected).expect("tilts");
        let mean = still.iter().map(ratio).sum::<f64>() / 40.0;
        assert!((mean - 1.0).abs() < 0.35, "{mean}");
        assert!(frame_tilts(&still, 0.0, 1e-3).is_none());
        let found = frame_tilts(&views(0.01), 0.0, 1e-3).expect("slopes");
        // One of the two axes has it: half of the squares.
        let told = found.parameters["sigma_px"]["value"].as_f64().unwrap();
        assert!((told / (0.01 / 2f64.sqrt()) - 1.0).abs() < 0.3, "{told}");
        // No more than what shifts the frames.
        assert!(frame_tilts(&views(0.01), 1e-4, 1e-3).is_none());
    }
}
