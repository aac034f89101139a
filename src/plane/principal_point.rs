//! Without a region the target is the plane that the principal point looks at.

use super::candidate::{Candidate, around_principal_point, candidate, centre_disc};
use super::grow::Lattice;
use super::image::{MIN_PIXELS, in_front, on_plane, seed_plane};
use super::{Exclusions, InverseDepthImage, Target};
use crate::rng::Stream;
use crate::stats::median_in_place;

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
    if measured < MIN_PIXELS {
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
    if best.at_centre < AT_CENTRE {
        only_a_hand_between(image, &best, rng)?;
    }
    finish(image, &lattice, &best, measured)
}

/// A plane that the principal point does not look at is the target only behind something small
/// and not flat, such as a hand. A flat thing there is the board itself, and what was found is a
/// wall.
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

/// Median inverse depth of the pixels above the candidate's plane, 1/m; `None` without any.
fn ahead(image: &InverseDepthImage<'_>, best: &Candidate, pixels: &[u32]) -> Option<f32> {
    let mut ahead: Vec<f32> = pixels
        .iter()
        .map(|&i| {
            let (x, y) = image.rays.at(i as usize);
            image.w[i as usize] - best.fit.plane.inverse_depth(x, y) as f32
        })
        .filter(|d| d.is_finite())
        .collect();
    (!ahead.is_empty()).then(|| median_in_place(&mut ahead))
}

/// Does most of what is around the principal point lie on one plane, by the candidate's noise?
fn flat_there(image: &InverseDepthImage<'_>, best: &Candidate, rng: &mut Stream) -> bool {
    let half = WINDOWS[1] * image.camera.width as f64;
    let around: Vec<u32> = around_principal_point(image.camera, half)
        .into_iter()
        .filter(|&i| image.valid(i as usize))
        .collect();
    let Some(fit) = seed_plane(image, &around, rng) else { return false };
    let near = |i: &&u32| {
        let (x, y) = image.rays.at(**i as usize);
        let off = f64::from(image.w[**i as usize]) - fit.plane.inverse_depth(x, y);
        off.abs() < FLAT_SIGMAS * best.fit.scale
    };
    around.iter().filter(near).count() as f64 > FLAT_SHARE * around.len() as f64
}

/// A hand and a wrist reach no farther over the board than this, m.
const HAND_M: f64 = 0.15;
/// Flat is what holds this share within so many sigma of a plane: 99 % of noise is.
const FLAT_SIGMAS: f64 = 2.5;
const FLAT_SHARE: f64 = 0.8;

/// The principal point looks at the plane when this share of what is measured there lies on it.
const AT_CENTRE: f64 = 0.5;

/// Flat before not flat, a board before a palm, looked at before looked past, near before far.
fn rank(c: &Candidate) -> (bool, bool, bool, i64) {
    (c.flat, c.roomy, c.at_centre >= AT_CENTRE, -(c.away_px as i64))
}

/// Pixels of the grown region, less its edge, and what was left out.
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
    let (mut pixels, mut on, mut edge) = (Vec::new(), 0, 0);
    for i in 0..image.w.len() {
        let node = lattice.node_of(i, width);
        if !filled[node] || !in_front(image, &best.fit.plane, i) {
            continue;
        }
        let fits = image.valid(i) && on_plane(image, &best.fit, i);
        // Near the edge only what fits: something else may be seen there.
        if !core[node] && !fits {
            continue;
        }
        if trimmed[node] || keep_edge {
            pixels.push(i as u32);
            on += usize::from(fits);
        } else {
            edge += usize::from(fits);
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
