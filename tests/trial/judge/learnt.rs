//! What was gained on fresh views, against who knows the cause.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::gains::{Gain, Gains};
use kinoise::stats::quantile;

/// Gains of one method over the oracle's, over sets.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Ratio {
    /// Sets whose oracle gains something.
    pub n: usize,
    pub median: f64,
    /// 10th percentile.
    pub low: f64,
}

/// One method over all sets.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Learnt {
    pub within: Option<Ratio>,
    pub beyond: Option<Ratio>,
    /// Median number of fitted numbers.
    pub parameters: Option<f64>,
}

/// Less than this, nats per 1000 pixels, the oracle itself has not gained: a ratio to it means
/// nothing. It is 15 nats over a recording of 1.5 million pixels, 20 small views of 4 frames.
const WORTH: f64 = 0.01;

pub type Side = fn(&Gain) -> f64;

pub const WITHIN: Side = |g| g.within;
pub const BEYOND: Side = |g| g.beyond;

/// Gain of `method` over the oracle's, where both are there.
pub fn ratio(gains: &Gains, method: &str, side: Side) -> Option<f64> {
    let (gain, oracle) = (side(&gains.methods.get(method)?.gain), side(&gains.oracle));
    (oracle >= WORTH).then(|| gain / oracle).filter(|r| r.is_finite())
}

pub fn learnt(all: &[&Gains]) -> BTreeMap<String, Learnt> {
    let mut names: Vec<&String> = all.iter().flat_map(|g| g.methods.keys()).collect();
    names.sort();
    names.dedup();
    let of = |name: &String, side: Side| {
        let mut ratios: Vec<f64> = all.iter().filter_map(|g| ratio(g, name, side)).collect();
        let (median, low) = (quantile(&mut ratios, 0.5)?, quantile(&mut ratios, 0.1)?);
        Some(Ratio { n: ratios.len(), median, low })
    };
    names
        .into_iter()
        .map(|name| {
            let mut counts: Vec<f64> = all
                .iter()
                .filter_map(|g| g.methods.get(name))
                .map(|g| g.parameters as f64)
                .collect();
            let learnt = Learnt {
                within: of(name, WITHIN),
                beyond: of(name, BEYOND),
                parameters: quantile(&mut counts, 0.5),
            };
            (name.clone(), learnt)
        })
        .collect()
}
