//! The band beside the target that the projector cannot light.
//!
//! Along a row the band is as many pixels wide as the disparity falls from the target's border to
//! what is behind: fx b (1/z - 1/z_behind), on the side away from the projector.

use super::field::{CLIP_SIGMAS, Field};
use crate::camera::Rays;
use crate::frame::{DepthTable, Frame};
use crate::stats::median_in_place;

/// One side of the target in one view: medians over the rows, px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Side {
    pub width_px: f64,
    /// Were all of the baseline at work.
    pub expected_px: f64,
    pub rows: usize,
}

/// What lies beside the target in a view's first frame; `None` where that cannot be seen.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Shadow {
    pub left: Option<Side>,
    pub right: Option<Side>,
}

/// Fewer rows give no median.
const FEWEST_ROWS: usize = 8;
/// Pixels that must look behind, one after the other: a gross error or a mixed edge pixel has none.
const BEHIND: usize = 5;

impl Shadow {
    pub fn beside(field: &Field, frame: &Frame, rays: &Rays, table: &DepthTable) -> Self {
        let mut rows: Vec<[usize; 2]> = Vec::new();
        for k in 0..field.pixels.len() {
            let row = field.pixels[k] as usize / field.width;
            match rows.last_mut() {
                Some([_, last]) if field.pixels[*last] as usize / field.width == row => *last = k,
                _ => rows.push([k, k]),
            }
        }
        let side = |step: isize| {
            let walk = Walk { field, frame, rays, table, step };
            let border = |ends: &[usize; 2]| walk.from(ends[usize::from(step > 0)]);
            summary(rows.iter().filter_map(border).collect())
        };
        Shadow { left: side(-1), right: side(1) }
    }
}

fn summary(rows: Vec<(f32, f32)>) -> Option<Side> {
    if rows.len() < FEWEST_ROWS {
        return None;
    }
    let (mut widths, mut expected): (Vec<f32>, Vec<f32>) = rows.iter().copied().unzip();
    Some(Side {
        width_px: f64::from(median_in_place(&mut widths)),
        expected_px: f64::from(median_in_place(&mut expected)),
        rows: rows.len(),
    })
}

/// Along a row, away from the target.
struct Walk<'a> {
    field: &'a Field,
    frame: &'a Frame,
    rays: &'a Rays,
    table: &'a DepthTable,
    step: isize,
}

impl Walk<'_> {
    /// Width without a measurement, and disparity lost to what is behind, px; `None` where nothing
    /// is seen behind.
    fn from(&self, k: usize) -> Option<(f32, f32)> {
        let clip = f64::from(CLIP_SIGMAS * self.field.sigma[k].max(self.field.spread_px));
        let start = self.field.pixels[k] as usize;
        let row = start - start % self.field.width;
        let mut border = self.plane(start);
        let (mut lost, mut lost_before, mut behind) = (0, 0, Vec::with_capacity(BEHIND));
        let mut u = (start - row) as isize + self.step;
        while (0..self.field.width as isize).contains(&u) {
            let i = row + u as usize;
            let z = f64::from(self.table.metres(self.frame.raw[i]));
            let plane = self.plane(i);
            let disparity = self.field.scale_px_m / z;
            if !z.is_finite() {
                lost += 1;
                behind.clear();
            } else if (disparity - plane).abs() <= clip {
                // Still the target.
                border = plane;
                lost = 0;
                behind.clear();
            } else if disparity < plane {
                if behind.is_empty() {
                    lost_before = lost;
                }
                behind.push(disparity as f32);
                if behind.len() == BEHIND {
                    let fall = border as f32 - median_in_place(&mut behind);
                    return Some((lost_before as f32, fall));
                }
            } else {
                behind.clear();
            }
            u += self.step;
        }
        None
    }

    /// Disparity of the target's plane, px.
    fn plane(&self, i: usize) -> f64 {
        let (x, y) = self.rays.at(i);
        self.field.scale_px_m * self.field.plane.inverse_depth(x, y)
    }
}
