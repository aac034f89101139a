//! Frames noisier than the others of their view: the same one in all views, as where an exposure has not
//! settled, or now one and now another, as under a flickering lamp.

use serde_json::json;

use super::frame_series::{Excess, MUCH, Squares};
use super::structure::Structure;
use super::texture_finding::TextureFinding;
use super::view_mean::{ViewMean, nats};
use crate::diagnose::finding::parameters::one;
use crate::diagnose::options::FRAMES_KEPT;
use crate::stats::Correlation;
use crate::terms::{Axis, Statistic};

/// Tests the frame whose noise differs most from the others' over all views.
pub fn unequal(views: &[Structure], level: f64) -> Option<TextureFinding> {
    let (frame, m, p) = (0..FRAMES_KEPT)
        .filter_map(|j| {
            let m = ViewMean::of(views, |s| s.frame_log_variance[j])?;
            // Two-sided, and any of the frames.
            let p = 2.0 * m.p_above(0.0).min(m.p_below(0.0));
            Some((j, m, (p * FRAMES_KEPT as f64).min(1.0)))
        })
        .min_by(|a, b| a.2.total_cmp(&b.2))?;
    if p > level {
        return None;
    }
    let more = if m.value > 0.0 { "more" } else { "less" };
    let mut parameters = one("log_variance", m.value, m.std_error);
    parameters.insert("frame".into(), json!(frame));
    Some(TextureFinding {
        parameters,
        size_sigma: ((0.5 * m.value).exp() - 1.0).abs(),
        p,
        nats: nats(&m, 0.0),
        words: Some(format!("frame {} of every view has {more} noise than the others", frame + 1)),
        ..TextureFinding::named(vec![], Statistic::Variance, Axis::Frame)
    })
}

/// Tests whether the noise varies between frames by more than chance, from the scatter of its logarithm.
pub fn flicker(views: &[Structure], level: f64) -> Option<TextureFinding> {
    let squares = |s: &Structure| {
        let logs: Vec<f64> = s.frame_log_variance.iter().flatten().copied().collect();
        let (n, [_, of_rows]) = (logs.len() as f64, s.excess_of_rows(&Correlation::white()));
        // Each logarithm is relative to the mean of the others: n / (n - 1) times the
        // deviation from the common mean.
        let sum: f64 = logs.iter().map(|x| (x * (n - 1.0) / n).powi(2)).sum();
        let expected = 2.0 * s.repeats() * of_rows / s.frame_pixels;
        let measured = n > 1.0 && expected.is_finite();
        measured.then_some(Squares { sum, freedom: n - 1.0, expected })
    };
    let Excess { size, std_error, p, nats } =
        Excess::of(views.iter().filter_map(squares), MUCH, level)?;
    Some(TextureFinding {
        parameters: one("spread_of_log_variance", size, std_error),
        size_sigma: (0.5 * size).exp() - 1.0,
        p,
        nats,
        words: Some(
            "now one and now another frame of a view has more noise than the others".into(),
        ),
        ..TextureFinding::named(vec![], Statistic::Variance, Axis::Frame)
    })
}

#[cfg(test)]
mod tests {
    use rand::Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::diagnose::noise::texture::frame_log_variance;
    use crate::rng::{Seed, Stream};

    /// Twelve views of four frames of 5000 pixels, with noise of `size` per frame; the share `lost` of
    /// the readings is missing.
    fn views(seed: u64, lost: f64, size: impl Fn(usize, &mut Stream) -> f64) -> Vec<Structure> {
        let mut rng = Seed(seed).stream("frames");
        let mut frame = |k: usize| -> Vec<f32> {
            let size = size(k, &mut rng);
            let mut one = || {
                let x = size * normal(&mut rng);
                if rng.random::<f64>() < lost { f32::NAN } else { x as f32 }
            };
            (0..5000).map(|_| one()).collect()
        };
        let view = |_| {
            let (frame_log_variance, frame_pixels) =
                frame_log_variance(&[0, 1, 2, 3].map(&mut frame));
            let (pixels, variance_px2) = (5000.0 * (1.0 - lost), 1.0);
            Structure {
                pixels,
                variance_px2,
                frame_log_variance,
                frame_pixels,
                ..Structure::default()
            }
        };
        (0..12).map(view).collect()
    }

    fn normal(rng: &mut Stream) -> f64 {
        StandardNormal.sample(rng)
    }

    /// The log standard deviation of each frame varies as a Gaussian of this standard deviation.
    fn flickering(seed: u64, by: f64, lost: f64) -> Vec<Structure> {
        views(seed, lost, |_, rng| (by * normal(rng)).exp())
    }

    /// The log variance varies twice as much as the log standard deviation; known to 1 / sqrt(2 * 36).
    #[test]
    fn frames_that_flicker_are_told_with_their_size_and_others_are_not() {
        let found = flicker(&flickering(1, 0.1, 0.3), 1e-3).expect("flicker");
        let told = found.parameters["spread_of_log_variance"]["value"].as_f64().unwrap();
        assert!((told / 0.2 - 1.0).abs() < 0.4, "{told}");
        for (seed, lost) in (0..20).flat_map(|seed| [(seed, 0.0), (seed, 0.4)]) {
            assert!(flicker(&flickering(seed, 0.0, lost), 1e-3).is_none(), "{lost}");
        }
    }

    #[test]
    fn the_frame_that_is_louder_is_found_with_its_size() {
        let first = |size: f64| views(1, 0.0, move |k, _| if k == 0 { size } else { 1.0 });
        let found = unequal(&first(1.1), 1e-3).unwrap();
        assert_eq!(found.parameters["frame"], json!(0));
        assert!((found.size_sigma - 0.1).abs() < 0.01, "{}", found.size_sigma);
        assert!(unequal(&first(1.0), 1e-3).is_none());
    }
}
