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
pub fn block_of(
    camera: &Camera,
    side_px: usize,
    [width, height]: [usize; 2],
    p: &Vector3<f32>,
) -> Option<usize> {
    if !(p.z > 0.0) {
        return None;
    }
    let (u, v) = if camera.distortion.is_some() {
        camera.project(f64::from(p.x / p.z), f64::from(p.y / p.z))
    } else {
        let (x, y) = (f64::from(p.x / p.z), f64::from(p.y / p.z));
        (camera.fx * x + camera.cx, camera.fy * y + camera.cy)
    };
    // Pixel centres are whole numbers.
    let (u, v) = ((u + 0.5) / side_px as f64, (v + 0.5) / side_px as f64);
    let inside = u >= 0.0 && v >= 0.0 && u < width as f64 && v < height as f64;
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
