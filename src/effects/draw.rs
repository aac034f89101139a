//! Random numbers of the effects.

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use super::Instant;
use crate::rng::{Seed, Stream};

/// How long a random number stays the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scope {
    /// Fixed for the unit: the same in every view.
    Sensor,
    /// Static while the scene is: the same in every frame of a view.
    View,
    /// Fresh in every frame.
    Frame,
}

/// Source of an effect's random numbers: streams named after the effect alone.
#[derive(Debug, Clone, Copy)]
pub struct Draw<'a> {
    pub seed: Seed,
    pub id: &'a str,
    pub instant: Instant,
}

impl Draw<'_> {
    /// The stream for this scope and part of the effect.
    pub fn stream(&self, scope: Scope, part: &str) -> Stream {
        let Instant { view, frame, .. } = self.instant;
        let name = match scope {
            Scope::Sensor => format!("effect/{}/{part}", self.id),
            Scope::View => format!("effect/{}/{part}/{view}", self.id),
            Scope::Frame => format!("effect/{}/{part}/{view}/{frame}", self.id),
        };
        self.seed.stream(&name)
    }
}

/// Fills `out` with independent standard normal numbers.
pub fn fill_normal(out: &mut [f32], rng: &mut Stream) {
    out.fill_with(|| StandardNormal.sample(rng));
}

/// The independent standard normal numbers of a stream.
pub fn normals(count: usize, mut rng: Stream) -> Vec<f32> {
    let mut numbers = vec![0.0; count];
    fill_normal(&mut numbers, &mut rng);
    numbers
}

/// True with `probability`; draws one number whatever the probability, so that the stream stays in step
/// with the pixels.
pub fn chance(probability: f64, rng: &mut Stream) -> bool {
    rng.random::<f64>() < probability
}

/// 1 / (1 + exp(-beyond / width)), a step where the width is zero; 0 for NaN.
pub fn logistic(beyond: f64, width: f64) -> f64 {
    if width == 0.0 {
        return f64::from(u8::from(beyond > 0.0));
    }
    let p = 1.0 / (1.0 + (-beyond / width).exp());
    if p.is_nan() { 0.0 } else { p }
}
