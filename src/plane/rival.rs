//! Other planes beside the target: what belongs to them is not the target's.
//!
//! Where a wall crosses the target's plane, its pixels lie on both. Each alone fits; what decides
//! is which plane explains their neighbourhood better.

use super::affine::AffineFit;
use super::grow::{Gauge, Lattice};
use super::image::{InverseDepthImage, seed_plane};
use crate::rng::Stream;

/// Rivals are looked for this many nodes around the target: a tenth of the image's width.
const RING: usize = 20;
/// Walls and floor, and one more.
const MAX_RIVALS: usize = 3;
/// A plane that holds less of the ring than this is chance, or the target's own bend.
const MIN_SHARE: f64 = 0.2;
/// Fewest nodes in which a plane is looked for: 20 x 20 px on a 640 px image.
const MIN_NODES: usize = 45;
/// A node belongs to a rival when it is this near to it, in robust standard deviations.
const ON_RIVAL_SIGMAS: f64 = 3.0;

/// Nodes that another plane around the target explains better than the target's own.
pub(super) fn rivals(
    image: &InverseDepthImage<'_>,
    lattice: &Lattice,
    fit: &AffineFit,
    mask: &[bool],
    rng: &mut Stream,
) -> Vec<bool> {
    let own = neighbourhoods(lattice, fit);
    let mut barred = vec![false; mask.len()];
    let mut ring = ring(lattice, mask);
    let size = count(&ring);
    for _ in 0..MAX_RIVALS {
        let samples = lattice.samples(&ring);
        if samples.len() < MIN_NODES {
            break;
        }
        let Some(rival) = seed_plane(image, &samples, rng) else { break };
        let residuals = lattice.residuals(&Gauge { fit: &rival, bend_m: 0.0 });
        let before = count(&ring);
        for (node, r) in ring.iter_mut().zip(&residuals) {
            // NaN is no measurement and not in the ring.
            *node &= f64::from(r.abs()) > ON_RIVAL_SIGMAS;
        }
        if ((before - count(&ring)) as f64) < MIN_SHARE * size as f64 {
            break;
        }
        // The same yardstick for both, or the noisier plane would win.
        let theirs = neighbourhoods(lattice, &AffineFit { scale: fit.scale, ..rival });
        for ((bar, own), theirs) in barred.iter_mut().zip(&own).zip(&theirs) {
            *bar |= theirs < own;
        }
    }
    barred
}

/// Sum of squares about the plane around each node.
fn neighbourhoods(lattice: &Lattice, fit: &AffineFit) -> Vec<f32> {
    let residuals = lattice.residuals(&Gauge { fit, bend_m: 0.0 });
    lattice.boxed(&residuals).iter().map(|sums| sums[2]).collect()
}

/// Measured nodes around the mask, not next to it.
fn ring(lattice: &Lattice, mask: &[bool]) -> Vec<bool> {
    let near = lattice.dilated(mask);
    lattice
        .within(mask, RING)
        .iter()
        .zip(&near)
        .zip(lattice.measured())
        .map(|((within, near), measured)| *within && !near && measured)
        .collect()
}

fn count(mask: &[bool]) -> usize {
    mask.iter().filter(|m| **m).count()
}
