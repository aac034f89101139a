//! Frames that are noisier than the others of their view: an exposure that has not settled.

use serde_json::json;

use super::structure::Structure;
use super::texture_finding::TextureFinding;
use super::view_mean::{ViewMean, nats};
use crate::diagnose::finding::parameters::one;
use crate::diagnose::options::FRAMES_KEPT;
use crate::terms::{Axis, Statistic};

/// The frame that stands out most in all views.
pub fn unequal(views: &[Structure], level: f64) -> Option<TextureFinding> {
    let (frame, m, p) = (0..FRAMES_KEPT)
        .filter_map(|j| {
            let m = ViewMean::of(views, |s| s.frame_log_variance[j])?;
            // Either way, and any of the frames.
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

#[cfg(test)]
mod tests {
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::diagnose::noise::texture::frame_log_variance;
    use crate::rng::Seed;

    /// Views of four frames, 5000 pixels each, the first frame's noise times `first`.
    fn views(name: &str, first: f64) -> Vec<Structure> {
        let view = |n: u64| {
            let mut rng = Seed(n).stream(name);
            let mut frame = |size: f64| -> Vec<f32> {
                let mut one = || -> f64 { StandardNormal.sample(&mut rng) };
                (0..5000).map(|_| (size * one()) as f32).collect()
            };
            let frames = [first, 1.0, 1.0, 1.0].map(&mut frame);
            Structure { frame_log_variance: frame_log_variance(&frames), ..Structure::default() }
        };
        (0..12).map(view).collect()
    }

    #[test]
    fn the_frame_that_is_louder_is_found_with_its_size() {
        let found = unequal(&views("unequal/first", 1.1), 1e-3).unwrap();
        assert_eq!(found.parameters["frame"], json!(0));
        assert!((found.size_sigma - 0.1).abs() < 0.01, "{}", found.size_sigma);
        assert!(unequal(&views("unequal/none", 1.0), 1e-3).is_none());
    }
}
