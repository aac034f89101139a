//! Finds the target's pixels: those of a region, or else of the plane at the principal point.

use super::affine::AffineFit;
use super::border::{beside, is_enclosed};
use super::candidate::{Candidate, around_principal_point, candidate, centre_disc};
use super::curved::curved_target;
use super::grow::Lattice;
use super::image::{
    Exclusions, InverseDepthImage, MIN_PIXELS, Target, in_front, on_plane, seed_plane,
};
use super::relief::{Relief, relief};
use crate::rng::Stream;
use crate::stats::median_in_place;
use crate::view::Region;

/// Finds the plane in `region`, or else the one at the principal point; or says why there is none.
pub(super) fn target_in(
    image: &InverseDepthImage<'_>,
    region: Option<&Region>,
    rng: &mut Stream,
) -> Result<Target, String> {
    match region {
        Some(region) => in_region(image, region, rng),
        None => at_principal_point(image, rng),
    }
}

fn in_region(
    image: &InverseDepthImage<'_>,
    region: &Region,
    rng: &mut Stream,
) -> Result<Target, String> {
    let width = image.camera.width;
    let inside: Vec<u32> = (0..image.w.len())
        .filter(|&i| region.contains((i % width) as f64, (i / width) as f64))
        .map(|i| i as u32)
        .collect();
    if inside.is_empty() {
        return Err("its region lies outside the image".into());
    }
    let valid: Vec<u32> = inside.iter().copied().filter(|&i| image.valid(i as usize)).collect();
    if valid.len() < MIN_PIXELS {
        return Err(format!(
            "{} of {} pixels of its region carry a depth, and {MIN_PIXELS} are needed",
            valid.len(),
            inside.len()
        ));
    }
    let flat = seed_plane(image, &valid, rng)
        .filter(|fit| !image.too_rough(fit, &valid))
        .ok_or_else(|| "its region holds no plane".to_string())
        .and_then(|fit| Ok((fit, flat_enough(image, &inside, &valid, &fit)?)));
    let (fit, relief) = match flat {
        Ok(flat) => flat,
        Err(why) => return curved_target(image, &inside, &valid).ok_or(why),
    };
    let flat = |i: u32| !relief.mask[relief.lattice.node_of(i as usize, width)];
    let on = valid.iter().filter(|&&i| flat(i) && on_plane(image, &fit, i as usize)).count();
    if on < MIN_PIXELS {
        return Err(format!(
            "{on} pixels of its region lie on one plane, and {MIN_PIXELS} are needed"
        ));
    }
    let exclusions = Exclusions {
        considered: inside.len(),
        invalid: inside.len() - valid.len(),
        off_plane: valid.len() - on,
        edge: 0,
    };
    let mut notes = relief.notes;
    let share = exclusions.off_plane as f64 / valid.len() as f64;
    if share > NOTED_OFF_PLANE {
        notes.push(format!(
            "{:.1} % of the region's measured pixels are not on the target's plane",
            100.0 * share
        ));
    }
    let pixels = inside
        .into_iter()
        .filter(|&i| flat(i) && in_front(image, &fit.plane, i as usize))
        .collect();
    Ok(Target { pixels, plane: fit.plane, scale: fit.scale, exclusions, notes })
}

/// Largest share of a region off the plane; with more it was not drawn around a target.
const MAX_RELIEF: f64 = 0.5;
/// Largest ratio of residual to local noise for a plane: Herrera's 39 views reach 3.7.
const MAX_BENT: f64 = 5.0;

/// Finds the relief in a region that is otherwise a plane; or says why it is none.
fn flat_enough(
    image: &InverseDepthImage<'_>,
    inside: &[u32],
    valid: &[u32],
    fit: &AffineFit,
) -> Result<Relief, String> {
    let relief = relief(image, inside, fit);
    if relief.share > MAX_RELIEF {
        return Err(format!(
            "{:.0} % of its region are off the plane that fits it best",
            100.0 * relief.share
        ));
    }
    let bent = fit.scale / image.local_noise(valid).max(image.floor(fit.plane.q.z.abs()));
    if bent > MAX_BENT {
        return Err(format!(
            "its region is not flat: it is off the best plane by {bent:.1} times its own noise"
        ));
    }
    Ok(relief)
}

/// Least share of clutter in a region that is noted.
const NOTED_OFF_PLANE: f64 = 0.02;

/// Half sizes of the windows for a seed, as shares of the image width: from a board seen edge-on to one whose
/// middle is hidden by a hand.
const WINDOWS: [f64; 5] = [0.019, 0.031, 0.05, 0.08, 0.13];

