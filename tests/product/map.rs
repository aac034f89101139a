//! `kinoise map` on films of the simulated office: its results, and its reports on bad films.

use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use kinoise::evaluate::{Delta, evaluate};
use kinoise::io::Assumed;
use kinoise::map::{Init, Mapped, Method, Options, Weights, map};
use kinoise::model::{Effect, UNEXPLAINED};
use kinoise::sequence::{Sequence, open};
use kinoise::simulate::Physics;
use kinoise::simulate::room::{Film, Pose, Room, around_the_desks};
use kinoise::terms::{Basis, Coordinate, Modulation, Term};
use kinoise::{NoiseModel, Seed, SigmaModel};
use nalgebra::Isometry3;

/// Writes a film of 160 x 120 px along the poses.
pub fn film(root: &Path, poses: Vec<Pose>) -> PathBuf {
    let film = Film {
        sensor: Film::kinect(4),
        room: Room::office(Seed(1)),
        poses,
        physics: Physics::Formula { sigma: SigmaModel::paper(), effects: Vec::new() },
        seed: Seed(7),
    };
    let folder = root.join("film");
    film.write(&folder, &|_, _| ()).unwrap();
    folder
}

fn some(n: usize) -> Vec<Pose> {
    around_the_desks().into_iter().take(n).collect()
}

/// Blocks of 2 px: as many points as these small images have.
pub fn best() -> Options {
    Options { block_px: 2, ..Options::best() }
}

pub fn mapped(sequence: &Sequence, options: &Options) -> Mapped {
    map(sequence, &NoiseModel::paper(), options, &|_, _| ()).unwrap()
}

fn rpe_of(sequence: &Sequence, options: &Options) -> f64 {
    let trajectory = mapped(sequence, options).trajectory();
    let told = evaluate(&sequence.truth, &trajectory, Delta::Seconds(0.5)).unwrap();
    told.rpe.translation.rmse
}

pub fn kinoise(arguments: &[&str]) -> (i32, String) {
    let out = Command::cargo_bin("kinoise").unwrap().args(arguments).output().unwrap();
    let said = String::from_utf8_lossy(&out.stderr).into_owned();
    (out.status.code().unwrap(), said)
}

fn map_folder(folder: &Path, more: &[&str]) -> (i32, String, PathBuf) {
    let out = folder.parent().unwrap().join("out");
    let mut arguments = vec!["map", folder.to_str().unwrap(), "-o", out.to_str().unwrap()];
    arguments.extend(["--block", "2"]);
    arguments.extend(more);
    let (code, said) = kinoise(&arguments);
    (code, said, out)
}

fn poses_in(out: &Path) -> usize {
    let text = fs::read_to_string(out.join("trajectory.txt")).unwrap();
    assert!(!text.contains("NaN"), "{text}");
    text.lines().filter(|l| !l.starts_with('#')).count()
}

/// The full pipeline, and the ranking of the methods: alignment to the map drifts least.
#[test]
fn a_walk_through_the_office_is_followed() {
    let dir = tempfile::tempdir().unwrap();
    let sequence = open(&film(dir.path(), some(60)), &Assumed::default()).unwrap();
    let paper = Options::paper(Weights::Model, Init::None);
    let [paper, frames, model] = [
        rpe_of(&sequence, &paper),
        rpe_of(&sequence, &Options { method: Method::Projective, ..best() }),
        rpe_of(&sequence, &best()),
    ];
    assert!(model < frames && frames < paper, "{paper} {frames} {model}");
    assert!(model < 0.01, "{model}");
}

