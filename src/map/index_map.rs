//! Projective data association: the neighbour of a point is what its own pixel saw, without a search.

use nalgebra::{Isometry3, Vector3};

use super::blocks::Blocks;
use super::icp::Target;
use super::point::{Motion, Point};
use crate::camera::{Camera, lens};

/// Two places may be one surface when they are at most this many standard deviations apart.
pub const SIGMAS: f32 = 4.0;
/// An occluder is nearer by at least this, m: the depth range within a block of a slanted surface.
const HIDES_M: f32 = 0.03;
/// Least measurable depth, m.
const MIN_DEPTH_M: f32 = 0.2;

/// The points of one image, found by projection.
pub struct Projective<'a> {
    grid: BlockGrid,
    points: &'a [Option<Point>],
    /// Largest distance of a neighbour, m.
    max_correspondence_m: f32,
}

impl<'a> Projective<'a> {
    pub fn new(camera: &Camera, blocks: &'a Blocks, max_correspondence_m: f32) -> Self {
        let grid = BlockGrid::of(camera, blocks.side_px);
        Projective { grid, points: &blocks.points, max_correspondence_m }
    }
}

impl Target for Projective<'_> {
    type Cache = ();

    #[inline]
    fn find(&self, p: &Vector3<f32>, (): &mut ()) -> Option<&Point> {
        within(self.points[self.grid.block(p)?].as_ref()?, p, self.max_correspondence_m)
    }
}

/// Returns the point, unless it is farther from `p` than `max_m`.
#[inline]
pub fn within<'a>(point: &'a Point, p: &Vector3<f32>, max_m: f32) -> Option<&'a Point> {
    ((point.at - p).norm_squared() <= max_m * max_m).then_some(point)
}

/// Projects points in the camera frame to blocks of its image.
struct BlockGrid {
    /// In blocks.
    focal: [f32; 2],
    centre: [f32; 2],
    distortion: Option<[f32; 5]>,
    /// Largest squared ray of the image: beyond, a lens model may fold back into it.
    reach: f32,
    width: usize,
    height: usize,
}

/// Largest squared ray of an image behind a lens: that of a corner. Its margin is for the outer halves of the last
/// pixels and for a tangential shift.
fn reach(camera: &Camera) -> f32 {
    const BEYOND: f64 = 1.1;
    if camera.distortion.is_none() {
        return f32::INFINITY;
    }
    let (right, below) = ((camera.width - 1) as f64, (camera.height - 1) as f64);
    let square = |(u, v): (f64, f64)| {
        let (x, y) = camera.ray(u, v);
        x * x + y * y
    };
    let corners = [(0.0, 0.0), (right, 0.0), (0.0, below), (right, below)];
    (BEYOND * corners.map(square).into_iter().fold(0.0, f64::max)) as f32
}

impl BlockGrid {
    fn of(camera: &Camera, side_px: usize) -> Self {
        let side = side_px as f64;
        BlockGrid {
            focal: [camera.fx, camera.fy].map(|f| (f / side) as f32),
            // Pixel centres are whole numbers.
            centre: [camera.cx, camera.cy].map(|c| ((c + 0.5) / side) as f32),
            distortion: camera.distortion.map(|k| k.map(|k| k as f32)),
            reach: reach(camera),
            width: camera.width / side_px,
            height: camera.height / side_px,
        }
    }

    #[inline]
    fn block(&self, p: &Vector3<f32>) -> Option<usize> {
        if p.z.is_nan() || p.z <= 0.0 {
            return None;
        }
        let near = 1.0 / p.z;
        let (mut x, mut y) = (p.x * near, p.y * near);
        if let Some(k) = &self.distortion {
            if x * x + y * y > self.reach {
                return None;
            }
            let (dx, dy, radial) = lens(k, x, y);
            (x, y) = (x * radial + dx, y * radial + dy);
        }
        let (u, v) = (self.focal[0] * x + self.centre[0], self.focal[1] * y + self.centre[1]);
        let inside = u >= 0.0 && v >= 0.0 && u < self.width as f32 && v < self.height as f32;
        inside.then(|| v as usize * self.width + u as usize)
    }
}

/// The points of a map that a camera sees: the front-most of each block of its image.
pub struct IndexMap<'a> {
    pub camera: &'a Camera,
    grid: BlockGrid,
    camera_from_map: Motion,
    /// Index of the point that each block shows, or [`NONE`].
    front: Vec<u32>,
}

const NONE: u32 = u32::MAX;

impl<'a> IndexMap<'a> {
    /// Renders `points`, given in the map frame.
    pub fn render<'p>(
        points: impl Iterator<Item = &'p Point>,
        map_from_camera: &Isometry3<f64>,
        camera: &'a Camera,
        side_px: usize,
    ) -> Self {
        let grid = BlockGrid::of(camera, side_px);
        let camera_from_map = Motion::of(&map_from_camera.inverse());
        let mut front = vec![Front::NOTHING; grid.width * grid.height];
        for (i, point) in points.enumerate() {
            let at = camera_from_map.moved(&point.at);
            if at.z <= MIN_DEPTH_M {
                continue;
            }
            let Some(block) = grid.block(&at) else { continue };
            // Surfaces are not visible from behind.
            if camera_from_map.turned(&point.normal).dot(&at) < 0.0 {
                front[block].meet(Front { z: at.z, sigma: point.sigma_normal, index: i as u32 });
            }
        }
        let front = front.into_iter().map(|f| f.index).collect();
        IndexMap { camera, grid, camera_from_map, front }
    }

    /// Width of a block at a depth of 1 m, m.
    pub fn block_width(&self) -> f32 {
        1.0 / self.grid.focal[0]
    }

    /// The block that a place in the map frame projects to.
    #[inline]
    pub fn block(&self, at: &Vector3<f32>) -> Option<usize> {
        self.grid.block(&self.camera_from_map.moved(at))
    }

    #[inline]
    pub fn front(&self, block: usize) -> Option<usize> {
        let index = self.front[block];
        (index != NONE).then_some(index as usize)
    }

    /// The points that a block and its eight neighbours show, row by row.
    pub fn around(&self, block: usize) -> impl Iterator<Item = usize> + '_ {
        let BlockGrid { width, height, .. } = self.grid;
        let (u, v) = (block % width, block / width);
        let rows = v.saturating_sub(1)..=(v + 1).min(height - 1);
        rows.flat_map(move |row| {
            let columns = u.saturating_sub(1)..=(u + 1).min(width - 1);
            columns.filter_map(move |column| self.front(row * width + column))
        })
    }
}

/// The point that a block shows so far, while rendering.
#[derive(Debug, Clone, Copy)]
struct Front {
    z: f32,
    sigma: f32,
    index: u32,
}

impl Front {
    const NOTHING: Self = Front { z: f32::INFINITY, sigma: f32::INFINITY, index: NONE };

    /// The nearer point hides the farther; of two that may be one surface, the one with the smaller sigma
    /// shows. (Choosing the nearer would select errors towards the camera and shift the map that way.)
    fn meet(&mut self, other: Front) {
        let apart = SIGMAS * joint(self.sigma.min(1.0), other.sigma) + HIDES_M;
        let nearer = other.z < self.z - apart;
        let one_surface = (other.z - self.z).abs() <= apart;
        if nearer || one_surface && other.sigma < self.sigma || self.index == NONE {
            *self = other;
        }
    }
}

/// Standard deviation of the difference of two independent values.
#[inline]
pub fn joint(a: f32, b: f32) -> f32 {
    (a * a + b * b).sqrt()
}
