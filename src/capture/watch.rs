//! Where the target is, frame by frame, quickly enough to follow a hand.

use super::wanted::Pose;
use crate::camera::{Camera, Rays};
use crate::frame::{DepthTable, Frame};
use crate::plane::{Effort, InverseDepthImage, Plane, find_target, fit_affine_robust};
use crate::rng::Seed;
use crate::view::Sensor;

/// Pixels looked at along a row: a Kinect's every second.
const ACROSS: usize = 320;
/// A target is followed while so much of it fits as did when it was found.
const STILL_THERE: f64 = 0.8;
/// ... and while it fits no worse than this many times.
const STILL_FLAT: f64 = 2.0;

/// What one frame shows.
#[derive(Debug, Clone, PartialEq)]
pub struct Seen {
    pub plane: Plane,
    /// Rays (x, y) of the corners of the box around the target.
    pub corners: [(f64, f64); 4],
    /// Pixels of the target, of those looked at.
    pub pixels: usize,
}

impl Seen {
    pub fn pose(&self) -> Pose {
        Pose::of(&self.plane)
    }

    /// How far the target has moved since `before`: root mean square over its corners of the
    /// change of inverse depth, 1/m.
    pub fn moved_since(&self, before: &Seen) -> f64 {
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
    code: crate::frame::DepthCode,
    /// Every how many pixels is looked at, along rows and columns.
    every: usize,
    columns: usize,
    followed: Option<Followed>,
    inverse: Vec<f32>,
}

struct Followed {
    pixels: Vec<u32>,
    plane: Plane,
    corners: [(f64, f64); 4],
    /// When it was found: the share of pixels that fit, and their scale, 1/m.
    share: f64,
    scale: f64,
}

impl Watcher {
    pub fn new(sensor: &Sensor) -> Self {
        let full = &sensor.camera;
        let every = (full.width / ACROSS).max(1);
        // Pixel i of the small picture is pixel every * i of the large one.
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
            every,
            columns: full.width,
            followed: None,
            inverse: Vec::new(),
        }
    }

    /// The target in this frame, or why there is none.
    ///
    /// # Errors
    /// In words.
    pub fn look(&mut self, frame: &Frame) -> Result<Seen, String> {
        self.take_in(frame);
        let followed = self.followed.take().and_then(|f| self.follow(f));
        let followed = match followed {
            Some(followed) => followed,
            None => self.find()?,
        };
        let seen = Seen {
            plane: followed.plane,
            corners: followed.corners,
            pixels: followed.pixels.len(),
        };
        self.followed = Some(followed);
        Ok(seen)
    }

    fn take_in(&mut self, frame: &Frame) {
        self.inverse.clear();
        for row in frame.raw.chunks(self.columns).step_by(self.every) {
            let words = row.iter().step_by(self.every);
            self.inverse.extend(words.map(|&word| 1.0 / self.table.metres(word)));
        }
    }

    fn floor(&self, w: f64) -> f64 {
        0.3 * self.step(w)
    }

    fn step(&self, w: f64) -> f64 {
        if w > 0.0 { self.code.step_inverse(1.0 / w) } else { 0.0 }
    }

    /// The plane through the pixels that were the target, if they still are.
    fn follow(&self, before: Followed) -> Option<Followed> {
        let (plane, share, scale) = self.fit(&before.pixels, &before.plane)?;
        let good = share > STILL_THERE * before.share && scale < STILL_FLAT * before.scale;
        good.then_some(Followed { plane, ..before })
    }

    /// Plane, share of the pixels that support it, scale in 1/m.
    fn fit(&self, pixels: &[u32], start: &Plane) -> Option<(Plane, f64, f64)> {
        let floor = self.floor(start.q.z);
        let fit =
            fit_affine_robust(&self.inverse, &self.rays, pixels, start, floor, Effort::AllPixels)?;
        let reach = SUPPORT_SCALES * fit.scale;
        let on = pixels.iter().filter(|&&i| {
            let (x, y) = self.rays.at(i as usize);
            (f64::from(self.inverse[i as usize]) - fit.plane.inverse_depth(x, y)).abs() < reach
        });
        Some((fit.plane, on.count() as f64 / pixels.len() as f64, fit.scale))
    }

    fn find(&self) -> Result<Followed, String> {
        let image = InverseDepthImage {
            w: &self.inverse,
            rays: &self.rays,
            camera: &self.camera,
            step: &|w| self.step(w),
        };
        let target = find_target(&image, None, &mut Seed(0).stream("capture/target"))?;
        let (plane, share, scale) =
            self.fit(&target.pixels, &target.plane).ok_or("its plane cannot be fitted")?;
        let corners = corners(&target.pixels, &self.rays);
        Ok(Followed { pixels: target.pixels, plane, corners, share, scale })
    }
}

/// Pixels within so many robust standard deviations belong to the plane.
const SUPPORT_SCALES: f64 = 5.0;

fn corners(pixels: &[u32], rays: &Rays) -> [(f64, f64); 4] {
    let mut low = (f64::INFINITY, f64::INFINITY);
    let mut high = (f64::NEG_INFINITY, f64::NEG_INFINITY);
    for &i in pixels {
        let (x, y) = rays.at(i as usize);
        low = (low.0.min(x), low.1.min(y));
        high = (high.0.max(x), high.1.max(y));
    }
    [low, (high.0, low.1), (low.0, high.1), high]
}
