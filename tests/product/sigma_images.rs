//! `kinoise sigma`: images of the predicted sigma beside the depth images of a film.

use std::path::Path;

use kinoise::correct::{Conditions, Correction, SIGMA_UNITS_PER_METRE};
use kinoise::io::{Assumed, FrameSource};
use kinoise::model::{Effect, UNEXPLAINED};
use kinoise::simulate::Physics;
use kinoise::simulate::room::{Film, Room, around_the_desks};
use kinoise::terms::{Basis, Coordinate, Modulation, Term};
use kinoise::{NoiseModel, Seed, SigmaModel, sequence};
use serde_json::Value;

use super::export_programs::model;
use crate::common::kinoise;

fn film(folder: &Path) {
    let film = Film {
        sensor: Film::kinect(4),
        room: Room::office(Seed(1)),
        poses: around_the_desks().into_iter().take(3).collect(),
        physics: Physics::Formula { sigma: SigmaModel::paper(), effects: Vec::new() },
        seed: Seed(1),
    };
    film.write(folder, &|_, _| ()).expect("written");
}

/// Eq. 1 with twice the variance in the corners, and a bowl.
fn dim() -> NoiseModel {
    let over = |times| Basis::powers(Coordinate::RadiusSquared, 1, times);
    let shape = vec![
        Term::variance(over(Modulation::One), vec![2f64.ln()]),
        Term::bias(over(Modulation::DisparitySquared), vec![0.2]),
    ];
    let effect = Effect { id: UNEXPLAINED.into(), shape, ..Effect::default() };
    NoiseModel { sigma: SigmaModel::paper(), ..model(&Film::kinect(4), vec![effect]) }
}

#[test]
fn every_depth_image_gets_its_sigma() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    film(&at("film"));
    dim().write(&at("model.json")).expect("written");
    let command = || {
        let mut command = kinoise();
        command.arg("sigma").arg(at("film")).arg("-m").arg(at("model.json"));
        command.arg("-o").arg(at("out")).arg("--json");
        command.output().expect("started")
    };
    let run = command();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let said: Value = serde_json::from_slice(&run.stdout).expect("JSON");

    let film = sequence::open(&at("film"), &Assumed::default()).expect("opened");
    assert_eq!(said["frames"], film.moments.len());
    let about: Value =
        serde_json::from_slice(&std::fs::read(at("out/sigma.json")).expect("read")).expect("JSON");
    assert_eq!(about["units_per_metre"], SIGMA_UNITS_PER_METRE);
    let list = std::fs::read_to_string(at("out/sigma.txt")).expect("read");
    let lines: Vec<&str> = list.lines().filter(|l| !l.starts_with('#')).collect();
    let correction = Correction::of(&dim(), &film.sensor).expect("a correction");
    let (width, height) = (film.sensor.camera.width, film.sensor.camera.height);
    for (moment, line) in film.moments.iter().zip(&lines) {
        let (stamp, name) = line.split_once(' ').expect("two words");
        assert!((stamp.parse::<f64>().expect("a stamp") - moment.stamp).abs() < 1e-5);
        let depth_name = moment.depth.path.file_name().expect("a name").to_string_lossy();
        assert!(name.ends_with(&*depth_name), "{name} for {depth_name}");
        let image = FrameSource::new(width, height).read(&at("out").join(name)).expect("an image");
        let depth = film.sensor.code.table().depths(&film.depth(moment).expect("a frame"));
        let session_s = moment.stamp - film.moments[0].stamp;
        let known = Conditions { session_s, ..Conditions::default() };
        let sigma = correction.sigma_m(&depth, &known).expect("sigma");
        for (i, (&raw, sigma)) in image.raw.iter().zip(&sigma).enumerate() {
            assert_eq!(raw == 0, depth[i].is_nan(), "{i}");
            let off = f64::from(raw) - (sigma * SIGMA_UNITS_PER_METRE).min(65535.0);
            assert!(raw == 0 || off.abs() <= 0.5, "{i}: {raw}, not {sigma} m");
        }
    }
    // Almost nowhere is sigma below that of a frontal wall by Eq. 1.
    let frame = film.depth(&film.moments[0]).expect("a frame");
    let depth = film.sensor.code.table().depths(&frame);
    let sigma = correction.sigma_m(&depth, &Conditions::default()).expect("sigma");
    let least = |i: usize| dim().sigma.sigma(f64::from(depth[i]), 0.0);
    let lower = (0..depth.len()).filter(|&i| sigma[i] < 0.98 * least(i)).count();
    assert!(lower * 100 < depth.len(), "{lower} of {} are less than a frontal wall's", depth.len());

    assert!(command().status.success(), "once more over its own");
    std::fs::write(at("film/depth").join("broken.png"), b"x").expect("written");
    let broken = film.moments[1].depth.clone();
    std::fs::write(&broken.path, b"not a PNG").expect("written");
    let run = command();
    let said = String::from_utf8_lossy(&run.stderr);
    assert_eq!(run.status.code(), Some(2), "{said}");
    assert!(said.contains(&*broken.path.file_name().expect("a name").to_string_lossy()), "{said}");
    assert!(at("out/sigma.txt").exists(), "what stood stands");
}
