//! Textures that the model has and the recording does not show: what is known is not searched for
//! again, so that its size must be held against the views.

use statrs::distribution::{ContinuousCDF, StudentsT};

use super::hanging::{Hanging, Mean, nats};
use super::known::KnownTerms;
use super::replication_textures::beyond_known;
use super::structure::Structure;
use crate::terms::{Axis, Statistic};

/// Each with its parameter, and what is measured of it.
const TEXTURES: [(&str, &str, Axis); 5] = [
    ("fixed-pattern-noise", "sigma_px", Axis::Pixel),
    ("row-noise", "sigma_px", Axis::Row),
    ("frame-jitter", "sigma_px", Axis::Frame),
    ("frozen-noise", "fraction", Axis::Frame),
    ("spatial-correlation", "length_px", Axis::PixelLag),
];
/// The recording shows less than this share of it. Sensors warm up, and views differ.
const SHARE: f64 = 0.5;

/// What the model has too much of, at this level of each.
pub fn overstated(views: &[Structure], known: &KnownTerms, level: f64) -> Vec<Hanging> {
    let one = |&(id, name, axis): &(&'static str, &str, Axis)| {
        let size = known.parameter(id, name).filter(|size| *size > 0.0)?;
        let mut found = Hanging {
            families: vec![id],
            statistic: Statistic::Correlation,
            axis,
            interval: [0.0, 0.0],
            parameters: serde_json::Map::new(),
            size_sigma: 1.0,
            p: 1.0,
            nats: 0.0,
            words: None,
        };
        let beyond = Mean::of(views, beyond_known(&found, known)?)?;
        // A window is told as a logarithm, the others as variances or shares.
        let missing = match name {
            "sigma_px" => -SHARE * size * size,
            "fraction" => -SHARE * size,
            _ => SHARE.ln(),
        };
        let t = StudentsT::new(0.0, 1.0, beyond.views - 1.0).ok()?;
        let off = (beyond.value - missing) / beyond.std_error.max(1e-12 * beyond.value.abs());
        found.p = t.cdf(off).max(1e-300);
        found.nats = nats(&beyond, missing);
        found.families.clear();
        found.words = Some(format!(
            "the model has {id} of {name} {size}, and the views show less than half of it"
        ));
        (found.p < level).then_some(found)
    };
    TEXTURES.iter().filter_map(one).collect()
}
