//! Views that the solver never gets, without noise: what a unit reports, and its standard deviation.

use rand::Rng;

use super::eye::{Eye, World};
use super::poses::{Plan, azimuth};
use super::question::ExamView;
use super::shoot::{Sum, slope};
use super::{Act, Set};
use kinoise::correct::Conditions;
use kinoise::rng::Stream;
use kinoise::stats::range;

/// Number of views within the recording's distances and tilts.
const WITHIN: usize = 6;
/// Views beyond the recording: up to this factor farther than its farthest, up to this much steeper than
/// its steepest.
const FARTHER: f64 = 1.3;
const STEEPER_RAD: f64 = 10.0 / 180.0 * std::f64::consts::PI;
/// No board can be seen at a steeper angle, rad.
const STEEPEST_RAD: f64 = 1.3;
/// Index that no view of the recording has.
const NO_VIEW: usize = usize::MAX;

/// Fresh views: some within the recording's distances and tilts, some beyond.
pub fn views(set: &Set) -> Vec<ExamView> {
    let mut rng = set.seed.stream("rays/exam");
    let end = |of: fn(&Plan) -> f64| set.plans.iter().map(of).fold(0.0, f64::max);
    let range = Range {
        z: range(set.plans.iter().map(|p| p.stage.board.depth(0.0, 0.0))),
        theta: end(|p| p.stage.theta),
        session_s: end(|p| p.session_s),
    };
    let mut poses: Vec<(bool, f64, f64)> = Vec::new();
    for k in 0..WITHIN {
        let near = (k as f64 + rng.random::<f64>()) / WITHIN as f64;
        let z = range.z[0] * (range.z[1] / range.z[0]).powf(near);
        // Permuted, so that tilt does not go with distance.
        let tilt = ((5 * k % WITHIN) as f64 + rng.random::<f64>()) / WITHIN as f64;
        poses.push((false, z, range.theta * tilt));
    }
    let middle = (range.z[0] * range.z[1]).sqrt();
    let steeper = (range.theta + STEEPER_RAD).min(STEEPEST_RAD);
    poses.push((true, FARTHER * range.z[1], 0.2 * range.theta));
    poses.push((true, middle, steeper));
    poses.push((true, 0.5 * (1.0 + FARTHER) * range.z[1], 0.5 * range.theta));
    poses.into_iter().map(|pose| view(set, &range, pose, &mut rng)).collect()
}

/// Ranges of the recording.
struct Range {
    z: [f64; 2],
    theta: f64,
    session_s: f64,
}

fn view(set: &Set, range: &Range, pose: (bool, f64, f64), rng: &mut Stream) -> ExamView {
    let (beyond, z, theta) = pose;
    let azimuth = azimuth(rng.random(), rng);
    let theta = set.session.within(z, theta, azimuth, &set.unit);
    let session_s = rng.random::<f64>() * range.session_s;
    let plan = set.session.view(&set.unit, z, [theta, azimuth], [0.0, session_s], rng);
    let plan = Plan { view: NO_VIEW, ..plan };
    let known = &set.causes[..set.known_causes];
    let (depth, sigma) = seen(World { causes: &set.causes, ..set.world() }, &plan);
    // With nothing concealed the unit is as it was described.
    let (plain, sigma_plain) =
        seen(World { unit: &set.described, causes: known, ..set.world() }, &plan);
    let told = &plan.notes;
    let conditions =
        Conditions { session_s, temperature_c: told.temperature_c, ambient_lux: told.ambient_lux };
    let sensor = set.described.sensor.clone();
    ExamView { sensor, beyond, conditions, depth, plain, sigma, sigma_plain }
}

/// Mean of what is reported and standard deviation of a frame's noise, m; NaN off the board.
fn seen(world: World<'_>, plan: &Plan) -> (Vec<f32>, Vec<f32>) {
    let camera = &world.unit.sensor.camera;
    let eye = Eye::new(world, plan);
    let fb = world.unit.disparity_px_m();
    let (slope, mut tremble, mut cut) = (slope(world.unit, plan), 0.0f64, 0.0);
    for cause in world.causes.iter().filter(|cause| cause.acts_in(plan)) {
        match cause.act {
            Act::Wander(px) => tremble = tremble.hypot(px),
            // Truncated, a depth is half a step short on average.
            Act::Floor(step) => cut += 0.5 * step,
            _ => {}
        }
    }
    let n = camera.pixels();
    let (mut depth, mut sigma) = (vec![f32::NAN; n], vec![f32::NAN; n]);
    for i in 0..n {
        let (u, v) = ((i % camera.width) as f64, (i / camera.width) as f64);
        let Some(site) = eye.look(u, v).filter(|s| s.on_board) else { continue };
        let sum = Sum::of(world.causes, &site, plan);
        let z = fb / (site.disparity + sum.error);
        let own = sum.stretch(&site) * world.unit.sigma(site.z, site.theta);
        depth[i] = (z * sum.gain - cut) as f32;
        sigma[i] = (sum.gain * own.hypot(z * z * slope * tremble)) as f32;
    }
    (depth, sigma)
}
