//! The dot pattern of a projector, fixed for the life of the unit, and its laser speckle.

use rand::Rng;
use rand::seq::SliceRandom;
use rand_distr::{Distribution, Gamma, StandardNormal};

use crate::rng::{Seed, Stream};

pub struct Dot {
    /// Normalised coordinates in the projector: its ray is (x, y, 1) when cold.
    pub x: f64,
    pub y: f64,
    /// Power relative to the mean dot.
    pub energy: f64,
}

/// All dots, in a fixed order.
pub struct Pattern {
    pub dots: Vec<Dot>,
}

/// Seed of the pattern, which belongs to the unit and does not depend on the simulation's seed.
const UNIT: Seed = Seed(0x4b69_6e65_6374);
/// Three tiles of 211 places span 640 columns (Reichinger, "Kinect Pattern Uncovered", by memory).
const PITCH_PX: f64 = 640.0 / 633.0;
/// Share of places that hold a dot: about one in nine, nine in a 9 x 9 window (same source).
const FILLED: f64 = 0.11;
/// The light of a dot in a picture is Gamma-distributed with shape 4.54 (Landau, Choo and Beling 2015):
/// uneven dot power times speckle. Split evenly, both have shape s with (1 + 1/s)^2 = 1 + 1/4.54, so s =
/// 9.55.
const ENERGY_SHAPE: f64 = 9.55;

/// A rectangle of normalised projector coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Field {
    pub x: [f64; 2],
    pub y: [f64; 2],
}

impl Pattern {
    /// Dots over `field` for a camera of this focal length, px.
    pub fn over(field: &Field, focal_px: f64) -> Self {
        let pitch = PITCH_PX / focal_px;
        let places = |[low, high]: [f64; 2]| ((high - low) / pitch).ceil() as usize + 1;
        let (columns, rows) = (places(field.x), places(field.y));
        let energy = Gamma::new(ENERGY_SHAPE, 1.0 / ENERGY_SHAPE);
        let mut rng = UNIT.stream("simulate/speckle/energy");
        let mut aside = UNIT.stream("simulate/speckle/aside");
        // Jittered within its place: on a strict grid of nearly a pixel's pitch all dots of a column would
        // have the same sub-pixel phase, and the beat would show as stripes of 90 px.
        let mut within = |place: usize| pitch * (place as f64 + aside.random_range(-0.5..0.5));
        let dot = |place: usize| Dot {
            x: field.x[0] + within(place % columns),
            y: field.y[0] + within(place / columns),
            energy: energy.as_ref().map_or(1.0, |e| e.sample(&mut rng)),
        };
        Pattern { dots: free_places(columns, rows).into_iter().map(dot).collect() }
    }
}

/// Random places without neighbours, so that every dot stands alone: random sequential filling of free
/// places (jams at a density of 0.19, far above [`FILLED`]).
fn free_places(columns: usize, rows: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..columns * rows).collect();
    order.shuffle(&mut UNIT.stream("simulate/speckle/places"));
    // A margin of one avoids a special case at the edges.
    let stride = columns + 2;
    let mut blocked = vec![false; stride * (rows + 2)];
    let wanted = (FILLED * (columns * rows) as f64) as usize;
    let mut chosen = Vec::with_capacity(wanted);
    for place in order {
        if chosen.len() == wanted {
            break;
        }
        let middle = (place / columns + 1) * stride + place % columns + 1;
        if !blocked[middle] {
            chosen.push(place);
            for row in [middle - stride, middle, middle + stride] {
                blocked[row - 1..=row + 1].fill(true);
            }
        }
    }
    // Row-major, so that drawing the dots walks memory forward.
    chosen.sort_unstable();
    chosen
}

/// Effect of laser speckle on one dot: on a rough surface it is a handful of bright grains.
///
/// The surface roughness places the grains, so they are static while the scene is. With M grains a dot's
/// light has the contrast 1 / sqrt(M), and its centroid is off by 1 / sqrt(M) of its radius: the limit of
/// every triangulation with coherent light (Dorsch, Haeusler and Herrmann 1994, from memory).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grain {
    /// Light relative to that of the smooth dot.
    pub light: f64,
    /// Shift of its centre along the pattern's x and y, in standard deviations of the beam.
    pub aside: [f64; 2],
}

impl Grain {
    pub const NONE: Grain = Grain { light: 1.0, aside: [0.0; 2] };

    /// Draws the grains of `count` dots, in order; `contrast` is sd over mean of a dot's light.
    pub fn draw(count: usize, contrast: f64, rng: &mut Stream) -> Vec<Grain> {
        // Zero contrast has no Gamma distribution.
        let Ok(gamma) = Gamma::new(contrast.powi(-2), contrast * contrast) else {
            return vec![Grain::NONE; count];
        };
        let normal = |rng: &mut Stream| -> f64 {
            let n: f64 = StandardNormal.sample(rng);
            contrast * n
        };
        (0..count)
            .map(|_| Grain { light: gamma.sample(rng), aside: [normal(rng), normal(rng)] })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Count, spacing and energies against what is published of the real pattern.
    #[test]
    fn the_pattern_is_as_dense_as_a_kinects_and_its_dots_stand_apart() {
        let field = Field { x: [-0.55, 0.55], y: [-0.41, 0.41] };
        let Pattern { dots } = Pattern::over(&field, 580.0);
        let pitch = 640.0 / 633.0 / 580.0;
        let expected = 0.11 * 1.1 * 0.82 / (pitch * pitch);
        assert!((dots.len() as f64 / expected - 1.0).abs() < 0.01, "{}", dots.len());
        for (i, a) in dots.iter().enumerate().step_by(37) {
            let near = |b: &&Dot| (a.x - b.x).abs() < pitch && (a.y - b.y).abs() < pitch;
            assert_eq!(dots.iter().filter(near).count(), 1, "dot {i}");
        }
        let mean = dots.iter().map(|d| d.energy).sum::<f64>() / dots.len() as f64;
        // Standard error 0.32 / sqrt(24000) = 0.002: the tolerance is seven of them.
        assert!((mean - 1.0).abs() < 0.015, "{mean}");
    }
}
