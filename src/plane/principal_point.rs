//! Without a region the target is the plane that the principal point looks at.

use super::affine::{AffineFit, Effort, fit_affine_robust};
use super::grow::{Gauge, Lattice};
use super::rival::rivals;
use super::target::{FEWEST_PIXELS, REACH_FLOOR_M, in_front, on_plane, seed_plane};
use super::{Exclusions, InverseDepthImage, Plane, Target};
use crate::camera::Camera;
use crate::rng::Stream;

/// A plane grown from a window around the principal point.
struct Candidate {
    fit: AffineFit,
    mask: Vec<bool>,
    /// Share of the measured pixels around the principal point that lie on it.
    at_centre: f64,
    /// Distance of the nearest node from the principal point, px.
    away_px: f64,
    /// Its residual is noise, not relief.
    flat: bool,
    /// Larger than the palm of a hand.
    roomy: bool,
}

/// Half sizes of the windows a seed is looked for in, as shares of the image width: from a board
/// seen edge-on to one whose middle is hidden by a hand.
const WINDOWS: [f64; 5] = [0.019, 0.031, 0.05, 0.08, 0.13];

pub(super) fn at_principal_point(
    image: &InverseDepthImage<'_>,
    rng: &mut Stream,
) -> Result<Target, String> {
    let camera = image.camera;
    let lattice = Lattice::over(image.w, image.rays, camera.width, camera.height);
    let measured = image.w.iter().filter(|w| w.is_finite()).count();
    if measured < FEWEST_PIXELS {
        return Err(format!("only {measured} of {} pixels carry a depth", image.w.len()));
    }
    let mut best: Option<Candidate> = None;
    for share in WINDOWS {
        let half = (share * camera.width as f64).max(8.0);
        let Some(candidate) = candidate(image, &lattice, half, rng) else {
            continue;
        };
        let better = match &best {
            None => true,
            Some(b) => rank(&candidate) > rank(b),
        };
        let good = candidate.flat && candidate.roomy && candidate.at_centre >= AT_CENTRE;
        if better {
            best = Some(candidate);
        }
        if good {
            break;
        }
    }
    let best = best.ok_or("no plane around the principal point")?;
    if !best.flat {
        return Err("what the principal point looks at is not flat".into());
    }
    finish(image, &lattice, &best, measured)
}

/// The principal point looks at the plane when this share of what is measured there lies on it.
const AT_CENTRE: f64 = 0.5;

/// Flat before not flat, a board before a palm, looked at before looked past, near before far.
fn rank(c: &Candidate) -> (bool, bool, bool, i64) {
    (c.flat, c.roomy, c.at_centre >= AT_CENTRE, -(c.away_px as i64))
}

/// Times that what belongs to other planes is taken out and the target grown again.
const RIVAL_ROUNDS: usize = 3;
const GROWING_ROUNDS: usize = 12;
/// The scale may grow to this many times the seed's before it means another surface: smooth
/// errors of lens and board show over the whole target that a small seed does not see.
const SCALE_GROWTH: f64 = 2.0;

fn candidate(
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
    let seed = seed_plane(image, &seeds, rng)?;
    let mut fit = seed;
    let most = super::grow::ev("GROWTH") * seed.scale;
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
    let gauge = Gauge { fit: &fit, slack_m: REACH_FLOOR_M };
    let mask = lattice.with_rim(&mask, &lattice.residuals(&gauge), &barred);
    let nodes = mask.iter().filter(|m| **m).count();
    if nodes * lattice.pitch * lattice.pitch < FEWEST_PIXELS {
        return None;
    }
    Some(judge(image, lattice, fit, mask, nodes))
}

/// Grow from the seeds until nothing changes, refitting as the plane becomes better known.
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
        let gauge = Gauge { fit: &fit, slack_m: REACH_FLOOR_M };
        let mut open = lattice.quiet(&lattice.residuals(&gauge));
        for ((open, known), barred) in open.iter_mut().zip(&known).zip(barred) {
            *open &= *known && !barred;
        }
        let next = lattice.reached(&open, seeds);
        if next == mask {
            break;
        }
        mask = next;
        let samples = lattice.samples(&mask);
        let floor = image.floor(fit.plane.q.z.abs());
        fit = fit_affine_robust(image.w, image.rays, &samples, &fit.plane, floor, Effort::Sample)?;
        fit.scale = fit.scale.min(most);
        known = lattice.known(&mask)?;
    }
    Some((fit, mask))
}

