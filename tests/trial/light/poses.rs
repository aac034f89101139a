//! Where the target stands: few views, since every frame is matched.

use rand::Rng;
use rand::seq::SliceRandom;

use crate::Pose;
use kinoise::rng::Stream;
use kinoise::scene::{Board, Print, Target, WHITE};
use kinoise::simulate::{GridView, Scenery};
use kinoise::view::Sensor;

pub(super) const FRAMES: usize = 3;
const NEAREST_M: f64 = 0.9;
const FARTHEST_M: f64 = 2.8;
/// A wall goes on no farther within the picture.
const WALL_ENDS_M: f64 = 3.8;
/// The matcher gives up on steeper boards near by.
const STEEPEST_RAD: f64 = 0.9;

pub(super) struct Session {
    pub poses: Vec<GridView>,
    pub scenery: Scenery,
    pub infrared: bool,
}

/// By lot; what a cause needs to show at all it has.
pub(super) fn draw(cause: &str, sensor: &Sensor, rng: &mut Stream) -> Session {
    let boarded = rng.random::<bool>() || cause == "bow_m";
    let board = Board { width_m: rng.random_range(1.0..1.3), height_m: rng.random_range(0.8..1.0) };
    let told = rng.random::<f64>();
    let scenery = Scenery {
        target: if boarded { Target::Board(board) } else { Target::Wall },
        print: Print::Plain(WHITE),
        wall_gap_m: None,
        clutter: 0,
        reference_error_m: (cause == "warm_up_k" || told < 0.25).then_some(0.001),
        conditions: rng.random::<f64>() < 0.3,
    };
    let infrared = rng.random::<f64>() < 0.2 || cause == "ambient_dn";
    let views = rng.random_range(10..=14);
    let mut shuffled = || {
        let mut places: Vec<f64> =
            (0..views).map(|i| (i as f64 + rng.random::<f64>()) / views as f64).collect();
        places.shuffle(rng);
        places
    };
    let (near, tilt, turn) = (shuffled(), shuffled(), shuffled());
    let pose = |k: usize| {
        let z_m = NEAREST_M * (FARTHEST_M / NEAREST_M).powf(near[k]);
        let azimuth_rad = std::f64::consts::TAU * turn[k];
        let most = steepest(boarded, z_m, azimuth_rad, sensor);
        GridView { z_m, theta_rad: (STEEPEST_RAD * tilt[k]).min(most), azimuth_rad }
    };
    Session { poses: (0..views).map(pose).collect(), scenery, infrared }
}

/// What the matcher, and the wall within the picture, let a target lean, rad.
fn steepest(boarded: bool, z_m: f64, azimuth_rad: f64, sensor: &Sensor) -> f64 {
    let c = &sensor.camera;
    let reach = 0.5
        * (c.width as f64 / c.fx * azimuth_rad.cos().abs()
            + c.height as f64 / c.fy * azimuth_rad.sin().abs());
    let wall = ((1.0 - z_m / WALL_ENDS_M) / (1.05 * reach)).atan();
    if boarded { STEEPEST_RAD } else { STEEPEST_RAD.min(wall) }
}

impl Session {
    /// As near to `pose` as the target can stand: out of reach of the matcher nothing is learnt.
    pub fn nearest(&self, pose: &Pose, sensor: &Sensor) -> GridView {
        let boarded = matches!(self.scenery.target, Target::Board(_));
        let z_m = pose.z_m.clamp(NEAREST_M, FARTHEST_M);
        let most = steepest(boarded, z_m, pose.azimuth_rad, sensor);
        GridView { z_m, theta_rad: pose.theta_rad.min(most), azimuth_rad: pose.azimuth_rad }
    }
}