#[test]
fn outputs_are_whole_and_start_at_the_identity() {
    let dir = tempfile::tempdir().unwrap();
    let (code, said, out) = map_folder(&film(dir.path(), some(12)), &[]);
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("not compared with the ground truth"), "{said}");
    assert_eq!(poses_in(&out), 12);
    let text = fs::read_to_string(out.join("trajectory.txt")).unwrap();
    let first = text.lines().nth(1).unwrap();
    assert!(
        first.ends_with(
            "0.000000000 0.000000000 0.000000000 0.000000000 0.000000000 0.000000000 1.000000000"
        ),
        "{first}"
    );
    let ply = fs::read(out.join("map.ply")).unwrap();
    let end = ply.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let header = String::from_utf8_lossy(&ply[..end]).into_owned();
    let count: usize =
        header.lines().find_map(|l| l.strip_prefix("element vertex ")).unwrap().parse().unwrap();
    assert_eq!(ply.len() - end, 31 * count);
    assert!(count > 1000);
    let stats: serde_json::Value =
        serde_json::from_slice(&fs::read(out.join("stats.json")).unwrap()).unwrap();
    for key in ["frames", "lost", "iterations", "ms", "peak_rss_mb", "settings"] {
        assert!(stats.get(key).is_some(), "{key}");
    }
}

/// The bytes do not depend on the number of threads.
#[test]
fn threads_change_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let folder = film(dir.path(), some(8));
    for method in ["model", "paper"] {
        let bytes: Vec<[Vec<u8>; 2]> = ["1", "2", "5"]
            .map(|n| {
                let (code, said, out) = map_folder(&folder, &["--threads", n, "--method", method]);
                assert_eq!(code, 0, "{said}");
                ["trajectory.txt", "map.ply"].map(|f| fs::read(out.join(f)).unwrap())
            })
            .into();
        assert!(bytes[0] == bytes[1] && bytes[0] == bytes[2], "{method}");
    }
}

/// A damaged image costs its own frame only.
#[test]
fn a_damaged_image_is_told_and_passed_over() {
    let dir = tempfile::tempdir().unwrap();
    let folder = film(dir.path(), some(10));
    let mut depths: Vec<PathBuf> =
        fs::read_dir(folder.join("depth")).unwrap().map(|e| e.unwrap().path()).collect();
    depths.sort();
    let bytes = fs::read(&depths[5]).unwrap();
    fs::write(&depths[5], &bytes[..bytes.len() / 2]).unwrap();
    let (code, said, out) = map_folder(&folder, &[]);
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("lost in 1 of 10") && said.contains("damaged"), "{said}");
    assert_eq!(poses_in(&out), 9);
}

#[test]
fn an_option_that_the_method_does_not_use_is_told() {
    let dir = tempfile::tempdir().unwrap();
    let folder = film(dir.path(), some(3));
    let told = |more: &[&str]| {
        let (code, said, _) = map_folder(&folder, more);
        assert_eq!(code, 0, "{said}");
        ["--voxel", "--block", "--memory"].map(|o| said.contains(&format!("{o} has no effect")))
    };
    let all = ["--memory", "5", "--voxel", "0.03", "--method"];
    for (method, unused) in [
        ("paper", [false, true, true]),
        ("projective", [true, false, true]),
        ("model", [true, false, false]),
    ] {
        assert_eq!(told(&[&all[..], &[method]].concat()), unused, "{method}");
    }
}

/// A curve over the temperature shifts the map where the film tells its temperature, and is told elsewhere.
#[test]
fn a_bias_over_the_temperature_needs_it() {
    let dir = tempfile::tempdir().unwrap();
    let mut sequence = open(&film(dir.path(), some(3)), &Assumed::default()).unwrap();
    let (over, times) = (Coordinate::Temperature, Modulation::One);
    let curve = Basis::Curve { over, low: 20.0, high: 40.0, nodes: 2, times };
    let shape = vec![Term::bias(curve, vec![0.05, 0.1])];
    let warm = Effect { id: UNEXPLAINED.into(), shape, ..Effect::default() };
    let model = NoiseModel { effects: vec![warm], ..NoiseModel::paper() };
    let map_of = |sequence: &Sequence| map(sequence, &model, &best(), &|_, _| ()).unwrap();
    let cold = map_of(&sequence);
    assert!(cold.remarks.iter().any(|r| r.contains("the temperature is unknown")));
    assert_eq!(cold.map, mapped(&sequence, &best()).map);
    sequence.temperature_c = Some(30.0);
    let warm = map_of(&sequence);
    assert!(!warm.remarks.iter().any(|r| r.contains("temperature")), "{:?}", warm.remarks);
    assert_ne!(warm.map, cold.map);
}

