//! A candidate plane grown from a window around the principal point, and its quality.

use super::affine::{AffineFit, Effort, fit_affine_robust};
use super::grow::{BEND_M, Gauge, Lattice};
use super::image::{MIN_PIXELS, on_plane, seed_plane};
use super::relief::rivals;
use super::{InverseDepthImage, Plane};
use crate::camera::Camera;
use crate::rng::Stream;
use crate::stats::normal_cut_factor;

/// A plane grown from a window around the principal point.
pub(super) struct Candidate {
    pub fit: AffineFit,
    pub mask: Vec<bool>,
    /// Share of the measured pixels around the principal point that are on the plane.
    pub at_centre: f64,
    /// Distance of the nearest node from the principal point, px.
    pub away_px: f64,
    /// Whether its residual is noise, not relief.
    pub flat: bool,
    /// Whether it is larger than the palm of a hand.
    pub roomy: bool,
}

/// Rounds at most in which nodes of other planes are removed and the target grown again.
const RIVAL_ROUNDS: usize = 3;
const GROWING_ROUNDS: usize = 12;
/// Largest growth of the scale over the seed's; more means another surface. Smooth errors of lens and board
/// show over the whole target, but not in a small seed.
const SCALE_GROWTH: f64 = 2.0;

pub(super) fn candidate(
    image: &InverseDepthImage<'_>,
    lattice: &Lattice,
    half: f64,
    rng: &mut Stream,
) -> Option<Candidate> {
    let window = around_principal_point(image.camera, half);
    let seeds: Vec<u32> = window.into_iter().filter(|&i| image.valid(i as usize)).collect();
    if seeds.len() < 40 {
        return None;
    }
    let mut seed = seed_plane(image, &seeds, rng)?;
    seed.scale = settled_scale(image, &seed, &seeds);
    let mut fit = seed;
    let most = SCALE_GROWTH * seed.scale;
    let seed_nodes: Vec<usize> =
        seeds.iter().map(|&i| lattice.node_of(i as usize, image.camera.width)).collect();
    let mut barred = vec![false; lattice.columns * lattice.rows];
    let mut mask = barred.clone();
    for _ in 0..RIVAL_ROUNDS {
        (fit, mask) = grown(image, lattice, &seed, most, &seed_nodes, &barred)?;
        barred = rivals(image, lattice, &fit, &mask, rng);
        if !mask.iter().zip(&barred).any(|(m, b)| *m && *b) {
            break;
        }
    }
    let gauge = Gauge { fit: &fit, bend_m: BEND_M };
    mask.iter_mut().zip(&barred).for_each(|(m, b)| *m &= !b);
    let residuals = lattice.residuals(&gauge);
    let mask = lattice.with_edge(&mask, &residuals, &barred);
    let curved = lattice.curving_away(&mask, &residuals) > CURVED;
    let pixels = pixels_of(image, lattice, &mask);
    let floor = image.floor(fit.plane.q.z.abs());
    let fit = fit_affine_robust(image.w, image.rays, &pixels, &fit.plane, floor, Effort::Sample)?;
    let fit = AffineFit { scale: settled_scale(image, &fit, &pixels), ..fit };
    let nodes = mask.iter().filter(|m| **m).count();
    if nodes * lattice.pitch * lattice.pitch < MIN_PIXELS {
        return None;
    }
    let mut found = judge(image, lattice, fit, mask, nodes);
    found.flat &= !curved;
    Some(found)
}

/// A target that continues smoothly beyond its plane over more than this share of its outline is part of a
/// curved surface. A board that a wall crosses continues along one of its four sides.
const CURVED: f64 = 0.6;

/// Scale of a fit, 1/m. The median absolute deviation fails where half of the pixels share one code; there
/// it is the standard deviation within a cut at multiples of itself.
fn settled_scale(image: &InverseDepthImage<'_>, fit: &AffineFit, pixels: &[u32]) -> f64 {
    let step = (image.step)(fit.plane.q.z.abs());
    let mut scale = fit.scale;
    if scale > step {
        return scale;
    }
    for _ in 0..SETTLING_ROUNDS {
        let (mut n, mut squares) = (0.0, 0.0);
        for &i in pixels {
            let i = i as usize;
            let off = f64::from(image.w[i]) - fit.plane.inverse_depth_at(image.rays, i);
            if off.abs() < SETTLING_SIGMAS * scale {
                n += 1.0;
                squares += off * off;
            }
        }
        let factor = normal_cut_factor(SETTLING_SIGMAS);
        scale = scale.max((squares / f64::max(n, 1.0) / factor).sqrt());
    }
    scale.min(step)
}

/// The cut, as everywhere for sigma: 0.05 % of a Gaussian is beyond.
const SETTLING_SIGMAS: f64 = 3.5;
const SETTLING_ROUNDS: usize = 4;

