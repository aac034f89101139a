//! Finds where the lines of a picture cross the target's edge, and sums what they show there.

use super::{Crossing, Edges, INSIDE_PX, MIN_INSIDE_PX};
use crate::camera::Rays;
use crate::diagnose::views::field::Field;
use crate::frame::{DepthTable, Frame};
use crate::stats;

/// Distance from the region within which the background is searched, as a share of the picture's width; the
/// shadow of a Kinect's target at 0.5 m before a far wall takes a seventh.
const FARTHEST: f64 = 0.25;
/// Consecutive pixels that must agree on the background.
const BEHIND_PX: usize = 4;
/// Sigmas by which each of them must lie below the plane: one in 10^11 by chance.
const BELOW_SIGMAS: f64 = 3.0;
/// Least step in sigmas: a pixel half-way is then three from either surface.
const STEP_SIGMAS: f64 = 6.0;
/// Beyond the shadow's end a matching window still sees a part of it: half of a Kinect's nine pixels, of 640.
const FRINGE: f64 = 4.5 / 640.0;
/// Pixels beyond that, which show how much is lost anyway.
const BEYOND_PX: usize = 8;

impl Edges {
    /// Finds where the lines cross the edge in the view's first frame.
    pub fn find(field: &Field, frame: &Frame, rays: &Rays, table: &DepthTable) -> Self {
        let scan = EdgeScan { field, frame, rays, table, on: field.on_target() };
        let mut edges = Edges::default();
        let (mut sigma, mut step, width) = (0.0, 0.0, field.width as isize);
        for (k, &i) in field.pixels.iter().enumerate() {
            for stride in [-1, 1, -width, width] {
                let noise = f64::from(field.sigma[k].max(field.spread_px));
                let Some(crossing) = scan.crossing(i as isize, stride, noise) else { continue };
                step -= crossing.step;
                // Scaled like the residuals.
                let own = scan.plane(crossing.last);
                sigma += noise * (own + crossing.step) / own;
                if let Some(side) = crossing.side {
                    edges.sides[side].rows += 1.0;
                    edges.sides[side].shaded -= crossing.step;
                }
                edges.crossings.push(crossing);
            }
        }
        let n = edges.crossings.len().max(1) as f64;
        (edges.sigma_px, edges.step_px) = (sigma / n, step / n);
        edges
    }

    /// Adds what a frame shows along the crossings.
    pub fn add(&mut self, field: &Field, frame: &Frame, rays: &Rays, table: &DepthTable) {
        self.frames += 1;
        // The first frame chose the last pixel: one beside the target whose gross error lies nearer to the
        // target looks mixed there. Other frames are fair; without any, that pixel is left out.
        if self.frames == 2 {
            self.inside = Default::default();
            self.sides.iter_mut().for_each(|side| side.lost = 0.0);
        }
        let fair = usize::from(self.frames == 1);
        let depth = |i: isize| f64::from(table.metres(frame.raw[i as usize]));
        for c in &self.crossings {
            for (n, sums) in self.inside[..c.inside].iter_mut().enumerate().skip(fair) {
                let i = c.last - n as isize * c.stride;
                // Depth mixes, not disparity: take the share of the step in depth, times the step in px.
                let (own, seen) = (field.plane_at(i as usize, rays), field.scale_px_m / depth(i));
                let residual = (seen - own) * (own + c.step) / seen;
                // A reading nearer to the other surface does not belong to this one.
                if residual.abs() < 0.5 * c.step.abs() {
                    sums.n += 1.0;
                    sums.residual += residual;
                    sums.step += c.step;
                    sums.product += residual * c.step;
                    sums.square += c.step * c.step;
                }
            }
            if let Some(side) = c.side {
                let shadow = shadow_px(c.step);
                let lost = |[from, to]: [usize; 2]| {
                    let lost = |n: &usize| !depth(c.last + (n + 1) as isize * c.stride).is_finite();
                    (from..to).filter(lost).count() as f64
                };
                // The first frame chose the last pixel as one with a reading, so the next is lost too often:
                // alone, it may be the target's.
                let doubtful = usize::from(c.is_doubtful);
                let beyond = shadow + fringe_px(field.width);
                let within = lost([fair * doubtful, shadow]);
                let spans = [[fair.max(doubtful), shadow], [beyond, beyond + BEYOND_PX]];
                let sums = &mut self.sides[side];
                for (counts, span) in sums.counts.iter_mut().zip(spans) {
                    counts[0] += lost(span);
                    counts[1] += (span[1] - span[0]) as f64;
                }
                let anyway = lost(spans[1]) / BEYOND_PX as f64;
                sums.lost += within - anyway * shadow as f64;
            }
        }
    }
}

