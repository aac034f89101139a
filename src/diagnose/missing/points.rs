//! Shares lost along an axis, view by view.

use super::cells::Cell;
use super::shapes::Step;
use crate::camera::Rays;
use crate::diagnose::views::field::Field;
use crate::diagnose::views::margins::Margins;

/// Share lost where the axis is at `x`, in one view.
#[derive(Debug, Clone, Copy)]
pub struct Point {
    pub view: usize,
    pub x: f64,
    pub share: f64,
    pub asked: f64,
    /// Whether the share is a lower bound.
    pub at_least: bool,
}

/// Bins over an axis's reach: a tilted view spans several, and a band of a few per cent still shows.
pub const BINS: usize = 40;

/// Share lost from which the target search passes over the holes, so that shares are lower bounds.
const HOLES: f64 = 0.4;

/// Marks points beyond the first bin with holes as lower bounds, in views whose region was not given.
pub fn bounded(mut points: Vec<Point>, step: &Step, region_given: &[bool]) -> Vec<Point> {
    let beyond = |p: &Point| p.x * step.width.signum();
    let from = points.iter().filter(|p| p.share > HOLES).map(beyond).fold(f64::INFINITY, f64::min);
    for p in &mut points {
        p.at_least = !region_given[p.view] && beyond(p) >= from;
    }
    points
}

/// Index of the equal part of a span that holds `x`, clamped to the outermost parts.
pub fn part(x: f64, [low, high]: [f64; 2], parts: usize) -> usize {
    let width = ((high - low) / parts as f64).max(f64::MIN_POSITIVE);
    (((x - low) / width).max(0.0) as usize).min(parts - 1)
}

/// Shares lost per view and bin of an axis; `at` gives a cell's place on it, if it counts.
pub fn points(
    views: &[Vec<Cell<'_>>],
    at: &dyn Fn(&Cell<'_>) -> Option<f64>,
    span: [f64; 2],
) -> Vec<Point> {
    let along = |c: &Cell<'_>| Some([at(c)?, c.lost, c.asked]);
    let of_view =
        |(view, cells): (usize, &Vec<Cell<'_>>)| binned(view, cells.iter().filter_map(along), span);
    views.iter().enumerate().flat_map(of_view).collect()
}

/// Same over depth, pixel by pixel within the span: a tile of a steep target spans more depth than an edge is
/// wide.
pub fn points_of_pixels(
    fields: &[Field],
    rays: &Rays,
    margins: &Margins,
    span @ [near, far]: [f64; 2],
) -> Vec<Point> {
    let of_view = |(view, field): (usize, &Field)| {
        let asked = field.frames.len() as f64;
        let at = |(&i, &measured): (&u32, &u16)| {
            let i = i as usize;
            let z = field.plane.depth_at(rays, i);
            let counts =
                z >= near && z <= far && margins.hold_pixel(i % field.width, i / field.width);
            counts.then(|| [z, asked - f64::from(measured), asked])
        };
        binned(view, field.pixels.iter().zip(&field.measured).filter_map(at), span)
    };
    fields.iter().enumerate().flat_map(of_view).collect()
}

/// Bins one view's places on the axis, each with what was lost and asked there, into shares.
fn binned(view: usize, all: impl Iterator<Item = [f64; 3]>, span: [f64; 2]) -> Vec<Point> {
    let mut sums = [[0.0; 3]; BINS];
    for [x, lost, asked] in all {
        let sum = &mut sums[part(x, span, BINS)];
        *sum = [sum[0] + asked, sum[1] + lost, sum[2] + asked * x];
    }
    let point = |&[asked, lost, x]: &[f64; 3]| Point {
        view,
        x: x / asked,
        share: lost / asked,
        asked,
        at_least: false,
    };
    sums.iter().filter(|s| s[0] > 0.0).map(point).collect()
}

/// Standard deviation of views about the step, in log odds, and number of neighbours lost together.
const OFF: f64 = 0.3;
const TOGETHER: f64 = 16.0;
/// Smallest standard error of a share.
const MIN_ERROR: f64 = 0.002;
/// Residual of a point from an expected loss, in standard errors.
pub fn misfit(p: &Point, loss: f64) -> f64 {
    // Midway between expected and observed: neither alone may claim certainty.
    let half = 0.5 * (loss + p.share);
    let spread = half * (1.0 - half);
    let variance = spread * TOGETHER / p.asked + (OFF * spread).powi(2) + MIN_ERROR * MIN_ERROR;
    let off = if p.at_least { (p.share - loss).max(0.0) } else { p.share - loss };
    off / variance.sqrt()
}
