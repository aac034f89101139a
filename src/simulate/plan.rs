//! Plans the views of a recording: a grid of poses, or the views of a real recording again for a simulated
//! twin.

use nalgebra::Vector3;
use rand::Rng;
use rand::seq::SliceRandom;
use rand_distr::{Distribution, StandardNormal};

use super::{GridView, RATE_HZ};
use crate::camera::{Camera, Rays};
use crate::effects::{Instant, ROOM_LUX};
use crate::measure::{MeasureOptions, Workbench, view_target};
use crate::plane::{Plane, Target as Found};
use crate::rng::Seed;
use crate::scene::{Bench, Patch, Print, Seen, Target, TargetFrame, WHITE};
use crate::view::{Excluded, Recording, TargetSize, View, ViewNotes};

#[derive(Debug, Clone, PartialEq)]
pub struct ViewPlan {
    pub name: String,
    pub bench: Bench,
    /// Pixels that may have a depth; `None` for all. Row-major.
    pub mask: Option<Vec<bool>>,
    /// Timestamp of each frame, s.
    pub stamps: Vec<f64>,
    /// Ambient light on the target, lx.
    pub ambient_lux: f64,
    pub notes: ViewNotes,
}

impl ViewPlan {
    pub fn seen(&self, camera: &Camera, rays: &Rays) -> Seen {
        let mut seen = Seen::of(&self.bench, camera, rays);
        if let Some(mask) = &self.mask {
            let hidden = mask.iter().enumerate().filter(|(_, shown)| !**shown);
            hidden.for_each(|(i, _)| seen.depth[i] = f32::NAN);
        }
        seen
    }

    /// Timestamps and instants of the frames of view number `index`; `session_s` is the timestamp at which
    /// the session began.
    pub fn instants(
        &self,
        index: usize,
        session_s: f64,
    ) -> impl Iterator<Item = (f64, Instant)> + '_ {
        self.stamps.iter().enumerate().map(move |(frame, &stamp)| {
            let view_s = stamp - self.stamps[0];
            (stamp, Instant { view: index, frame, session_s: stamp - session_s, view_s })
        })
    }
}

/// The target and what surrounds it on the bench.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scenery {
    pub target: Target,
    pub print: Print,
    /// How far behind the target's centre a wall stands, m.
    pub wall_gap_m: Option<f64>,
    /// Number of boxes and hands between sensor and target, off the optical axis.
    pub clutter: usize,
    /// Standard deviation of the reference distances, m; `None` writes none.
    pub reference_error_m: Option<f64>,
    /// Whether the room's temperature and light are written into every view; the light varies either way.
    pub conditions: bool,
}

impl Scenery {
    /// A white target alone, without reference distances or conditions.
    pub fn bare(target: Target) -> Self {
        Scenery {
            target,
            print: Print::Plain(WHITE),
            wall_gap_m: None,
            clutter: 0,
            reference_error_m: None,
            conditions: false,
        }
    }
}

/// Time from the start of one view to the start of the next, s: enough to move a board.
const VIEW_INTERVAL_S: f64 = 30.0;
/// Room temperature, degrees Celsius.
const ROOM_TEMPERATURE_C: f64 = 22.0;

/// Range of ambient light, lx: from a room with drawn curtains to a place at the window.
const AMBIENT_LUX: [f64; 2] = [100.0, 2000.0];

/// Plans a view of each pose, in the given order or `shuffled`, which decorrelates time and distance.
pub fn plan_grid(
    poses: &[GridView],
    scenery: &Scenery,
    frames: usize,
    shuffled: bool,
    seed: Seed,
) -> Vec<ViewPlan> {
    let mut poses = poses.to_vec();
    if shuffled {
        poses.shuffle(&mut seed.stream("simulate/order"));
    }
    poses.iter().enumerate().map(|(index, pose)| view(index, pose, scenery, frames, seed)).collect()
}

