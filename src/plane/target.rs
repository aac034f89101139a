//! Which pixels are the target, and which were left out and why.

use nalgebra::{Matrix3, Vector3};

use super::Plane;
use super::affine::{AffineFit, Effort, MAD_TO_SIGMA, fit_affine_robust};
use super::grow::Lattice;
use super::ransac::{Estimator, InlierCount, UniformSampler, ransac};
use crate::camera::{Camera, Rays};
use crate::rng::Stream;
use crate::stats::median_in_place;
use crate::view::Region;

/// The pixels of the target and a first plane through them.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    /// Indices into the image, ascending. All pixels of the target's region, also those without a
    /// measurement and those off the plane: holes and gross errors belong to the sensor's noise.
    pub pixels: Vec<u32>,
    pub plane: Plane,
    /// Robust standard deviation about the plane, inverse depth, 1/m.
    pub scale: f64,
    pub exclusions: Exclusions,
    /// Oddities worth telling.
    pub notes: Vec<String>,
}

/// Pixels that were not used, by reason.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Exclusions {
    /// Pixels considered: the region's, or the whole image.
    pub considered: usize,
    /// Without a measurement.
    pub invalid: usize,
    /// Measured, but not on the target's plane (or not connected with it).
    pub off_plane: usize,
    /// On the plane, but so near the target's edge that the depth may be mixed.
    pub edge: usize,
}

/// A depth image as the target search sees it: inverse depth (1/m, NaN = none).
pub struct InverseDepthImage<'a> {
    pub w: &'a [f32],
    pub rays: &'a Rays,
    pub camera: &'a Camera,
    /// Step of the depth code in inverse depth at an inverse depth, 1/m.
    pub step: &'a (dyn Fn(f64) -> f64 + Sync),
}

/// Fewest pixels that make a target.
const FEWEST_PIXELS: usize = 300;
/// Pixels within this many robust standard deviations belong to the plane.
const REACH_SIGMAS: f64 = 5.0;
/// ... and pixels within this distance always do: lens errors of a Kinect bend a near wall by
/// 8 mm, while a hand holding a board stands off by more.
const REACH_FLOOR_M: f64 = 0.010;
/// Standard deviation below which no structured-light sensor was ever measured, as a + b z^2
/// (m): half of Khoshelham and Elberink's 1.425e-3 z^2 and a millimetre of rounding.
const SIGMA_FLOOR_M: f64 = 0.0005;
const SIGMA_FLOOR_PER_M: f64 = 0.0007;

impl InverseDepthImage<'_> {
    /// Least standard deviation believed at inverse depth `w`, 1/m.
    fn floor(&self, w: f64) -> f64 {
        (0.3 * (self.step)(w)).max(SIGMA_FLOOR_M * w * w + SIGMA_FLOOR_PER_M)
    }

    fn reach(&self, w: f64, scale: f64) -> f64 {
        (REACH_SIGMAS * scale).max(REACH_FLOOR_M * w * w)
    }

    /// Noise of the image itself, whatever its shape: second differences over eight pixels are
    /// blind to planes and wider than a matching window's correlation.
    fn local_noise(&self, pixels: &[u32]) -> f64 {
        const LAG: usize = 8;
        let width = self.camera.width;
        let stride = (pixels.len() / 3000).max(1);
        let mut differences: Vec<f32> = pixels
            .iter()
            .step_by(stride)
            .filter_map(|&i| {
                let i = i as usize;
                let u = i % width;
                (u >= LAG && u + LAG < width)
                    .then(|| (self.w[i - LAG] - 2.0 * self.w[i] + self.w[i + LAG]).abs())
            })
            .filter(|d| d.is_finite())
            .collect();
        let mad = f64::from(median_in_place(&mut differences));
        if mad.is_finite() { MAD_TO_SIGMA * mad / 6f64.sqrt() } else { 0.0 }
    }

    fn valid(&self, i: usize) -> bool {
        self.w[i].is_finite()
    }
}

/// Samples of inverse depth for RANSAC: hypotheses are affine through three pixels.
struct AffineSamples {
    rows: Vec<(Vector3<f64>, f64)>,
}

impl Estimator for AffineSamples {
    type Model = Vector3<f64>;
    const MINIMAL: usize = 3;

    fn len(&self) -> usize {
        self.rows.len()
    }

    fn hypothesis(&self, sample: &[usize]) -> Option<Vector3<f64>> {
        let [a, b, c] = [sample[0], sample[1], sample[2]].map(|i| self.rows[i]);
        let m = Matrix3::from_rows(&[a.0.transpose(), b.0.transpose(), c.0.transpose()]);
        // Twice the area of the triangle in the normalised image: thin ones extrapolate badly.
        if m.determinant().abs() < 1e-6 {
            return None;
        }
        m.lu().solve(&Vector3::new(a.1, b.1, c.1)).filter(|q| q.iter().all(|v| v.is_finite()))
    }

    fn distance(&self, q: &Vector3<f64>, i: usize) -> f64 {
        (self.rows[i].1 - q.dot(&self.rows[i].0)).abs()
    }
}

