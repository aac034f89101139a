//! Which pixels are the target: those of a region, or what the principal point looks at.

use super::affine::AffineFit;
use super::image::{
    Exclusions, InverseDepthImage, MIN_PIXELS, Target, in_front, on_plane, seed_plane,
};
use super::principal_point::at_principal_point;
use super::relief::{Relief, relief};
use crate::rng::Stream;
use crate::view::Region;

/// Find the target: the plane in `region`, or else the one the principal point looks at.
///
/// # Errors
/// Why there is no plane.
pub fn find_target(
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
            "only {} of {} pixels of its region carry a depth",
            valid.len(),
            inside.len()
        ));
    }
    let fit = seed_plane(image, &valid, rng)
        .filter(|fit| !image.too_rough(fit, &valid))
        .ok_or("its region holds no plane")?;
    let relief = flat_enough(image, &inside, &valid, &fit)?;
    let flat = |i: u32| !relief.mask[relief.lattice.node_of(i as usize, width)];
    let on = valid.iter().filter(|&&i| flat(i) && on_plane(image, &fit, i as usize)).count();
    if on < MIN_PIXELS {
        return Err(format!("only {on} pixels of its region lie on one plane"));
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

/// A region of which more than this share is off the plane was not drawn around a target.
const MAX_RELIEF: f64 = 0.5;
/// Residual over local noise above which a region is no plane: Herrera's 39 views reach 3.7.
const MAX_BENT: f64 = 5.0;

/// What stands off the plane in a region that is a plane otherwise.
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

/// Clutter below this share of a region is not worth a note.
const NOTED_OFF_PLANE: f64 = 0.02;