/// Disparity half-way in depth between two disparities.
fn half_way(a: f64, b: f64) -> f64 {
    2.0 * a * b / (a + b)
}

/// Number of pixels beside the edge that may lie in the shadow.
fn shadow_px(step: f64) -> usize {
    step.abs().ceil() as usize + 1
}

/// Number of pixels past a shadow that are neither in it nor clear of it.
fn fringe_px(width: usize) -> usize {
    (FRINGE * width as f64).ceil() as usize
}

struct EdgeScan<'a> {
    field: &'a Field,
    frame: &'a Frame,
    rays: &'a Rays,
    table: &'a DepthTable,
    /// Whether a pixel is in the target's region.
    on: Vec<bool>,
}

impl EdgeScan<'_> {
    /// Returns the crossing outwards of region pixel `start`; `None` where the next pixel is in the region
    /// too, no background is seen, or the region is too narrow.
    fn crossing(&self, start: isize, stride: isize, sigma: f64) -> Option<Crossing> {
        let at = |n: isize| self.pixel(start, stride, n);
        let off = |n: isize| at(n).filter(|&i| !self.on[i as usize]);
        off(1)?;
        let disparity = |i: isize| {
            self.field.scale_px_m / f64::from(self.table.metres(self.frame.raw[i as usize]))
        };
        let farthest = (FARTHEST * self.field.width as f64) as isize;
        let walk: Vec<(f64, f64)> =
            (1..=farthest).map_while(off).map(|i| (disparity(i), self.plane(i))).collect();
        let below = |(d, plane): &(f64, f64)| *d < plane - BELOW_SIGMAS * sigma;
        let agree = |stretch: &[(f64, f64)]| {
            let [low, high] = stats::range(stretch.iter().map(|d| d.0));
            stretch.iter().all(below) && high - low < STEP_SIGMAS * sigma
        };
        let behind = walk.windows(BEHIND_PX).position(agree)?;
        let there: f64 = walk[behind..behind + BEHIND_PX].iter().map(|d| d.0).sum();
        let there = there / BEHIND_PX as f64;
        // Last pixel nearer to the target than to the background; the region may reach into the shadow.
        let nearer = |n: &isize| {
            let i = at(*n).filter(|i| disparity(*i) > half_way(there, self.plane(*i)));
            i.is_some()
        };
        let last = (-farthest..=behind as isize).rev().find(nearer)?;
        let step = there - self.plane(at(last)?);
        let on_target = |n: &isize| *n > 0 || at(*n).is_some_and(|i| self.on[i as usize]);
        let inside = (0..INSIDE_PX as isize).map(|n| last - n).take_while(on_target).count();
        let reaches_the_region = last < MIN_INSIDE_PX as isize;
        if step > -STEP_SIGMAS * sigma || inside < MIN_INSIDE_PX || !reaches_the_region {
            return None;
        }
        let room = last + (shadow_px(step) + fringe_px(self.field.width) + BEYOND_PX) as isize;
        let side = match stride {
            -1 => Some(0),
            1 => Some(1),
            _ => None,
        };
        let side = side.filter(|_| at(room).is_some() && (1..=room).all(|n| off(n).is_some()));
        let is_lost = |n: isize| at(last + n).is_some_and(|i| !disparity(i).is_finite());
        let is_doubtful = is_lost(1) && !is_lost(2);
        Some(Crossing { last: at(last)?, is_doubtful, stride, step, inside, side })
    }

    fn plane(&self, i: isize) -> f64 {
        self.field.plane_at(i as usize, self.rays)
    }

    /// Pixel `n` strides from `start`, in the same row or column.
    fn pixel(&self, start: isize, stride: isize, n: isize) -> Option<isize> {
        let (width, i) = (self.field.width as isize, start + n * stride);
        let inside = (0..self.frame.raw.len() as isize).contains(&i);
        (inside && (stride.abs() != 1 || i / width == start / width)).then_some(i)
    }
}

#[cfg(test)]
#[path = "scan_tests.rs"]
mod tests;
