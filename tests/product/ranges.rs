//! A sensor that stores the range for the depth, before a board that fills most of a near picture.

use kinoise::diagnose::{DiagnoseOptions, Diagnosis, Finding, Status, Verdict, diagnose};
use kinoise::effects::Active;
use kinoise::io::{Assumed, open};
use kinoise::scene::{Board, Target};
use kinoise::simulate::{Grid, Physics, Shoot, kinect_v1};
use kinoise::{NoiseModel, Seed, SigmaModel};

/// Of a board before a wall, from near and far, with so much of the range in place of the depth: fifteen views.
fn diagnosis(share: f64) -> Diagnosis {
    let folder = tempfile::tempdir().expect("a folder");
    let poses =
        Grid { distances_m: vec![0.9, 1.0, 1.2, 2.4, 3.0], tilts_rad: vec![0.0, 0.4, 0.7] }.views();
    let sigma = SigmaModel::paper();
    let board = Target::Board(Board { width_m: 1.2, height_m: 0.9 });
    let mut shoot = Shoot::plain(kinect_v1(2), board, &poses, 3, sigma.clone(), Seed(5));
    shoot.views.iter_mut().for_each(|view| view.bench.wall_m = Some(4.5));
    let ranges = Active::parse(&format!("range-not-depth:share={share}")).expect("an effect");
    shoot.physics = Physics::Formula { sigma, effects: vec![ranges] };
    shoot.write(folder.path(), &|_, _| ()).expect("written");
    let recording = open(folder.path(), &Assumed::default()).expect("a recording");
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