fn view(index: usize, pose: &GridView, scenery: &Scenery, frames: usize, seed: Seed) -> ViewPlan {
    // Views follow one another, however long they are.
    let start = index as f64 * VIEW_INTERVAL_S.max(frames as f64 / RATE_HZ);
    // Drawn whether or not an effect uses it. Whole lx, as a light meter shows.
    let [dim, bright] = AMBIENT_LUX.map(f64::ln);
    let mut light = seed.stream(&format!("simulate/ambient/{index}"));
    let ambient_lux = light.random_range(dim..bright).exp().round();
    let reference_distance_m = scenery
        .reference_error_m
        .and_then(|error| reference(pose.z_m, error, seed, &index.to_string()));
    let target = match scenery.target {
        Target::Board(b) => Some(TargetSize::of(b.width_m, b.height_m)),
        Target::Wall => None,
    };
    ViewPlan {
        name: format!("{index:04}"),
        bench: Bench {
            print: scenery.print,
            wall_m: scenery.wall_gap_m.map(|gap| pose.z_m + gap),
            clutter: clutter(pose.z_m, scenery.clutter, seed, index),
            ..Bench::bare(pose.plane(), scenery.target)
        },
        mask: None,
        ambient_lux,
        stamps: (0..frames).map(|k| start + k as f64 / RATE_HZ).collect(),
        notes: ViewNotes {
            // The target's size alone does not warrant a view.json.
            target: target.filter(|_| reference_distance_m.is_some() || scenery.conditions),
            reference_distance_m,
            temperature_c: scenery.conditions.then_some(ROOM_TEMPERATURE_C),
            ambient_lux: scenery.conditions.then_some(ambient_lux),
            ..ViewNotes::default()
        },
    }
}

/// Reading of a tape measure with this standard deviation, m; `None` unless positive.
fn reference(truth_m: f64, error_m: f64, seed: Seed, view: &str) -> Option<f64> {
    let off: f64 = StandardNormal.sample(&mut seed.stream(&format!("simulate/reference/{view}")));
    Some(truth_m + error_m * off).filter(|d| *d > 0.0)
}

/// Boxes nearer than the target, off the axis by 0.2 to 0.4 of their depth.
fn clutter(z: f64, count: usize, seed: Seed, view: usize) -> Vec<Patch> {
    let mut rng = seed.stream(&format!("simulate/clutter/{view}"));
    (0..count)
        .map(|_| {
            let depth = z * rng.random_range(0.5..0.9);
            let angle = rng.random_range(0.0..std::f64::consts::TAU);
            let aside = depth * rng.random_range(0.2..0.4);
            Patch {
                centre: Vector3::new(aside * f64::cos(angle), aside * f64::sin(angle), depth),
                width_m: depth * rng.random_range(0.05..0.15),
                height_m: depth * rng.random_range(0.05..0.15),
                albedo: rng.random_range(0.2..0.8),
            }
        })
        .collect()
}

/// Plans the views of `recording` again: same planes, regions, pixels, frames and timestamps. Reference
/// distances become those of the simulated planes, with `reference_error_m` of noise.
///
/// Views without a plane are returned separately, with the reason.
pub fn plan_like(
    recording: &Recording,
    reference_error_m: f64,
    seed: Seed,
) -> (Vec<ViewPlan>, Vec<Excluded>) {
    let options = MeasureOptions { seed, ..MeasureOptions::default() };
    let bench = Workbench::new(&recording.sensor, options);
    let (found, excluded) = recording.each_view(&|_, _| (), |view| {
        let target = view_target(view, &bench)?;
        Ok((view, target))
    });
    let plan = |(view, Found { plane, pixels, .. }): (&View, Found)| {
        let mut notes = view.notes.clone();
        if notes.reference_distance_m.is_some() {
            let z_m = plane.depth(0.0, 0.0);
            let drawn = reference(z_m, reference_error_m, seed, &view.name);
            // The layout refuses an uncertainty that is not below the distance.
            let above = |d: &f64| notes.reference_uncertainty_m.is_none_or(|u| u < *d);
            notes.reference_distance_m = drawn.filter(above);
            if notes.reference_distance_m.is_none() {
                notes.reference_uncertainty_m = None;
            }
        }
        let stamps = view.depth.iter().map(|f| f.timestamp).collect();
        plan_on(&view.name, &plane, &pixels, &bench.rays, stamps, notes)
    };
    (found.into_iter().map(plan).collect(), excluded)
}

/// Plans a view of these pixels of a plane.
pub fn plan_on(
    name: &str,
    plane: &Plane,
    pixels: &[u32],
    rays: &Rays,
    stamps: Vec<f64>,
    notes: ViewNotes,
) -> ViewPlan {
    let mut mask = vec![false; rays.x.len()];
    let mut middle = Vector3::zeros();
    for &i in pixels {
        mask[i as usize] = true;
        let (x, y) = rays.at(i as usize);
        middle += Vector3::new(x, y, 1.0) * plane.depth(x, y);
    }
    ViewPlan {
        name: name.into(),
        bench: Bench {
            frame: TargetFrame::on(plane, middle / pixels.len() as f64),
            // The mask of the real target's pixels is its outline.
            ..Bench::bare(*plane, Target::Wall)
        },
        mask: Some(mask),
        // As measured; otherwise the same in all views.
        ambient_lux: notes.ambient_lux.unwrap_or(ROOM_LUX),
        stamps,
        notes,
    }
}
