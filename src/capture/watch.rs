//! Locates the target frame by frame, fast enough to follow a hand.

use super::wanted::Pose;
use crate::camera::{Camera, Rays};
use crate::frame::{DepthCode, DepthTable, Frame};
use crate::measure::{sensor_step, words_a_step};
use crate::plane::{Effort, InverseDepthImage, Plane, find_target, fit_affine_robust};
use crate::rng::Seed;
use crate::stats::range;
use crate::view::Sensor;

/// Pixels used along a row: every second one of a Kinect's.
const ACROSS: usize = 320;
/// A target is followed while its share of fitting pixels exceeds this fraction of the initial share.
const MIN_SHARE_KEPT: f64 = 0.8;
/// ... and its residual scale is below this multiple of the initial scale.
const MAX_SCALE_GROWTH: f64 = 2.0;
/// Pixels within this many robust standard deviations belong to the plane.
const MAX_SUPPORT_SCALES: f64 = 5.0;

/// What one frame shows.
#[derive(Debug, Clone, PartialEq)]
pub struct Sighting {
    pub plane: Plane,
    /// Rays (x, y) of the corners of the target's bounding box.
    pub corners: [(f64, f64); 4],
}

impl Sighting {
    pub fn pose(&self) -> Pose {
        Pose::of(&self.plane)
    }

    /// How far the target has moved since `before`: root mean square over its corners of
    /// the change of inverse depth, 1/m.
    pub fn moved_since(&self, before: &Sighting) -> f64 {
        let off = |&(x, y): &(f64, f64)| {
            self.plane.inverse_depth(x, y) - before.plane.inverse_depth(x, y)
        };
        (self.corners.iter().map(|c| off(c).powi(2)).sum::<f64>() / 4.0).sqrt()
    }
}

/// Follows the plane that the principal point looks at.
pub struct Watcher {
    camera: Camera,
    rays: Rays,
    table: DepthTable,
    code: DepthCode,
    /// Words per step of the sensor; see [`words_a_step`].
    words_a_step: f64,
    /// Subsampling factor along rows and columns.
    every: usize,
    columns: usize,
    followed: Option<Followed>,
    inverse: Vec<f32>,
}

struct Followed {
    pixels: Vec<u32>,
    sighting: Sighting,
    /// Share of fitting pixels and their residual scale, 1/m, when the target was found.
    share: f64,
    scale: f64,
}

impl Watcher {
    pub fn new(sensor: &Sensor) -> Self {
        let full = &sensor.camera;
        let every = (full.width / ACROSS).max(1);
        // Pixel i of the small image is pixel every * i of the full one.
        let small = |n: usize| n.div_ceil(every);
        let per = |v: f64| v / every as f64;
        let camera = Camera {
            width: small(full.width),
            height: small(full.height),
            fx: per(full.fx),
            fy: per(full.fy),
            cx: per(full.cx),
            cy: per(full.cy),
            distortion: full.distortion,
        };
        Watcher {
            rays: camera.rays(),
            camera,
            table: sensor.code.table(),
            code: sensor.code,
            words_a_step: 1.0,
            every,
            columns: full.width,
            followed: None,
            inverse: Vec::new(),
        }
    }

    /// The target in this frame; the error says why there is none.
    pub fn look(&mut self, frame: &Frame) -> Result<Sighting, String> {
        self.take_in(frame);
        let followed = match self.followed.take().and_then(|f| self.follow(f)) {
            Some(followed) => followed,
            None => self.find(frame)?,
        };
        Ok(self.followed.insert(followed).sighting.clone())
    }

    fn take_in(&mut self, frame: &Frame) {
        self.inverse.clear();
        for row in frame.raw.chunks(self.columns).step_by(self.every) {
            let words = row.iter().step_by(self.every);
            self.inverse.extend(words.map(|&word| 1.0 / self.table.metres(word)));
        }
    }

