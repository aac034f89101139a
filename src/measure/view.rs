//! Measures one view: its frames are read once, in order, and only a few are kept in memory.

use rayon::prelude::*;

use super::budget::distance_budget;
use super::frames::{FrameReader, failed, target_of, view_target};
use super::scan::Scan;
use super::{ViewMeasurement, Workbench};
use crate::error::Result;
use crate::frame::Frame;
use crate::io::read_infrared;
use crate::plane::{Points, RansacOptions, RansacPlane, Target, ransac_plane};
use crate::view::{Excluded, Recording, View, take_out_copies};

/// Measures a view. Fails when no frame can be read or none shows a plane; single bad frames become notes.
pub fn measure_view(view: &View, bench: &Workbench<'_>) -> Result<ViewMeasurement> {
    let mut reader = FrameReader::of(view, bench);
    let (numbers, held) = reader.hold(view)?;
    let target = target_of(view, bench, &held)?;
    let mut scan = Scan::begin(bench, &target, &held);
    let mut strays: Vec<usize> = Vec::new();
    let mut add = |number: usize, frame: &Frame| {
        let taken = scan.add(frame);
        strays.extend((!taken).then_some(number));
        taken
    };
    let mut first = None;
    for (&number, frame) in numbers.iter().zip(&held) {
        let taken = add(number, frame);
        first = first.or(taken.then_some(frame));
    }
    for (number, frame) in reader.by_ref() {
        add(number, &frame);
    }
    let (mut notes, digest) = reader.finish(view);
    notes.extend(stray_note(view, &strays));
    let nothing = || {
        let what = "the residuals of its plane cannot be measured".into();
        failed(view, what, "record the view again")
    };
    let first = first.ok_or_else(nothing)?;
    let paper = by_the_paper(view, bench, &target, first, scan.sigma_perpendicular());
    let infrared = infrared_of(view, &target, bench, &mut notes);
    notes.extend(target.notes.iter().cloned());
    let measured = scan.finish(&target, first).ok_or_else(nothing)?;
    notes.extend(measured.notes);
    let mut measured = ViewMeasurement {
        name: view.name.clone(),
        time_s: view.depth[0].timestamp,
        paper,
        infrared,
        reference_distance_m: view.notes.reference_distance_m,
        reference_uncertainty_m: view.notes.reference_uncertainty_m,
        notes,
        digest,
        ..measured
    };
    measured.distance_budget = distance_budget(&measured, &view.notes, bench.sensor);
    Ok(measured)
}

fn stray_note(view: &View, strays: &[usize]) -> Option<String> {
    let first = view.depth[*strays.first()?].place();
    Some(format!(
        "{} of {} frames left out, the first is {first}: most of the target is not where the first frames show it; \
         such a frame is stale or damaged, or something was moved",
        strays.len(),
        view.depth.len()
    ))
}

/// Fewest views for the remark: a chance of one in 32 if either reading alone were as likely to find a plane.
const MIN_RANGES: usize = 5;

/// Remark for excluded views that show a plane when their raw values are taken as ranges, but not as depths.
pub fn ranges_remark(
    recording: &Recording,
    excluded: &[Excluded],
    bench: &Workbench<'_>,
) -> Option<String> {
    if excluded.len() < MIN_RANGES {
        return None;
    }
    let ranges = Workbench { ray_share: 1.0, ..Workbench::new(bench.sensor, bench.options) };
    let left_out = |v: &&View| excluded.iter().any(|e| e.view == v.name);
    let alone = |v: &&&View| view_target(v, &ranges).is_ok() && view_target(v, bench).is_err();
    let views: Vec<&View> = recording.views.iter().filter(left_out).collect();
    let flat = views.par_iter().filter(alone).count();
    (flat >= MIN_RANGES).then(|| {
        format!(
            "{flat} of the views that were left out hold a plane once raw values are taken for ranges (the length of \
             the ray) instead of depths: `kinoise diagnose -m MODEL` tests this, and `kinoise correct` with the model \
             that it writes makes them depths"
        )
    })
}

/// Removes views with the same region and frames as an earlier view, and returns them as excluded.
pub fn without_copies(recording: &Recording, views: &mut Vec<ViewMeasurement>) -> Vec<Excluded> {
    let region = |name: &str| {
        recording.views.iter().find(|v| v.name == name).and_then(|v| v.notes.region.as_ref())
    };
    let copies =
        take_out_copies(views, |a, b| a.digest == b.digest && region(&a.name) == region(&b.name));
    let told = |(copy, first): (ViewMeasurement, usize)| {
        let reason = format!("it has the same frames as view {}", views[first].name);
        Excluded { view: copy.name, reason }
    };
    copies.into_iter().map(told).collect()
}

/// Mean amplitude over the target in the view's first readable infrared image.
fn infrared_of(
    view: &View,
    target: &Target,
    bench: &Workbench<'_>,
    notes: &mut Vec<String>,
) -> Option<f64> {
    for frame in &view.infrared {
        let camera = &bench.sensor.camera;
        match read_infrared(&frame.path, [camera.width, camera.height]) {
            Ok(image) => {
                let sum: f64 =
                    target.pixels.iter().map(|&i| f64::from(image.raw[i as usize])).sum();
                return Some(sum / target.pixels.len() as f64);
            }
            Err(e) => notes.push(format!("infrared left out: {e}")),
        }
    }
    None
}

/// RANSAC threshold in robust standard deviations; the paper does not give its own.
const THRESHOLD_SIGMAS: f64 = 3.0;
const MIN_THRESHOLD_M: f64 = 0.001;
const CONFIDENCE: f64 = 0.999;

/// The paper's own measurement (Yamaguchi et al. 2016, section II): RANSAC on a view's first frame.
/// Its sigma is low by the cut of the tails (1.3 % at three standard deviations) and is perpendicular to
/// the plane: cos(theta) times the axial sigma for noise along the axis.
fn by_the_paper(
    view: &View,
    bench: &Workbench<'_>,
    target: &Target,
    frame: &Frame,
    sigma_perpendicular_m: f64,
) -> Option<RansacPlane> {
    let mut points = Points::default();
    for &i in &target.pixels {
        let i = i as usize;
        let z = bench.table.metres(frame.raw[i]);
        if z.is_finite() {
            points.push(bench.rays.x[i] * z, bench.rays.y[i] * z, z);
        }
    }
    let threshold_m = bench
        .options
        .ransac_threshold_m
        .unwrap_or((THRESHOLD_SIGMAS * sigma_perpendicular_m).max(MIN_THRESHOLD_M));
    let options = RansacOptions {
        threshold_m,
        iterations: bench.options.ransac_iterations,
        confidence: CONFIDENCE,
    };
    let mut rng = bench.options.seed.stream(&format!("ransac/{}", view.name));
    ransac_plane(&points, &options, &mut rng)
}