/// Find the target: the plane in `region`, or else the one the principal point looks at.
///
/// # Errors
/// In words, when there is no plane.
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
    if valid.len() < FEWEST_PIXELS {
        return Err(format!(
            "only {} of {} pixels of its region carry a depth",
            valid.len(),
            inside.len()
        ));
    }
    let fit = seed_plane(image, &valid, rng)
        .filter(|fit| fit.scale <= ROUGHEST * median_inverse_depth(image, &valid))
        .ok_or("its region holds no plane")?;
    let on = valid.iter().filter(|&&i| on_plane(image, &fit, i as usize)).count();
    if on < FEWEST_PIXELS {
        return Err(format!("only {on} pixels of its region lie on one plane"));
    }
    let exclusions = Exclusions {
        considered: inside.len(),
        invalid: inside.len() - valid.len(),
        off_plane: valid.len() - on,
        edge: 0,
    };
    let mut notes = Vec::new();
    let share = exclusions.off_plane as f64 / valid.len() as f64;
    if share > TELL_OFF_PLANE {
        notes.push(format!(
            "{:.1} % of the region's measured pixels are not on the target's plane",
            100.0 * share
        ));
    }
    let pixels = inside.into_iter().filter(|&i| in_front(image, &fit.plane, i as usize)).collect();
    Ok(Target { pixels, plane: fit.plane, scale: fit.scale, exclusions, notes })
}

/// Does the pixel's ray meet the plane before the camera?
fn in_front(image: &InverseDepthImage<'_>, plane: &Plane, i: usize) -> bool {
    let (x, y) = image.rays.at(i);
    plane.inverse_depth(x, y) > 0.0
}

/// Clutter below this share of a region is not worth a line.
const TELL_OFF_PLANE: f64 = 0.02;

fn on_plane(image: &InverseDepthImage<'_>, fit: &AffineFit, i: usize) -> bool {
    let (x, y) = image.rays.at(i);
    let expected = fit.plane.inverse_depth(x, y);
    expected > 0.0 && (f64::from(image.w[i]) - expected).abs() < image.reach(expected, fit.scale)
}

/// Hypotheses for a seed: enough for a plane that holds a quarter of the window.
const SEED_HYPOTHESES: usize = 300;
const SEED_SAMPLES: usize = 900;

/// RANSAC on a sample of `pixels`, then the robust fit on all of them.
fn seed_plane(
    image: &InverseDepthImage<'_>,
    pixels: &[u32],
    rng: &mut Stream,
) -> Option<AffineFit> {
    let stride = (pixels.len() / SEED_SAMPLES).max(1);
    let rows: Vec<(Vector3<f64>, f64)> = pixels
        .iter()
        .step_by(stride)
        .map(|&i| {
            let (x, y) = image.rays.at(i as usize);
            (Vector3::new(x, y, 1.0), f64::from(image.w[i as usize]))
        })
        .collect();
    let mut depths: Vec<f32> = rows.iter().map(|r| r.1 as f32).collect();
    let floor = image.floor(f64::from(median_in_place(&mut depths)));
    let consensus = InlierCount { threshold: 2.5 * image.local_noise(pixels).max(floor) };
    let samples = AffineSamples { rows };
    let jury: Vec<usize> = (0..samples.len()).collect();
    let (q, _) = ransac(
        &samples,
        &consensus,
        &mut UniformSampler { rng },
        &jury,
        SEED_HYPOTHESES,
        SEED_CONFIDENCE,
    )?;
    fit_affine_robust(image.w, image.rays, pixels, &Plane::new(q), floor, Effort::Sample)
}

const SEED_CONFIDENCE: f64 = 0.9999;

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

fn at_principal_point(image: &InverseDepthImage<'_>, rng: &mut Stream) -> Result<Target, String> {
    let camera = image.camera;
    let lattice = Lattice::over(image.w, camera.width, camera.height);
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

const GROWING_ROUNDS: usize = 12;

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
    let mut fit = seed_plane(image, &seeds, rng)?;
    let seed_nodes: Vec<usize> =
        seeds.iter().map(|&i| lattice.node_of(i as usize, image.camera.width)).collect();
    let mut mask: Vec<bool> = Vec::new();
    for _ in 0..GROWING_ROUNDS {
        let grown = lattice.grow(
            image.w,
            image.rays,
            &fit.plane,
            |w| image.reach(w, fit.scale),
            &seed_nodes,
        );
        if grown == mask {
            break;
        }
        mask = grown;
        let samples = lattice.samples(&mask);
        let floor = image.floor(fit.plane.q.z.abs());
        fit = fit_affine_robust(image.w, image.rays, &samples, &fit.plane, floor, Effort::Sample)?;
    }
    let nodes = mask.iter().filter(|m| **m).count();
    if nodes * lattice.pitch * lattice.pitch < FEWEST_PIXELS {
        return None;
    }
    Some(judge(image, lattice, fit, mask, nodes))
}

/// Around the principal point, a disc of this share of the width is "what it looks at".
const CENTRE_DISC: f64 = 0.0125;
/// Relief: residual over local noise above which a surface is not flat, and the more lenient one
/// for surfaces over four percent of the image (a lens may bend a near wall that much).
const RELIEF: f64 = 4.0;
const RELIEF_LARGE: f64 = 8.0;
const LARGE: f64 = 0.04;
/// No surface scatters by more than this share of its distance: a Kinect at 8 m reaches 2 %.
const ROUGHEST: f64 = 0.05;
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
    let rough = fit.scale > ROUGHEST * median_inverse_depth(image, &samples);
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

fn median_inverse_depth(image: &InverseDepthImage<'_>, pixels: &[u32]) -> f64 {
    let mut w: Vec<f32> = pixels.iter().map(|&i| image.w[i as usize]).collect();
    f64::from(median_in_place(&mut w))
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
