//! Shooting the very views of a recording again: a simulated twin.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::plan::{ViewPlan, reference};
use crate::camera::Rays;
use crate::effects::ROOM_LUX;
use crate::error::Result;
use crate::measure::{MeasureOptions, Workbench, view_target};
use crate::plane::{Plane, Target as Found};
use crate::rng::Seed;
use crate::scene::{Bench, Target, TargetFrame};
use crate::view::{Excluded, Recording, View, ViewNotes};

/// The views of `recording`: same planes, regions, pixels, frames and timestamps. A reference
/// distance becomes the simulated plane's own, with `reference_error_m` of noise.
///
/// Views without a plane are returned beside, with the reason.
pub fn plan_like(
    recording: &Recording,
    reference_error_m: f64,
    seed: Seed,
) -> (Vec<ViewPlan>, Vec<Excluded>) {
    let options = MeasureOptions { seed, ..MeasureOptions::default() };
    let bench = Workbench::new(&recording.sensor, options);
    let found: Vec<Result<Found>> =
        recording.views.par_iter().map(|view| view_target(view, &bench)).collect();
    let mut plans = Vec::new();
    let mut excluded = recording.excluded.clone();
    for (view, target) in recording.views.iter().zip(found) {
        match target {
            Ok(target) => plans.push(plan(view, &target, &bench, reference_error_m, seed)),
            Err(e) => excluded.push(Excluded::of(&view.name, &e)),
        }
    }
    (plans, excluded)
}

fn plan(
    view: &View,
    target: &Found,
    bench: &Workbench<'_>,
    reference_error_m: f64,
    seed: Seed,
) -> ViewPlan {
    let plane = target.plane;
    let reference_distance_m = view
        .notes
        .reference_distance_m
        .and_then(|_| reference(plane.depth(0.0, 0.0), reference_error_m, seed, &view.name));
    let notes = ViewNotes { reference_distance_m, ..view.notes.clone() };
    let stamps = view.depth.iter().map(|f| f.timestamp).collect();
    plan_on(&view.name, &plane, &target.pixels, &bench.rays, stamps, notes)
}

/// A view of these pixels of a plane.
pub fn plan_on(
    name: &str,
    plane: &Plane,
    pixels: &[u32],
    rays: &Rays,
    stamps: Vec<f64>,
    notes: ViewNotes,
) -> ViewPlan {
    let mut mask = vec![false; rays.x.len()];
    let mut middle = Vector3::zeros();
    for &i in pixels {
        mask[i as usize] = true;
        let (x, y) = rays.at(i as usize);
        middle += Vector3::new(x, y, 1.0) * plane.depth(x, y);
    }
    ViewPlan {
        name: name.into(),
        bench: Bench {
            frame: TargetFrame::on(plane, middle / pixels.len() as f64),
            // The pixels of the real target are its outline.
            ..Bench::bare(*plane, Target::Wall)
        },
        mask: Some(mask),
        // As measured; where it was not, the same in all views.
        ambient_lux: notes.ambient_lux.unwrap_or(ROOM_LUX),
        stamps,
        notes,
    }
}