pub(super) fn at_principal_point(
    image: &InverseDepthImage<'_>,
    rng: &mut Stream,
) -> Result<Target, String> {
    let camera = image.camera;
    let lattice = Lattice::over(image.w, image.rays, camera.width, camera.height);
    let measured = image.w.iter().filter(|w| w.is_finite()).count();
    if measured < MIN_PIXELS {
        return Err(format!(
            "{measured} of {} pixels carry a depth, and {MIN_PIXELS} are needed",
            image.w.len()
        ));
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
    let Some(best) = best.filter(|best| best.flat) else {
        let all: Vec<u32> = (0..image.w.len() as u32).collect();
        let valid: Vec<u32> = all.iter().copied().filter(|&i| image.valid(i as usize)).collect();
        return curved_target(image, &all, &valid)
            .ok_or_else(|| "what the principal point looks at is not flat".into());
    };
    if best.at_centre < AT_CENTRE {
        only_a_hand_between(image, &best, rng)?;
    }
    finish(image, &lattice, &best, measured)
}

/// Accepts a plane away from the principal point only if something small and not flat, such as a hand, hides
/// it there. A flat object there is the board, and the plane found is a wall.
fn only_a_hand_between(
    image: &InverseDepthImage<'_>,
    best: &Candidate,
    rng: &mut Stream,
) -> Result<(), String> {
    let camera = image.camera;
    let Some(ahead) = ahead(image, best, &centre_disc(camera)) else {
        return Ok(());
    };
    let fault = |what: &str| {
        Err(format!(
            "{what} at the principal point, and the nearest plane found, {:.0} px away at {:.2} m, \
             is another; aim the camera at the target's middle",
            best.away_px,
            best.fit.plane.depth(0.0, 0.0)
        ))
    };
    if ahead <= 0.0 {
        return fault("nothing flat");
    }
    let metre_px = camera.fx * best.fit.plane.inverse_depth(0.0, 0.0);
    if best.away_px > HAND_M * metre_px {
        return fault("something large");
    }
    if flat_there(image, best, rng) {
        return fault("something flat but too noisy or too narrow to be measured");
    }
    Ok(())
}

/// Median of the pixels' inverse depth less that of the candidate's plane, 1/m; `None` without any.
fn ahead(image: &InverseDepthImage<'_>, best: &Candidate, pixels: &[u32]) -> Option<f32> {
    let mut ahead: Vec<f32> = pixels
        .iter()
        .map(|&i| i as usize)
        .map(|i| image.w[i] - best.fit.plane.inverse_depth_at(image.rays, i) as f32)
        .filter(|d| d.is_finite())
        .collect();
    (!ahead.is_empty()).then(|| median_in_place(&mut ahead))
}

/// Whether most pixels around the principal point lie on one plane, by the candidate's noise.
fn flat_there(image: &InverseDepthImage<'_>, best: &Candidate, rng: &mut Stream) -> bool {
    let half = WINDOWS[1] * image.camera.width as f64;
    let around: Vec<u32> = around_principal_point(image.camera, half)
        .into_iter()
        .filter(|&i| image.valid(i as usize))
        .collect();
    let Some(fit) = seed_plane(image, &around, rng) else { return false };
    let near = |i: &&u32| {
        let i = **i as usize;
        let off = f64::from(image.w[i]) - fit.plane.inverse_depth_at(image.rays, i);
        off.abs() < FLAT_SIGMAS * best.fit.scale
    };
    around.iter().filter(near).count() as f64 > FLAT_SHARE * around.len() as f64
}

/// Largest extent of a hand and wrist over the board, m.
const HAND_M: f64 = 0.15;
/// A surface is flat if this share is within so many sigma of a plane, as 99 % of noise is.
const FLAT_SIGMAS: f64 = 2.5;
const FLAT_SHARE: f64 = 0.8;

/// The principal point looks at the plane when this share of the measured pixels there is on it.
const AT_CENTRE: f64 = 0.5;

/// Rank of a candidate: by flatness, then size, then whether it is at the principal point, then nearness.
fn rank(c: &Candidate) -> (bool, bool, bool, i64) {
    (c.flat, c.roomy, c.at_centre >= AT_CENTRE, -(c.away_px as i64))
}

/// Pixels of the grown region without its edge, and the exclusions.
fn finish(
    image: &InverseDepthImage<'_>,
    lattice: &Lattice,
    best: &Candidate,
    measured: usize,
) -> Result<Target, String> {
    let width = image.camera.width;
    let filled = lattice.closed(&best.mask);
    let trimmed = lattice.eroded(&filled);
    let core = lattice.eroded(&trimmed);
    let count = |mask: &[bool]| mask.iter().filter(|m| **m).count();
    let keep_edge = 2 * count(&trimmed) < count(&filled);
    let mut notes = Vec::new();
    if keep_edge {
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
    let beside = beside(image, lattice, &filled);
    let fits = |i: usize| image.valid(i) && on_plane(image, &best.fit, i);
    let (mut pixels, mut on, mut edge) = (Vec::new(), 0, 0);
    for (i, beside) in beside.iter().enumerate() {
        let node = lattice.node_of(i, width);
        if !filled[node] || *beside || !in_front(image, &best.fit.plane, i) {
            continue;
        }
        // Near the edge only pixels that fit, or lost ones between those: others may show something else.
        let lost = |i: usize| !image.valid(i);
        let enclosed = || lost(i) && is_enclosed(i, [width, image.w.len() / width], &lost, &fits);
        if !core[node] && !fits(i) && !enclosed() {
            continue;
        }
        if trimmed[node] || keep_edge {
            pixels.push(i as u32);
            on += usize::from(fits(i));
        } else {
            edge += usize::from(fits(i));
        }
    }
    if on < MIN_PIXELS {
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