#[test]
fn damaged_colour_costs_no_pose() {
    let dir = tempfile::tempdir().unwrap();
    let folder = film(dir.path(), some(6));
    for entry in fs::read_dir(folder.join("rgb")).unwrap() {
        fs::write(entry.unwrap().path(), b"no picture").unwrap();
    }
    let (code, said, out) = map_folder(&folder, &[]);
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("mapped without colour"), "{said}");
    assert_eq!(poses_in(&out), 6);
}

/// No depth at all is a failure that says so.
#[test]
fn empty_depth_is_no_map() {
    let dir = tempfile::tempdir().unwrap();
    let folder = film(dir.path(), some(4));
    let empty = kinoise::Frame { width: 160, height: 120, raw: vec![0; 160 * 120] };
    let bytes = kinoise::io::encode_png16(&empty).unwrap();
    for entry in fs::read_dir(folder.join("depth")).unwrap() {
        fs::write(entry.unwrap().path(), &bytes).unwrap();
    }
    for method in ["model", "paper", "projective"] {
        let (code, said, _) = map_folder(&folder, &["--method", method]);
        assert_eq!(code, 2, "{said}");
        assert!(said.contains("0 points with a surface"), "{said}");
    }
}

/// A camera that does not move is reported, and so is a driver that repeats frames.
#[test]
fn a_frozen_camera_is_told() {
    let dir = tempfile::tempdir().unwrap();
    let folder = film(dir.path(), some(5));
    let mut depths: Vec<PathBuf> =
        fs::read_dir(folder.join("depth")).unwrap().map(|e| e.unwrap().path()).collect();
    depths.sort();
    for path in &depths[1..] {
        fs::copy(&depths[0], path).unwrap();
    }
    let (code, said, _) = map_folder(&folder, &[]);
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("4 of 5 depth images are the one before"), "{said}");
    assert!(said.contains("the camera never moved"), "{said}");
}

/// A camera lifted and put down a metre aside and turned is lost and reported; the map so far is kept.
#[test]
fn a_jump_is_told_and_the_path_before_it_kept() {
    let dir = tempfile::tempdir().unwrap();
    let mut poses = some(14);
    let aside = Isometry3::new(nalgebra::Vector3::new(1.0, 0.0, 0.0), nalgebra::Vector3::y() * 0.7);
    for pose in &mut poses[8..] {
        pose.world_from_camera *= aside;
    }
    for method in ["model", "paper", "projective"] {
        let folder = dir.path().join(method);
        fs::create_dir(&folder).unwrap();
        let (code, said, out) = map_folder(&film(&folder, poses.clone()), &["--method", method]);
        assert_eq!(code, 0, "{said}");
        assert!(said.contains("lost in 6 of 14"), "{method}: {said}");
        assert!(said.contains("the trajectory ends early"), "{said}");
        assert_eq!(poses_in(&out), 8);
    }
}

/// A metre aside without a rotation: floor and walls still find neighbours, but far fewer than before.
#[test]
fn a_bare_jump_is_told_too() {
    let dir = tempfile::tempdir().unwrap();
    for (k, aside) in [[1.0, 0.0], [0.0, 1.0], [-0.7, 0.7]].into_iter().enumerate() {
        let mut poses = some(14);
        for pose in &mut poses[8..] {
            let t = &mut pose.world_from_camera.translation.vector;
            (t.x, t.y) = (t.x + aside[0], t.y + aside[1]);
        }
        let root = dir.path().join(k.to_string());
        fs::create_dir(&root).unwrap();
        let folder = film(&root, poses);
        for method in ["model", "paper", "projective"] {
            let (code, said, out) = map_folder(&folder, &["--method", method]);
            assert_eq!(code, 0, "{said}");
            assert!(said.contains("lost in 6 of 14"), "{method} {aside:?}: {said}");
            assert_eq!(poses_in(&out), 8);
        }
    }
}

