//! Residuals of a few views as pictures: as recorded, with the bias found subtracted, and of the view's
//! twin. Computed here, drawn elsewhere.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::engine::Diagnosed;
use super::views::field::Field;
use super::views::known::KnownTerms;
use crate::camera::Rays;
use crate::frame::Frame;
use crate::measure::{MeasureOptions, Workbench};
use crate::model::NoiseModel;
use crate::solve::plane_through;
use crate::terms::ANYWHERE;
use crate::view::Sensor;

/// One view, row by row, mm of depth, measured minus the plane; NaN off the target.
#[derive(Debug, Clone)]
pub struct ViewPictures {
    /// Index among the diagnosed views.
    pub view: usize,
    pub width: usize,
    pub height: usize,
    /// Mean over the frames about the view's plane.
    pub before: Vec<f32>,
    /// Without the bias found, about a refitted plane.
    pub after: Vec<f32>,
    /// The twin, measured as the recording was.
    pub twin: Option<Vec<f32>>,
}

/// Retakes a view: maps its number and field to frames and their times since the first, s.
pub type Retake<'a> = &'a (dyn Fn(usize, &Field) -> Option<Vec<(f64, Frame)>> + Sync);

/// Number of views shown; more tire the reader.
const VIEWS: usize = 3;
/// Width of the widest picture, px; wider ones only show grain.
const WIDEST: usize = 400;

/// Pictures of the views that changed most, spread over the distances. `model` is the one diagnosed.
pub fn pictures(
    done: &Diagnosed,
    sensor: &Sensor,
    model: &NoiseModel,
    retake: Retake<'_>,
) -> Vec<ViewPictures> {
    let bench = Workbench::new(sensor, MeasureOptions::default());
    let mut known = KnownTerms::of(model, &sensor.camera);
    known.bias.extend(done.taken_out.iter().map(|t| (t.clone(), ANYWHERE)));
    worth_seeing(done)
        .into_par_iter()
        .map(|view| {
            let field = &done.fields[view];
            let stored = |field: &Field, mut read: Vec<f32>| {
                let taken_out = field.taken_out(&done.taken_out, &bench);
                read.iter_mut().zip(taken_out).for_each(|(r, taken)| *r += taken);
                read
            };
            let twin = retake(view, field).map(|frames| {
                let frames = frames.into_iter();
                let twin = field.with_frames(frames, &bench, &model.sigma, &known);
                stored(&twin, twin.mean.clone())
            });
            let mut left = done.read(view);
            let recorded = stored(field, left.clone());
            let found = done.bias_px.get(view).into_iter().flatten();
            left.iter_mut().zip(found).for_each(|(r, bias)| *r -= bias);
            let show = |values: &[f32]| {
                let depths = in_depth(field, &about_plane(field, values, &bench.rays), &bench.rays);
                shrunk(&field.image(&depths), field)
            };
            let (width, height, before) = show(&recorded);
            let (_, _, after) = show(&left);
            let twin = twin.map(|t| show(&t).2);
            ViewPictures { view, width, height, before, after, twin }
        })
        .collect()
}

/// The most changed view of each of the nearest, middle and farthest third of the views.
fn worth_seeing(done: &Diagnosed) -> Vec<usize> {
    let lines = &done.diagnosis.views;
    let mut order: Vec<usize> = (0..lines.len().min(done.fields.len())).collect();
    order.sort_by(|&a, &b| lines[a].z_m.total_cmp(&lines[b].z_m));
    let changed = |v: usize| lines[v].bowl_px_before.powi(2) - lines[v].bowl_px_after.powi(2);
    order
        .chunks(order.len().div_ceil(VIEWS).max(1))
        .filter_map(|third| {
            third.iter().copied().max_by(|&a, &b| changed(a).total_cmp(&changed(b)))
        })
        .collect()
}

/// Subtracts the plane that is left in `values`.
fn about_plane(field: &Field, values: &[f32], rays: &Rays) -> Vec<f32> {
    let at = |i: u32| {
        let (x, y) = rays.at(i as usize);
        [x, y]
    };
    let pairs = || field.pixels.iter().zip(values);
    let plane = plane_through(pairs().map(|(&i, &value)| (at(i), f64::from(value), 1.0)));
    let plane = plane.unwrap_or_else(Vector3::zeros);
    let of_plane = |[x, y]: [f64; 2]| plane.dot(&Vector3::new(1.0, x, y)) as f32;
    pairs().map(|(&i, &value)| value - of_plane(at(i))).collect()
}

/// Converts errors of the disparity, px, into errors of the depth, mm; a larger disparity is nearer.
fn in_depth(field: &Field, values: &[f32], rays: &Rays) -> Vec<f32> {
    let depth = |(k, &px): (usize, &f32)| {
        let slope = -1e3 * field.scale_px_m / field.disparity(k, rays).powi(2);
        (slope * f64::from(px)) as f32
    };
    values.iter().enumerate().map(depth).collect()
}

/// Averages square patches of pixels so that the picture is narrow enough.
fn shrunk(image: &[f32], field: &Field) -> (usize, usize, Vec<f32>) {
    let side = field.width.div_ceil(WIDEST).max(1);
    let (width, height) = (field.width / side, field.height / side);
    let patch = |k: usize| {
        let (u0, v0) = (k % width * side, k / width * side);
        let inside = (v0..v0 + side).flat_map(|v| (u0..u0 + side).map(move |u| (u, v)));
        let values = inside.map(|(u, v)| image[v * field.width + u]).filter(|e| e.is_finite());
        let (sum, n) = values.fold((0.0, 0.0), |(sum, n), e| (sum + e, n + 1.0));
        if n > 0.0 { sum / n } else { f32::NAN }
    };
    (width, height, (0..width * height).map(patch).collect())
}
