//! Neighbours by projection: the neighbour of a point is what its own pixel saw, no search.

use nalgebra::{Isometry3, Vector3};

use super::blocks::Blocks;
use super::icp::Target;
use super::point::{Motion, Point};
use crate::camera::Camera;

/// Two places may be one surface when they are no more than this many standard deviations apart.
pub const SIGMAS: f32 = 4.0;
/// What hides is nearer by at least this: a block of a slanted surface is as deep, m.
const HIDES_M: f32 = 0.03;
/// Nothing is measured nearer, m.
const MIN_DEPTH_M: f32 = 0.2;

/// The points of one image, found by projection.
pub struct Projective<'a> {
    pub camera: &'a Camera,
    pub blocks: &'a Blocks,
    /// Neighbours farther than this do not count, m.
    pub max_correspondence_m: f32,
}

impl Target for Projective<'_> {
    type Cache = ();

    #[inline]
    fn find(&self, p: &Vector3<f32>, (): &mut ()) -> Option<&Point> {
        let Blocks { width, height, side_px, points } = self.blocks;
        let point = points[block_of(self.camera, *side_px, [*width, *height], p)?].as_ref()?;
        within(point, p, self.max_correspondence_m)
    }
}

/// The point, unless it is farther from `p` than `max_m`.
#[inline]
pub fn within<'a>(point: &'a Point, p: &Vector3<f32>, max_m: f32) -> Option<&'a Point> {
    ((point.at - p).norm_squared() <= max_m * max_m).then_some(point)
}

/// The block that a point of the camera's frame falls in.
#[inline]
fn block_of(
    camera: &Camera,
    side_px: usize,
    [width, height]: [usize; 2],
    p: &Vector3<f32>,
) -> Option<usize> {
    if p.z.is_nan() || p.z <= 0.0 {
        return None;
    }
    let (x, y) = (p.x / p.z, p.y / p.z);
    let (u, v) = if camera.distortion.is_some() {
        let (u, v) = camera.project(f64::from(x), f64::from(y));
        (u as f32, v as f32)
    } else {
        (camera.fx as f32 * x + camera.cx as f32, camera.fy as f32 * y + camera.cy as f32)
    };
    // Pixel centres are whole numbers.
    let (u, v) = ((u + 0.5) / side_px as f32, (v + 0.5) / side_px as f32);
    let inside = u >= 0.0 && v >= 0.0 && u < width as f32 && v < height as f32;
    inside.then(|| v as usize * width + u as usize)
}

/// Which points of a map a camera sees: the front-most of each block of its image.
pub struct IndexMap<'a> {
    pub camera: &'a Camera,
    side_px: usize,
    width: usize,
    height: usize,
    camera_from_map: Motion,
    /// Index of the point that a block shows, [`NONE`] where it shows none.
    front: Vec<u32>,
}

const NONE: u32 = u32::MAX;

impl<'a> IndexMap<'a> {
    /// Render `points`, of the map's frame.
    pub fn render<'p>(
        points: impl Iterator<Item = &'p Point>,
        map_from_camera: &Isometry3<f64>,
        camera: &'a Camera,
        side_px: usize,
    ) -> Self {
        let (width, height) = (camera.width / side_px, camera.height / side_px);
        let camera_from_map = Motion::of(&map_from_camera.inverse());
        let mut front = vec![Front::NOTHING; width * height];
        for (i, point) in points.enumerate() {
            let at = camera_from_map.moved(&point.at);
            if at.z <= MIN_DEPTH_M {
                continue;
            }
            let Some(block) = block_of(camera, side_px, [width, height], &at) else { continue };
            // From behind it is not seen.
            if camera_from_map.turned(&point.normal).dot(&at) < 0.0 {
                front[block].meet(Front { z: at.z, sigma: point.sigma_normal, index: i as u32 });
            }
        }
        let front = front.into_iter().map(|f| f.index).collect();
        IndexMap { camera, side_px, width, height, camera_from_map, front }
    }

    /// The block that a place of the map's frame falls in.
    #[inline]
    pub fn block(&self, at: &Vector3<f32>) -> Option<usize> {
        let at = self.camera_from_map.moved(at);
        block_of(self.camera, self.side_px, [self.width, self.height], &at)
    }

    #[inline]
    pub fn front(&self, block: usize) -> Option<usize> {
        let index = self.front[block];
        (index != NONE).then_some(index as usize)
    }

    /// What a block and its eight neighbours show, row by row.
    pub fn around(&self, block: usize) -> impl Iterator<Item = usize> + '_ {
        let (u, v) = (block % self.width, block / self.width);
        let rows = v.saturating_sub(1)..=(v + 1).min(self.height - 1);
        rows.flat_map(move |row| {
            let columns = u.saturating_sub(1)..=(u + 1).min(self.width - 1);
            columns.filter_map(move |column| self.front(row * self.width + column))
        })
    }
}

/// The point that a block shows, while they are rendered.
#[derive(Debug, Clone, Copy)]
struct Front {
    z: f32,
    sigma: f32,
    index: u32,
}

impl Front {
    const NOTHING: Self = Front { z: f32::INFINITY, sigma: f32::INFINITY, index: NONE };

    /// The nearer hides the farther; of two that may be one surface the surer shows. (The nearer of
    /// those would be the one with the greater error: the map would come towards the camera.)
    fn meet(&mut self, other: Front) {
        let apart = SIGMAS * joint(self.sigma.min(1.0), other.sigma) + HIDES_M;
        let nearer = other.z < self.z - apart;
        let one_surface = (other.z - self.z).abs() <= apart;
        if nearer || one_surface && other.sigma < self.sigma || self.index == NONE {
            *self = other;
        }
    }
}

/// Standard deviation of the difference of two.
#[inline]
pub fn joint(a: f32, b: f32) -> f32 {
    (a * a + b * b).sqrt()
}