/// The invalid word of raw disparities, 2047, is NaN inside: images full of it are reported, holes are
/// skipped.
#[test]
fn words_for_nothing_make_no_poses() {
    let dir = tempfile::tempdir().unwrap();
    let folder = film(dir.path(), some(6));
    let metric = open(&folder, &Assumed::default()).unwrap();
    let recording = folder.join("recording.json");
    let text = fs::read_to_string(&recording).unwrap();
    let disparity =
        "\"raw_disparity\": {\"offset\": 3.3309, \"slope\": -0.0030711, \"invalid\": 2047}";
    let mut value: serde_json::Value = serde_json::from_str(&text).unwrap();
    let entries = value.as_object_mut().unwrap();
    entries.remove("units_per_metre");
    entries.remove("invalid");
    let raw: serde_json::Value = serde_json::from_str(&format!("{{{disparity}}}")).unwrap();
    entries.insert("raw_disparity".into(), raw["raw_disparity"].clone());
    fs::write(&recording, value.to_string()).unwrap();
    let mut depths: Vec<PathBuf> =
        fs::read_dir(folder.join("depth")).unwrap().map(|e| e.unwrap().path()).collect();
    depths.sort();
    for (k, (path, moment)) in depths.iter().zip(&metric.moments).enumerate() {
        let metric = metric.depth(moment).unwrap();
        let word = |&w: &u16| match w {
            0 => 2047,
            w => ((3.3309 - 5000.0 / f64::from(w)) / 0.003_071_1).round() as u16,
        };
        let words = metric.raw.iter().map(|w| if k == 3 { 2047 } else { word(w) }).collect();
        let frame = kinoise::Frame { raw: words, ..metric };
        fs::write(path, kinoise::io::encode_png16(&frame).unwrap()).unwrap();
    }
    let (code, said, out) = map_folder(&folder, &[]);
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("lost in 1 of 6") && said.contains("0 points"), "{said}");
    assert_eq!(poses_in(&out), 5);
}

/// A bare wall fills every image: the motion along it is not determined, and this is reported.
#[test]
fn a_bare_wall_is_told() {
    let dir = tempfile::tempdir().unwrap();
    let folder = film(dir.path(), some(6));
    let wall = kinoise::Frame { width: 160, height: 120, raw: vec![10_000; 160 * 120] };
    let bytes = kinoise::io::encode_png16(&wall).unwrap();
    for entry in fs::read_dir(folder.join("depth")).unwrap() {
        fs::write(entry.unwrap().path(), &bytes).unwrap();
    }
    for method in ["model", "paper", "projective"] {
        let (code, said, out) = map_folder(&folder, &["--method", method]);
        assert_eq!(code, 0, "{said}");
        assert!(said.contains("depth does not determine the whole motion"), "{method}: {said}");
        assert_eq!(poses_in(&out), 6);
    }
}

#[test]
fn ground_truth_of_another_time_is_told() {
    let dir = tempfile::tempdir().unwrap();
    let folder = film(dir.path(), some(5));
    fs::write(folder.join("groundtruth.txt"), "1.0 0 0 0 0 0 0 1\n2.0 0 0 0 0 0 0 1\n").unwrap();
    let (code, said, out) = map_folder(&folder, &[]);
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("not compared with the ground truth"), "{said}");
    let truth = folder.join("groundtruth.txt");
    let estimate = out.join("trajectory.txt");
    let (code, said) = kinoise(&[
        "evaluate",
        "--truth",
        truth.to_str().unwrap(),
        "--estimate",
        estimate.to_str().unwrap(),
    ]);
    assert_eq!(code, 2);
    assert!(said.contains("0 poses of the estimate"), "{said}");
}

#[cfg(feature = "opencv")]
#[test]
fn the_orb_start_carries_over_large_steps() {
    let dir = tempfile::tempdir().unwrap();
    let path: Vec<Pose> = around_the_desks().into_iter().step_by(6).take(6).collect();
    let sequence = open(&film(dir.path(), path), &Assumed::default()).unwrap();
    let told = mapped(&sequence, &Options { init: Init::Orb, ..best() });
    assert_eq!(told.lost(), 0, "{:?}", told.remarks);
}
