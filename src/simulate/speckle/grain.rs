//! Laser speckle: a dot on a rough surface is a handful of bright grains.
//!
//! Grains are placed by the roughness, so they stand still while the scene does. With M grains a
//! dot's light has the contrast 1 / sqrt(M), and its centre of light lies off by 1 / sqrt(M) of
//! its radius: the limit of every triangulation with coherent light (Dorsch, Haeusler and Herrmann
//! 1994, from memory).

use rand_distr::{Distribution, Gamma, StandardNormal};

use crate::rng::Stream;

/// What speckle makes of one dot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grain {
    /// Light over that of the smooth dot.
    pub light: f64,
    /// Shift of its centre along the pattern's x and y, in standard deviations of the beam.
    pub aside: [f64; 2],
}

impl Grain {
    /// A smooth dot.
    pub const NONE: Grain = Grain { light: 1.0, aside: [0.0; 2] };

    /// Of `count` dots, in their order; `contrast` is sd over mean of a dot's light.
    pub fn draw(count: usize, contrast: f64, rng: &mut Stream) -> Vec<Grain> {
        if contrast == 0.0 {
            return vec![Grain::NONE; count];
        }
        let gamma = Gamma::new(contrast.powi(-2), contrast * contrast).expect("positive");
        let normal = |rng: &mut Stream| -> f64 {
            let n: f64 = StandardNormal.sample(rng);
            contrast * n
        };
        (0..count)
            .map(|_| Grain { light: gamma.sample(rng), aside: [normal(rng), normal(rng)] })
            .collect()
    }
}
