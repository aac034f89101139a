//! A sensor that stores the range for the depth, before a board that fills most of a near picture.

use std::path::Path;

use kinoise::diagnose::{DiagnoseOptions, Diagnosis, Finding, Status, Verdict, diagnose};
use kinoise::effects::Active;
use kinoise::io::{Assumed, open};
use kinoise::scene::{Board, Target};
use kinoise::simulate::{Grid, Physics, Shoot, kinect_v1};
use kinoise::{NoiseModel, Seed, SigmaModel};

use crate::common::capture::frames_of;
use crate::common::write_depth;

/// Views of a target, with so much of the range in place of the depth.
fn shoot(target: Target, share: f64, distances_m: &[f64], tilts_rad: &[f64], folder: &Path) {
    let poses = Grid { distances_m: distances_m.to_vec(), tilts_rad: tilts_rad.to_vec() }.views();
    let sigma = SigmaModel::paper();
    let mut shoot = Shoot::plain(kinect_v1(2), target, &poses, 3, sigma.clone(), Seed(5));
    let ranges = Active::parse(&format!("range-not-depth:share={share}")).expect("an effect");
    shoot.physics = Physics::Formula { sigma, effects: vec![ranges] };
    shoot.write(folder, &|_, _| ()).expect("written");
}

/// A board before a wall, from near and far: fifteen views.
fn diagnosis(share: f64) -> Diagnosis {
    let folder = tempfile::tempdir().expect("a folder");
    let [front, back] = ["board", "wall"].map(|name| folder.path().join(name));
    let board = Target::Board(Board { width_m: 1.2, height_m: 0.9 });
    shoot(board, share, &[0.9, 1.0, 1.2, 2.4, 3.0], &[0.0, 0.4, 0.7], &front);
    shoot(Target::Wall, share, &[4.5], &[0.0], &back);
    let wall = frames_of(&open(&back, &Assumed::default()).expect("a wall")).remove(0);
    let recording = open(&front, &Assumed::default()).expect("a recording");
    let images = recording.views.iter().flat_map(|v| &v.depth);
    for (image, mut frame) in images.zip(frames_of(&recording)) {
        for (raw, behind) in frame.raw.iter_mut().zip(&wall.raw) {
            *raw = if *raw == 0 { *behind } else { *raw };
        }
        write_depth(&image.path, &frame);
    }
    let options = DiagnoseOptions::default();
    let found = diagnose(&recording, &NoiseModel::paper(), &options, &|_, _| ());
    found.expect("diagnosed").diagnosis
}

/// Read as depths, most of the nine near views hold no plane at all: the range bends the board by 15 % of
/// its distance towards its corners. As ranges all fifteen do, and nothing else is wrong with them.
#[test]
fn views_that_are_flat_as_ranges_alone_tell_ranges() {
    let said = diagnosis(1.0);
    // The simulated noise is that of the depth which is stored: a little more than the model's.
    let large = |f: &&Finding| f.status != Status::NotIdentifiable && !f.minor;
    let told = said.findings.iter().filter(large);
    assert_eq!(told.map(|f| f.effect).collect::<Vec<_>>(), [Some("range-not-depth")]);
    assert_eq!(said.after.verdict, Verdict::Match, "{:?}", said.after.remaining);
    assert_eq!(said.views.len(), 15);
}

/// What is neither range nor depth is told with its share, by the views that are flat enough.
#[test]
fn a_part_of_the_range_is_no_range() {
    let said = diagnosis(0.8);
    assert_eq!(said.findings[0].effect, Some("range-not-depth"));
    let share = said.findings[0].value("share").expect("a share");
    assert!((share - 0.8).abs() < 0.1, "{share}");
}