    fn step(&self, w: f64) -> f64 {
        sensor_step(&self.code, self.words_a_step, w)
    }

    /// Refits the plane to the target's pixels, if they still show the target.
    fn follow(&self, before: Followed) -> Option<Followed> {
        let (plane, share, scale) = self.fit(&before.pixels, &before.sighting.plane)?;
        let good = share > MIN_SHARE_KEPT * before.share && scale < MAX_SCALE_GROWTH * before.scale;
        let sighting = Sighting { plane, ..before.sighting };
        good.then_some(Followed { sighting, ..before })
    }

    /// Plane, share of the pixels that support it, and residual scale, 1/m.
    fn fit(&self, pixels: &[u32], start: &Plane) -> Option<(Plane, f64, f64)> {
        // Standard deviation of a rounding error: 1/sqrt(12) of a step.
        let floor = 0.3 * self.step(start.q.z);
        let fit =
            fit_affine_robust(&self.inverse, &self.rays, pixels, start, floor, Effort::AllPixels)?;
        let reach = MAX_SUPPORT_SCALES * fit.scale;
        let on = pixels.iter().filter(|&&i| {
            let (x, y) = self.rays.at(i as usize);
            (f64::from(self.inverse[i as usize]) - fit.plane.inverse_depth(x, y)).abs() < reach
        });
        Some((fit.plane, on.count() as f64 / pixels.len() as f64, fit.scale))
    }

    fn find(&mut self, frame: &Frame) -> Result<Followed, String> {
        self.words_a_step = words_a_step(frame.raw.iter().copied(), &self.table);
        let image = InverseDepthImage {
            w: &self.inverse,
            rays: &self.rays,
            camera: &self.camera,
            step: &|w| self.step(w),
        };
        let target = find_target(&image, None, &mut Seed(0).stream("capture/target"))?;
        let (plane, share, scale) =
            self.fit(&target.pixels, &target.plane).ok_or("its plane cannot be fitted")?;
        let sighting = Sighting { plane, corners: corners(&target.pixels, &self.rays) };
        Ok(Followed { pixels: target.pixels, sighting, share, scale })
    }
}

/// Corners of the bounding box of the pixels.
fn corners(pixels: &[u32], rays: &Rays) -> [(f64, f64); 4] {
    let at = |i: &u32| rays.at(*i as usize);
    let [left, right] = range(pixels.iter().map(|i| at(i).0));
    let [top, bottom] = range(pixels.iter().map(|i| at(i).1));
    [(left, top), (right, top), (left, bottom), (right, bottom)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::kinect_v1;
    use rand_distr::{Distribution, Normal};

    /// A wall at 2 m in steps of 12 mm, stored in fifths of a millimetre; two thirds of it lie in one step.
    #[test]
    fn a_wall_in_steps_coarser_than_the_words_is_a_target() {
        let sensor = kinect_v1(2);
        let (width, height) = (sensor.camera.width, sensor.camera.height);
        let rays = sensor.camera.rays();
        let noise = Normal::new(0.0, 0.006).unwrap();
        for theta in [0.0, 0.002, 0.2] {
            let plane = Plane::tilted(2.0, theta, 0.3);
            let mut rng = Seed(1).stream("wall");
            let word = |i: usize| {
                let z = plane.depth_at(&rays, i) + noise.sample(&mut rng);
                sensor.code.raw(0.012 * (z / 0.012).round())
            };
            let frame = Frame { width, height, raw: (0..width * height).map(word).collect() };
            let mut watcher = Watcher::new(&sensor);
            let seen = watcher.look(&frame).expect("a wall");
            assert!((seen.plane.depth(0.0, 0.0) - 2.0).abs() < 0.002, "{theta}: {seen:?}");
            let target = watcher.followed.expect("followed").pixels.len();
            assert!(2 * target > watcher.camera.pixels(), "{theta}: {target} pixels");
        }
    }
}
