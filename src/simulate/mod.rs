//! Recordings made by formula: a board in front of a camera, Gaussian noise along the axis.
//!
//! Output is written in the recording layout and read back by the same reader as real data.

mod board;
mod grid;

pub use board::{Board, shoot};
pub use grid::{Grid, GridView};

use std::path::Path;

use rand::seq::SliceRandom;
use rayon::prelude::*;

use crate::calibrate::Progress;
use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::frame::DepthCode;
use crate::io::{encode_png16, write_atomic, write_recording_file};
use crate::model::SigmaModel;
use crate::rng::Seed;
use crate::view::Sensor;

/// What to shoot and how.
#[derive(Debug, Clone)]
pub struct Shoot {
    pub sensor: Sensor,
    pub board: Board,
    pub grid: Grid,
    pub frames: usize,
    pub sigma: SigmaModel,
    pub seed: Seed,
}

/// Frame rate of every sensor of this kind, Hz.
const RATE_HZ: f64 = 30.0;
/// From the start of one view to the start of the next, s: time to move a board.
const VIEW_INTERVAL_S: f64 = 30.0;

/// A Kinect v1 in normal mode, its image `shrink` times smaller each way (1 = 640 x 480).
pub fn kinect_v1(shrink: usize) -> Sensor {
    let s = shrink.max(1) as f64;
    let centre = |n: usize| (n as f64 - 1.0) / 2.0;
    let (width, height) = (640 / shrink.max(1), 480 / shrink.max(1));
    Sensor {
        name: "simulated Kinect v1".into(),
        serial: None,
        mode: Some("normal".into()),
        camera: Camera {
            width,
            height,
            // 580 px: the focal length OpenNI and ROS give a Kinect v1's infrared camera.
            fx: 580.0 / s,
            fy: 580.0 / s,
            cx: centre(width),
            cy: centre(height),
            distortion: None,
        },
        baseline_m: Some(0.075),
        code: DepthCode::Metric { units_per_metre: 5000.0, invalid: 0 },
    }
}

impl Shoot {
    /// Write the whole recording into `root`, a view a folder, in random order so that time and
    /// distance are not the same axis.
    ///
    /// # Errors
    /// When the folder exists with something in it, or cannot be written.
    pub fn write(&self, root: &Path, progress: Progress<'_>) -> Result<usize> {
        refuse_full(root)?;
        let mut views = self.grid.views();
        views.shuffle(&mut self.seed.stream("simulate/order"));
        std::fs::create_dir_all(root).map_err(|e| Error::write(root, e))?;
        write_recording_file(root, &self.sensor)?;
        let done = std::sync::atomic::AtomicUsize::new(0);
        let total = views.len();
        views.par_iter().enumerate().try_for_each(|(index, view)| {
            self.write_view(root, index, view)?;
            progress(done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1, total);
            Ok(())
        })?;
        Ok(total)
    }

    fn write_view(&self, root: &Path, index: usize, view: &GridView) -> Result<()> {
        let folder = root.join(format!("{index:04}"));
        let images = folder.join("depth");
        std::fs::create_dir_all(&images).map_err(|e| Error::write(&images, e))?;
        let rays = self.sensor.camera.rays();
        let mut list = String::from("# timestamp path\n");
        for frame in 0..self.frames {
            let mut rng = self.seed.stream(&format!("simulate/{index}/{frame}"));
            let image =
                shoot(&self.sensor, &rays, &view.plane(), &self.board, &self.sigma, &mut rng);
            let name = format!("{frame:04}.png");
            write_atomic(&images.join(&name), &encode_png16(&image)?)?;
            let stamp = index as f64 * VIEW_INTERVAL_S + frame as f64 / RATE_HZ;
            list.push_str(&format!("{stamp:.6} depth/{name}\n"));
        }
        write_atomic(&folder.join("depth.txt"), list.as_bytes())
    }
}

/// Never mix a simulation into somebody's recording.
fn refuse_full(root: &Path) -> Result<()> {
    let full = std::fs::read_dir(root).is_ok_and(|mut entries| entries.next().is_some());
    if full {
        return Err(Error::recording(
            root,
            "the folder is not empty",
            "choose a new folder for the recording",
        ));
    }
    Ok(())
}