/// Measured pixels of the nodes that are set.
fn pixels_of(image: &InverseDepthImage<'_>, lattice: &Lattice, mask: &[bool]) -> Vec<u32> {
    (0..image.w.len())
        .filter(|&i| image.valid(i) && mask[lattice.node_of(i, image.camera.width)])
        .map(|i| i as u32)
        .collect()
}

/// Grows from the seeds until nothing changes, refitting as the plane becomes better known.
fn grown(
    image: &InverseDepthImage<'_>,
    lattice: &Lattice,
    start: &AffineFit,
    most: f64,
    seeds: &[usize],
    barred: &[bool],
) -> Option<(AffineFit, Vec<bool>)> {
    let mut fit = *start;
    let mut known = vec![false; barred.len()];
    seeds.iter().for_each(|&node| known[node] = true);
    let mut mask: Vec<bool> = Vec::new();
    for _ in 0..GROWING_ROUNDS {
        let gauge = Gauge { fit: &fit, bend_m: BEND_M };
        let mut open = lattice.quiet(&lattice.residuals(&gauge));
        for ((open, known), barred) in open.iter_mut().zip(&known).zip(barred) {
            *open &= *known && !barred;
        }
        let next = lattice.reached_across_bands(&open, seeds);
        if next == mask {
            break;
        }
        mask = next;
        let samples = lattice.samples(&mask);
        let floor = image.floor(fit.plane.q.z.abs());
        fit = fit_affine_robust(image.w, image.rays, &samples, &fit.plane, floor, Effort::Sample)?;
        fit.scale = settled_scale(image, &fit, &samples).min(most);
        known = lattice.known(&mask)?;
    }
    Some((fit, mask))
}

/// Half size of the window that the principal point looks at, as a share of the width.
const CENTRE_DISC: f64 = 0.0125;
/// Limit of residual over local noise for a flat surface, and the more lenient one for surfaces over four
/// percent of the image (a lens may bend a near wall that much).
const RELIEF: f64 = 4.0;
const RELIEF_LARGE: f64 = 8.0;
const LARGE: f64 = 0.04;
/// Least area of a target, m^2: the palm of a hand is smaller, a sheet of paper three times larger.
const MIN_AREA_M2: f64 = 0.02;

pub(super) fn centre_disc(camera: &Camera) -> Vec<u32> {
    around_principal_point(camera, (CENTRE_DISC * camera.width as f64).max(3.0))
}

fn judge(
    image: &InverseDepthImage<'_>,
    lattice: &Lattice,
    fit: AffineFit,
    mask: Vec<bool>,
    nodes: usize,
) -> Candidate {
    let camera = image.camera;
    let disc = centre_disc(camera);
    let measured: Vec<usize> =
        disc.iter().map(|&i| i as usize).filter(|&i| image.valid(i)).collect();
    let on = measured
        .iter()
        .filter(|&&i| mask[lattice.node_of(i, camera.width)] && on_plane(image, &fit, i))
        .count();
    let samples = lattice.samples(&mask);
    let noise = image.local_noise(&samples).max(image.floor(fit.plane.q.z.abs()));
    let relief = fit.scale / noise;
    let rough = image.too_rough(&fit, &samples);
    let large = nodes as f64 > LARGE * mask.len() as f64;
    let away_px = samples
        .iter()
        .map(|&i| {
            let (u, v) = (f64::from(i) % camera.width as f64, f64::from(i) / camera.width as f64);
            (u - camera.cx).hypot(v.floor() - camera.cy)
        })
        .fold(f64::INFINITY, f64::min);
    Candidate {
        at_centre: on as f64 / measured.len().max(1) as f64,
        flat: !rough && relief < if large { RELIEF_LARGE } else { RELIEF },
        roomy: area(image, lattice, &fit.plane, &samples) > MIN_AREA_M2,
        fit,
        mask,
        away_px,
    }
}

/// Area of the plane that the nodes cover, m^2: a pixel covers z^3 |q| / (fx fy).
fn area(image: &InverseDepthImage<'_>, lattice: &Lattice, plane: &Plane, samples: &[u32]) -> f64 {
    let node = (lattice.pitch * lattice.pitch) as f64 / (image.camera.fx * image.camera.fy);
    let cube = |&i: &u32| plane.depth_at(image.rays, i as usize).powi(3);
    let cubes: f64 = samples.iter().map(cube).sum();
    cubes * plane.q.norm() * node
}

/// Pixels of the square of half size `half` (px) around the principal point.
pub(super) fn around_principal_point(camera: &Camera, half: f64) -> Vec<u32> {
    let range = |c: f64, n: usize| {
        let low = (c - half).max(0.0).ceil() as usize;
        let high = (c + half).min(n as f64 - 1.0).max(0.0) as usize;
        low..=high
    };
    range(camera.cy, camera.height)
        .flat_map(|v| range(camera.cx, camera.width).map(move |u| (v * camera.width + u) as u32))
        .collect()
}
