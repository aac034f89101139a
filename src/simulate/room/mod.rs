//! An office filmed along a path: colour, depth and the camera's trajectory.
//!
//! Room frame: origin on the floor in the room's middle, x and y horizontal, z up, metres. Poses are
//! `world_from_camera` (the world is the room) with the camera's optical frame: x right, y down, z forward.
//!
//! ```text
//! TUM file -trajectory-> samples -resample-> poses -place-> poses in the Room
//!                   Room + pose -render-> colours and true depth -FormulaSensor-> depth words
//!                               -dots, lens, chip and matcher of a SpeckleSensor-> depth words
//! ```

mod body;
mod canvas;
mod office;
mod path;
mod render;
mod shape;
mod shutter;
mod texture;
mod textures;

pub use crate::trajectory::{Pose, Trajectory, read_trajectory};
pub use body::{Body, PosedRoom, Room};
pub use office::{CEILING_M, FLOOR_M};
pub use path::{CLEARANCE_M, Resampled, around_the_desks, looking, place, resample};
pub use render::{Picture, RoomCamera};
pub use shape::{Intersection, Shape};
pub use shutter::Shutter;
pub use texture::{Mapping, Material, Texture};

use std::fmt::Write as _;
use std::path::Path;

use rayon::prelude::*;

use crate::Progress;
use crate::error::{Error, Result};
use crate::frame::{DepthCode, Frame};
use crate::io::{
    encode_png16_quickly, encode_rgb, refuse_full, write_atomic, write_recording_file,
};
use crate::rng::Seed;
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
    pub physics: Physics,
    pub seed: Seed,
}

/// Frames per thread and block: with two, the slowest frame keeps the other threads waiting half as long.
const FRAMES_A_THREAD: usize = 2;

impl Film {
    /// Depth code of the TUM layout: units of 1/5000 m, and 0 for no measurement.
    pub const CODE: DepthCode = DepthCode::Metric { units_per_metre: 5000.0, invalid: 0 };

    /// A Kinect v1 with the intrinsics that readers of the TUM layout assume (525 px, ROS default),
    /// its image `shrink` times smaller each way.
    pub fn kinect(shrink: usize) -> Sensor {
        let mut sensor = kinect_v1(shrink);
        sensor.camera.fx = TUM_FOCAL_PX / shrink.max(1) as f64;
        sensor.camera.fy = sensor.camera.fx;
        sensor
    }

    /// Writes rgb/, depth/, their lists, groundtruth.txt and recording.json into `root`, which must be new
    /// or empty. Returns the number of frames that show no depth at all. The bytes do not depend on the
    /// number of threads.
    pub fn write(&self, root: &Path, progress: Progress<'_>) -> Result<usize> {
        refuse_full(root)?;
        for kind in ["rgb", "depth"] {
            let folder = root.join(kind);
            std::fs::create_dir_all(&folder).map_err(|e| Error::write(&folder, e))?;
        }
        let sensor = Sensor { code: Self::CODE, ..self.sensor.clone() };
        let rays = sensor.camera.rays();
        let mut shutter = Shutter::new(self, &sensor, &rays)?;
        let mut blind = 0;
        let block = FRAMES_A_THREAD * rayon::current_num_threads();
        for (k, poses) in self.poses.chunks(block).enumerate() {
            let first = k * block;
            let shots = shutter.shoot(first..first + poses.len());
            blind += shots.iter().filter(|(_, depth)| is_blind(depth)).count();
            shots.par_iter().zip(poses).try_for_each(|((picture, depth), pose)| {
                let Picture { seen, rgb } = picture;
                let (name, colour) = (file_name(pose), encode_rgb(seen.width, seen.height, rgb)?);
                write_atomic(&root.join("rgb").join(&name), &colour)?;
                write_atomic(&root.join("depth").join(&name), &encode_png16_quickly(depth)?)
            })?;
            progress.step(first + poses.len(), self.poses.len());
        }
        self.write_lists(root, &sensor)?;
        Ok(blind)
    }

    /// The seed, physics and scene as JSON, for a separate file.
    pub fn recipe(&self) -> serde_json::Value {
        serde_json::json!({
            "format": "kinoise-recipe/1",
            "seed": self.seed.0,
            "physics": self.physics.described(),
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
        // The depth list last: without it the folder is no sequence, so an interrupted run leaves none
        // incomplete.
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

fn is_blind(depth: &Frame) -> bool {
    depth.raw.iter().all(|&word| Film::CODE.metres(word).is_none())
}

/// ROS's default for a PrimeSense camera, px.
const TUM_FOCAL_PX: f64 = 525.0;

fn file_name(pose: &Pose) -> String {
    // As wide as a timestamp of this century, so that names sort in time order.
    format!("{:017.6}.png", pose.stamp)
}
