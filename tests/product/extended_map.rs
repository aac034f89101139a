//! The purpose of a diagnosis: a sensor has an error that its sigma does not describe, a recording of a wall
//! shows it, and correcting it improves the map of another place.

use std::path::Path;

use kinoise::effects::Active;
use kinoise::evaluate::{Delta, evaluate};
use kinoise::io::Assumed;
use kinoise::map::{Options, map};
use kinoise::model::Effect;
use kinoise::sequence::{Sequence, open};
use kinoise::simulate::room::{Film, Room, around_the_desks};
use kinoise::simulate::{Physics, kinect_v1};
use kinoise::{NoiseModel, Seed, SigmaModel};

use crate::common::kinoise;

/// A disparity bowl of three tenths of a pixel at the corner, as of an uncalibrated Kinect.
const BOWL: (&str, &str, f64) = ("radial-disparity-bias", "k_px", 0.3);
/// If the extended model were no better, it would win five of five with probability 1/32; by half or more
/// each time, almost never.
const SEEDS: std::ops::RangeInclusive<u64> = 1..=5;

fn done(arguments: &[&str]) {
    let out = kinoise().args(arguments).output().unwrap();
    // Exit code 1 is the mismatch of diagnose.
    let said = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.code().is_some_and(|code| code < 2), "{arguments:?}: {said}");
}

/// The bare sigma model and the extended one, from 15 views of a wall.
fn models(root: &Path, seed: &str) -> [NoiseModel; 2] {
    let of = |name: &str| root.join(name).to_string_lossy().into_owned();
    let [rec, bare, extended] = ["wall", "bare", "extended"].map(of);
    let effect = format!("{}:{}={}", BOWL.0, BOWL.1, BOWL.2);
    let poses = ["--distances", "1,1.5,2,2.5,3", "--tilts", "0,20,40", "--frames", "2"];
    let sensor = ["--wall-target", "--shrink", "2", "--seed", seed, "--effect", &effect];
    done(&[&["simulate", &rec], &poses[..], &sensor].concat());
    done(&["calibrate", &rec, "-o", &bare, "--form", "paper"]);
    let bare = format!("{bare}/model.json");
    done(&["diagnose", &rec, "-o", &extended, "--model", &bare]);
    [bare, format!("{extended}/model.json")].map(|f| NoiseModel::read(Path::new(&f)).unwrap())
}

/// The office filmed through the same sensor.
fn office(root: &Path, seed: u64) -> Sequence {
    let mut bowl = Effect { id: BOWL.0.into(), ..Effect::default() };
    bowl.parameters.insert(BOWL.1.into(), BOWL.2.into());
    let film = Film {
        sensor: kinect_v1(2),
        room: Room::office(Seed(seed)),
        poses: around_the_desks().into_iter().take(24).collect(),
        physics: Physics::Formula {
            sigma: SigmaModel::paper(),
            effects: Active::all_of_model(&[bowl]).unwrap(),
        },
        seed: Seed(seed),
    };
    let folder = root.join("office");
    film.write(&folder, &|_, _| ()).unwrap();
    open(&folder, &Assumed::default()).unwrap()
}

#[test]
fn a_diagnosed_model_maps_better() {
    halves_the_errors(1..=1);
}

#[test]
#[ignore = "slow: five diagnoses and ten maps"]
fn a_diagnosed_model_maps_better_every_time() {
    halves_the_errors(SEEDS);
}

fn halves_the_errors(seeds: std::ops::RangeInclusive<u64>) {
    for seed in seeds {
        let dir = tempfile::tempdir().unwrap();
        let models = models(dir.path(), &seed.to_string());
        let sequence = office(dir.path(), seed);
        let options = Options { colour: false, ..Options::best() };
        let [bare, extended] = models.map(|model| {
            let told = map(&sequence, &model, &options, &|_, _| ()).unwrap();
            assert_eq!(told.lost(), 0);
            let delta = Delta::Seconds(0.5);
            evaluate(&sequence.truth, &told.trajectory(), delta).unwrap()
        });
        let [ate, rpe] = [
            [&bare.ate.error, &extended.ate.error],
            [&bare.rpe.translation, &extended.rpe.translation],
        ]
        .map(|[bare, extended]| extended.rmse / bare.rmse);
        assert!(ate < 0.5 && rpe < 0.5, "seed {seed}: ATE {ate} and RPE {rpe} of the bare model's");
    }
}
