//! An office filmed along a path: colour, depth and where the camera was.
//!
//! Room frame: origin on the floor in the room's middle, x and y level, z up, metres. Poses are
//! `world_from_camera` (the world is the room) with the camera's optical frame: x right, y down,
//! z forward.
//!
//! ```text
//! TUM file -trajectory-> samples -resample-> poses -place-> poses in the Room
//!                                    Room + pose -render-> Picture -FormulaSensor-> depth words
//! ```

mod body;
mod canvas;
mod office;
mod path;
mod render;
mod shape;
mod texture;
mod textures;

pub use crate::trajectory::{Pose, Trajectory, read_trajectory};
pub use body::{Body, Room};
pub use office::{CEILING_M, FLOOR_M};
pub use path::{
    CLEARANCE_M, Gap, Placement, Resampled, around_the_desks, looking, place, resample,
};
pub use render::{Picture, RoomCamera};
pub use shape::{Intersection, Shape};
pub use texture::{Mapping, Material, Texture};

use std::collections::HashMap;
use std::fmt::Write as _;
use std::path::Path;

use rayon::prelude::*;

use crate::Progress;
use crate::camera::Rays;
use crate::effects::{Acting, Active, Instant};
use crate::error::{Error, Result};
use crate::frame::{DepthCode, Frame};
use crate::io::{
    encode_png16_quickly, encode_rgb, refuse_full, write_atomic, write_recording_file,
};
use crate::model::{SigmaLookup, SigmaModel};
use crate::rng::Seed;
use crate::scene::Seen;
use crate::simulate::formula::FormulaSensor;
use crate::simulate::kinect_v1;
use crate::simulate::shoot::Physics;
use crate::view::Sensor;

/// A walk through a room with a depth camera.
#[derive(Debug, Clone)]
pub struct Film {
    pub sensor: Sensor,
    pub room: Room,
    /// In the room's frame, in time order.
    pub poses: Vec<Pose>,
    pub sigma: SigmaModel,
    /// In light-path order.
    pub effects: Vec<Active>,
    pub seed: Seed,
}

/// What an effect keeps from frame to frame.
type Memory = HashMap<&'static str, Vec<f32>>;

/// Frames in hand a thread: the slowest of one round keeps the others waiting half as long.
const FRAMES_A_THREAD: usize = 2;

impl Film {
    /// What the TUM layout stores: 1/5000 m, and 0 for nothing.
    pub const CODE: DepthCode = DepthCode::Metric { units_per_metre: 5000.0, invalid: 0 };

    /// A Kinect v1 with the intrinsics that readers of the TUM layout assume (525 px, ROS default),
    /// its image `shrink` times smaller each way.
    pub fn kinect(shrink: usize) -> Sensor {
        let mut sensor = kinect_v1(shrink);
        sensor.camera.fx = TUM_FOCAL_PX / shrink.max(1) as f64;
        sensor.camera.fy = sensor.camera.fx;
        sensor
    }

    /// Write rgb/, depth/, their lists, groundtruth.txt and recording.json into `root`, which must be
    /// new or empty. The bytes do not depend on the number of threads.
    pub fn write(&self, root: &Path, progress: Progress<'_>) -> Result<()> {
        refuse_full(root)?;
        for kind in ["rgb", "depth"] {
            let folder = root.join(kind);
            std::fs::create_dir_all(&folder).map_err(|e| Error::write(&folder, e))?;
        }
        let sensor = Sensor { code: Self::CODE, ..self.sensor.clone() };
        let rays = sensor.camera.rays();
        let shutter = Shutter::new(self, &sensor, &rays);
        let mut memory = Memory::new();
        let block = FRAMES_A_THREAD * rayon::current_num_threads();
        for (k, poses) in self.poses.chunks(block).enumerate() {
            let first = k * block;
            let pictures: Vec<Picture> =
                poses.par_iter().map(|p| shutter.camera.take(&p.world_from_camera)).collect();
            let depths = shutter.expose(&pictures, first, &mut memory);
            let files = pictures.par_iter().zip(&depths).zip(poses);
            files.try_for_each(|((picture, depth), pose)| {
                let Picture { seen, rgb } = picture;
                let (name, colour) = (file_name(pose), encode_rgb(seen.width, seen.height, rgb)?);
                write_atomic(&root.join("rgb").join(&name), &colour)?;
                write_atomic(&root.join("depth").join(&name), &encode_png16_quickly(depth)?)
            })?;
            progress.step(first + poses.len(), self.poses.len());
        }
        self.write_lists(root, &sensor)
    }

