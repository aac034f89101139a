//! Finds what is not part of the target: relief off its plane inside a region (a ball on the board, a hand),
//! and other planes next to it. Where a wall crosses the target's plane, pixels fit both; the plane that
//! explains their neighbourhood better decides.

use super::affine::AffineFit;
use super::grow::{BEND_M, Gauge, Lattice};
use super::image::{InverseDepthImage, MIN_PIXELS, seed_plane};
use crate::rng::Stream;

/// Connected areas off the plane.
pub(super) struct Relief {
    pub lattice: Lattice,
    /// Nodes in the areas and next to them.
    pub mask: Vec<bool>,
    pub notes: Vec<String>,
    /// Share of the measured nodes that the areas cover.
    pub share: f64,
}

/// Finds areas of the pixels `inside` whose neighbourhoods are off the plane by more than its noise and bend.
/// Scattered gross errors and holes belong to the sensor and are no relief.
pub(super) fn relief(image: &InverseDepthImage<'_>, inside: &[u32], fit: &AffineFit) -> Relief {
    let camera = image.camera;
    let mut w = vec![f32::NAN; image.w.len()];
    inside.iter().for_each(|&i| w[i as usize] = image.w[i as usize]);
    let lattice = Lattice::over(&w, image.rays, camera.width, camera.height);
    let residuals = lattice.residuals(&Gauge { fit, bend_m: BEND_M });
    let off = lattice.off(&residuals);
    let min_nodes = MIN_PIXELS.div_ceil(lattice.pitch * lattice.pitch);
    let mut left = off.clone();
    let (mut mask, mut notes) = (vec![false; off.len()], Vec::new());
    for seed in 0..off.len() {
        if !left[seed] {
            continue;
        }
        let area = lattice.reached(&left, &[seed]);
        left.iter_mut().zip(&area).for_each(|(left, area)| *left &= !area);
        if area.iter().filter(|a| **a).count() >= min_nodes {
            notes.push(describe(image, &lattice, fit, &area));
            mask.iter_mut().zip(&area).for_each(|(mask, area)| *mask |= area);
        }
    }
    // The slope from the plane up to the relief is hidden in the noise over about a neighbourhood.
    let mask = lattice.dilated(&lattice.dilated(&mask));
    let measured = lattice.measured().filter(|m| *m).count();
    let covered = lattice.measured().zip(&mask).filter(|(measured, m)| *measured && **m).count();
    let share = covered as f64 / measured.max(1) as f64;
    Relief { lattice, mask, notes, share }
}

fn describe(
    image: &InverseDepthImage<'_>,
    lattice: &Lattice,
    fit: &AffineFit,
    area: &[bool],
) -> String {
    let width = image.camera.width;
    let samples = lattice.samples(area);
    let n = samples.len() as f64;
    let (mut u, mut v, mut off_m, mut square_m) = (0.0, 0.0, 0.0, 0.0);
    for &i in &samples {
        let i = i as usize;
        let z = 1.0 / f64::from(image.w[i]);
        u += (i % width) as f64 / n;
        v += (i / width) as f64 / n;
        off_m += (z - fit.plane.depth_at(image.rays, i)) / n;
        square_m += z * z / (image.camera.fx * image.camera.fy);
    }
    let node = (lattice.pitch * lattice.pitch) as f64;
    format!(
        "something of {:.0} cm2 around pixel ({u:.0}, {v:.0}) stands {:.0} mm {} the target's \
         plane; it was left out: take it away, or draw the region around it",
        1e4 * square_m * node,
        1000.0 * off_m.abs(),
        if off_m < 0.0 { "before" } else { "behind" },
    )
}

/// Width of the ring around the target in which rivals are searched, nodes: a tenth of the image's width.
const RING: usize = 20;
/// Rivals at most: walls and floor, and one more.
const MAX_RIVALS: usize = 3;
/// Least share of the ring on a rival: less is chance, or the target's own bend.
const MIN_SHARE: f64 = 0.2;
/// Fewest nodes in which a plane is searched: 20 x 20 px on a 640 px image.
const MIN_NODES: usize = 45;
/// Largest distance of a node from a rival it belongs to, robust standard deviations.
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
            // NaN means no measurement, and is not in the ring.
            *node &= f64::from(r.abs()) > ON_RIVAL_SIGMAS;
        }
        if ((before - count(&ring)) as f64) < MIN_SHARE * size as f64 {
            break;
        }
        // The same scale for both, or the noisier plane would win.
        let theirs = neighbourhoods(lattice, &AffineFit { scale: fit.scale, ..rival });
        for ((bar, own), theirs) in barred.iter_mut().zip(&own).zip(&theirs) {
            *bar |= theirs < own;
        }
    }
    barred
}

/// Sum of squared residuals about the plane, around each node.
fn neighbourhoods(lattice: &Lattice, fit: &AffineFit) -> Vec<f32> {
    let residuals = lattice.residuals(&Gauge { fit, bend_m: 0.0 });
    lattice.boxed(&residuals).iter().map(|sums| sums[2]).collect()
}

/// Measured nodes around the mask, but not next to it.
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