/// Around the principal point, a disc of this share of the width is "what it looks at".
const CENTRE_DISC: f64 = 0.0125;
/// Relief: residual over local noise above which a surface is not flat, and the more lenient one
/// for surfaces over four percent of the image (a lens may bend a near wall that much).
const RELIEF: f64 = 4.0;
const RELIEF_LARGE: f64 = 8.0;
const LARGE: f64 = 0.04;
/// What lies within a centimetre of one plane on a hand is below this, a sheet of paper three
/// times above, m^2.
const LEAST_AREA_M2: f64 = 0.02;

fn judge(
    image: &InverseDepthImage<'_>,
    lattice: &Lattice,
    fit: AffineFit,
    mask: Vec<bool>,
    nodes: usize,
) -> Candidate {
    let camera = image.camera;
    let disc = around_principal_point(camera, (CENTRE_DISC * camera.width as f64).max(3.0));
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
        roomy: area(image, lattice, &fit.plane, &samples) > LEAST_AREA_M2,
        fit,
        mask,
        away_px,
    }
}

/// Area on the plane that the nodes cover, m^2: a pixel covers z^3 |q| / (fx fy).
fn area(image: &InverseDepthImage<'_>, lattice: &Lattice, plane: &Plane, samples: &[u32]) -> f64 {
    let node = (lattice.pitch * lattice.pitch) as f64 / (image.camera.fx * image.camera.fy);
    let cubes: f64 = samples
        .iter()
        .map(|&i| {
            let (x, y) = image.rays.at(i as usize);
            plane.depth(x, y).powi(3)
        })
        .sum();
    cubes * plane.q.norm() * node
}

/// Pixels of the square of half size `half` (px) around the principal point.
fn around_principal_point(camera: &Camera, half: f64) -> Vec<u32> {
    let range = |c: f64, n: usize| {
        let low = (c - half).max(0.0).ceil() as usize;
        let high = (c + half).min(n as f64 - 1.0).max(0.0) as usize;
        low..=high
    };
    range(camera.cy, camera.height)
        .flat_map(|v| range(camera.cx, camera.width).map(move |u| (v * camera.width + u) as u32))
        .collect()
}

/// Pixels of the grown region, less its rim, and what was left out.
fn finish(
    image: &InverseDepthImage<'_>,
    lattice: &Lattice,
    best: &Candidate,
    measured: usize,
) -> Result<Target, String> {
    let width = image.camera.width;
    let filled = lattice.eroded(&lattice.dilated(&best.mask));
    let trimmed = lattice.eroded(&filled);
    let core = lattice.eroded(&trimmed);
    let count = |mask: &[bool]| mask.iter().filter(|m| **m).count();
    let keep_rim = 2 * count(&trimmed) < count(&filled);
    let mut notes = Vec::new();
    if keep_rim {
        notes.push(
            "the target is too narrow to leave its rim out; mixed edge pixels may widen sigma"
                .into(),
        );
    }
    if best.at_centre < AT_CENTRE {
        notes.push(format!(
            "nothing flat at the principal point; the nearest plane, {:.0} px away, was taken",
            best.away_px
        ));
    }
    let (mut pixels, mut on, mut edge) = (Vec::new(), 0, 0);
    for i in 0..image.w.len() {
        let node = lattice.node_of(i, width);
        if !filled[node] || !in_front(image, &best.fit.plane, i) {
            continue;
        }
        let fits = image.valid(i) && on_plane(image, &best.fit, i);
        // Near the rim only what fits: something else may be seen there.
        if !core[node] && !fits {
            continue;
        }
        if trimmed[node] || keep_rim {
            pixels.push(i as u32);
            on += usize::from(fits);
        } else {
            edge += usize::from(fits);
        }
    }
    if on < FEWEST_PIXELS {
        return Err(format!("the plane at the principal point has only {on} pixels"));
    }
    let exclusions = Exclusions {
        considered: image.w.len(),
        invalid: image.w.len() - measured,
        off_plane: measured - on - edge,
        edge,
    };
    Ok(Target { pixels, plane: best.fit.plane, scale: best.fit.scale, exclusions, notes })
}