    /// What was switched on and where the camera went, for a file of its own.
    pub fn recipe(&self) -> serde_json::Value {
        serde_json::json!({
            "format": "kinoise-recipe/1",
            "seed": self.seed.0,
            "physics": Physics::describe_formula(&self.sigma, &self.effects),
            "room": {"scene": "office", "frames": self.poses.len()},
        })
    }

    fn write_lists(&self, root: &Path, sensor: &Sensor) -> Result<()> {
        let mut truth =
            String::from("# ground truth trajectory\n# timestamp tx ty tz qx qy qz qw\n");
        for pose in &self.poses {
            let (t, q) = (pose.world_from_camera.translation, pose.world_from_camera.rotation);
            let _ = writeln!(
                truth,
                "{:.6} {:.7} {:.7} {:.7} {:.8} {:.8} {:.8} {:.8}",
                pose.stamp, t.x, t.y, t.z, q.i, q.j, q.k, q.w
            );
        }
        write_atomic(&root.join("groundtruth.txt"), truth.as_bytes())?;
        write_recording_file(root, sensor)?;
        // The depth list last: without it the folder is no sequence, so a kill leaves none half done.
        for (kind, title) in [("rgb", "color images"), ("depth", "depth maps")] {
            let mut list = format!("# {title}\n# timestamp filename\n");
            for pose in &self.poses {
                let _ = writeln!(list, "{:.6} {kind}/{}", pose.stamp, file_name(pose));
            }
            write_atomic(&root.join(format!("{kind}.txt")), list.as_bytes())?;
        }
        Ok(())
    }
}

/// ROS' default for a PrimeSense camera, px.
const TUM_FOCAL_PX: f64 = 525.0;

fn file_name(pose: &Pose) -> String {
    // As wide as a stamp of this century: names sort as the times do.
    format!("{:017.6}.png", pose.stamp)
}

/// The film's camera, ready to take any frame.
pub struct Shutter<'a> {
    film: &'a Film,
    camera: RoomCamera<'a>,
    depth: FormulaSensor<'a>,
    sigma: SigmaLookup,
}

impl<'a> Shutter<'a> {
    /// `sensor` and `rays` are those of one camera; its code is that of the words.
    pub fn new(film: &'a Film, sensor: &'a Sensor, rays: &'a Rays) -> Self {
        let Film { sigma, effects, seed, .. } = film;
        Shutter {
            film,
            camera: RoomCamera::new(&film.room, &sensor.camera, rays),
            depth: FormulaSensor { sensor, rays, sigma, effects, seed: *seed },
            sigma: SigmaLookup::of(sigma),
        }
    }

    /// One frame on its own, on one thread: effects remember nothing before it.
    pub fn shoot(&self, frame: usize) -> (Picture, Frame) {
        let picture = self.camera.take(&self.film.poses[frame].world_from_camera);
        let depth = self.expose_one(&picture, frame, &mut Memory::new());
        (picture, depth)
    }

    /// Depth of consecutive frames. Effects of the catalogue may remember: then frames go in order.
    fn expose(&self, pictures: &[Picture], first: usize, memory: &mut Memory) -> Vec<Frame> {
        if self.film.effects.iter().all(|a| matches!(a.effect, Acting::Shape(_))) {
            let each = |(k, p)| self.expose_one(p, first + k, &mut Memory::new());
            return pictures.par_iter().enumerate().map(each).collect();
        }
        let each = |(k, p)| self.expose_one(p, first + k, memory);
        pictures.iter().enumerate().map(each).collect()
    }

    fn expose_one(&self, picture: &Picture, frame: usize, memory: &mut Memory) -> Frame {
        let since = self.film.poses[frame].stamp - self.film.poses[0].stamp;
        let instant = Instant { view: 0, frame, session_s: since, view_s: since };
        let sigma = self.sigma_of(&picture.seen);
        let mut shooting = self.depth.begin_at(&picture.seen, sigma, std::mem::take(memory));
        let shot = shooting.shoot(instant);
        *memory = shooting.memory;
        shot.depth
    }

    /// Of every pixel, m; zero where there is nothing.
    fn sigma_of(&self, seen: &Seen) -> Vec<f32> {
        let of = |(&z, normal): (&f32, &[f32; 3])| {
            let theta = normal[2].abs().min(1.0).acos();
            if z.is_nan() { 0.0 } else { self.sigma.at(z, theta) }
        };
        seen.depth.iter().zip(&seen.normal).map(of).collect()
    }
}
