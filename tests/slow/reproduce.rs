//! Every effect of the catalogue, simulated at its typical size where it has something to act on, and
//! diagnosed: the effect printed for a finding must be accepted by the simulator.

use kinoise::diagnose::{DiagnoseOptions, Finding, Status, diagnose};
use kinoise::effects::{Active, CATALOGUE};
use kinoise::io::{Assumed, open};
use kinoise::scene::{PATCH_SIDE_M, Print};
use kinoise::simulate::{Grid, Physics, Scenery, Shoot, kinect_v1, plan_grid};
use kinoise::{NoiseModel, Seed, SigmaModel};

use crate::common;

/// The demo's views, by its sensor at half the resolution.
fn film(effect: Active, frames: usize) -> Shoot {
    let distances_m = vec![1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0];
    let tilts_rad = [0.0f64, 35.0, 60.0, 74.0].map(f64::to_radians).to_vec();
    let poses = Grid { distances_m, tilts_rad }.views_towards(&[0.0, 1.75]);
    let scenery = Scenery {
        print: Print::Patches(PATCH_SIDE_M),
        wall_gap_m: Some(0.6),
        reference_error_m: Some(0.003),
        conditions: true,
        ..Scenery::bare(common::BOARD)
    };
    Shoot {
        sensor: kinect_v1(4),
        views: plan_grid(&poses, &scenery, frames, true, Seed(1)),
        physics: Physics::Formula { sigma: SigmaModel::paper(), effects: vec![effect] },
        infrared: true,
        seed: Seed(1),
    }
}

fn findings(effect: Active) -> Vec<Finding> {
    let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("a temporary folder");
    film(effect, 4).write_quickly(folder.path(), &|_, _| ()).expect("written");
    let recording = open(folder.path(), &Assumed::default()).expect("it opens");
    let options = DiagnoseOptions::default();
    let done = diagnose(&recording, &NoiseModel::paper(), &options, &|_, _| ());
    done.expect("diagnosed").diagnosis.findings
}

#[test]
fn what_is_printed_of_every_named_finding_simulates() {
    let (mut led, mut broken) = (Vec::new(), Vec::new());
    for effect in CATALOGUE {
        let id = effect.card().id;
        for finding in findings(Active::typical(id).expect("known")) {
            let named = matches!(finding.status, Status::Named | Status::OneOf);
            // An effect of only a few views is reported without a strength.
            let of_few =
                finding.shape.as_deref().is_some_and(|s| s.starts_with("only in the views"));
            let Some(name) = finding.effect.filter(|_| named && !of_few) else { continue };
            let printed = finding.as_effect().map(|a| a.argument());
            println!("{id}: {name}: {printed:?}");
            let Some(Ok(read)) = printed.as_deref().map(Active::parse) else {
                // A strength outside the formula's range, such as a negative share, is not printed.
                let knob = kinoise::effects::find(name).expect("known").card().parameters[0];
                let said = finding.parameters.get(knob.name).and_then(|v| v["value"].as_f64());
                if said.is_none_or(|v| (knob.range[0]..=knob.range[1]).contains(&v)) {
                    broken.push(format!("{id}: {name} {:?}", finding.parameters));
                }
                continue;
            };
            let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("a folder");
            let mut short = film(read, 1);
            short.views.truncate(2);
            short.write_quickly(folder.path(), &|_, _| ()).expect("it simulates");
            if name == id {
                led.push(id);
            }
        }
    }
    assert!(broken.is_empty(), "{broken:#?}");
    // Guards against testing an empty list.
    assert!(2 * led.len() > CATALOGUE.len(), "{led:?}");
}
