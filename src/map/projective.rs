//! The neighbour of a point is what its own pixel saw: no search.

use nalgebra::Vector3;

use super::blocks::Blocks;
use super::icp::Target;
use super::point::Point;
use crate::camera::Camera;

/// The points of one image, found by projection.
#[derive(Debug, Clone)]
pub struct Projective<'a> {
    pub camera: &'a Camera,
    pub blocks: &'a Blocks,
    /// Neighbours farther than this do not count, m.
    pub gate_m: f32,
}

/// The block that a point of the camera's frame falls in.
#[inline]
pub fn block_of(
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

impl Target for Projective<'_> {
    type Memory = ();

    #[inline]
    fn find(&self, p: &Vector3<f32>, (): &mut ()) -> Option<&Point> {
        let Blocks { width, height, side_px, points } = self.blocks;
        let point = points[block_of(self.camera, *side_px, [*width, *height], p)?].as_ref()?;
        ((point.at - p).norm_squared() <= self.gate_m * self.gate_m).then_some(point)
    }
}
