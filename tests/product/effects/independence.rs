//! Effects do not disturb each other: identities, random streams, threads.

use std::path::{Path, PathBuf};

use kinoise::Seed;
use kinoise::effects::{Active, CATALOGUE, Card};
use kinoise::model::PAPER_EQ1;
use kinoise::scene::{Board, Target};
use kinoise::simulate::{Physics, Scenery, Shoot, kinect_v1, plan_grid};

use super::laboratory::{Laboratory, difference, instant, sd};

/// A tilted board in front of a wall: something for every effect to act on.
fn stage(effects: Vec<Active>) -> Laboratory {
    let mut lab = Laboratory::wall(1.2, 40.0, 30.0).noise(0.003);
    lab.bench.target = Target::Board(Board { width_m: 0.6, height_m: 0.5 });
    lab.bench.wall_m = Some(2.5);
    lab.effects = effects;
    lab
}

fn words(effects: Vec<Active>) -> Vec<u16> {
    let instants = [instant(2, 0), instant(2, 1)];
    stage(effects).shots(&instants).into_iter().flat_map(|s| s.depth.raw).collect()
}

fn typical_but(id: &str) -> Vec<Active> {
    let others = CATALOGUE.iter().map(|e| e.card().id).filter(|other| *other != id);
    others.map(|id| Active::typical(id).unwrap()).collect()
}

fn with_strength(card: &Card, strength: f64) -> Active {
    Active::typical(card.id).unwrap().with(card.parameters[0].name, strength).unwrap()
}

#[test]
fn an_effect_at_its_identity_is_not_there_among_all_others() {
    for effect in CATALOGUE {
        let card = effect.card();
        let without = typical_but(card.id);
        let mut with = without.clone();
        with.insert(without.len() / 2, with_strength(card, card.identity));
        assert_eq!(words(without), words(with), "{}", card.id);
    }
}

/// The identity is the limit of the formula, not a special case: a ten-millionth of the range away from it,
/// few words change, and almost none by more than one.
#[test]
fn next_to_its_identity_an_effect_does_next_to_nothing() {
    let bare = words(Vec::new());
    for effect in CATALOGUE {
        let card = effect.card();
        let [low, high] = card.parameters[0].range;
        let step = 1e-7 * (high - low);
        let strength =
            if card.identity + step <= high { card.identity + step } else { card.identity - step };
        let next = words(vec![with_strength(card, strength)]);
        let apart: Vec<u16> = bare.iter().zip(&next).map(|(a, b)| a.abs_diff(*b)).collect();
        let changed = apart.iter().filter(|d| **d > 0).count();
        assert!(changed * 50 < apart.len(), "{}: {changed} of {} words", card.id, apart.len());
        let jumped = apart.iter().filter(|d| **d > 1).count();
        assert!(jumped < 3, "{}: {jumped} words jump", card.id);
    }
}

#[test]
fn the_typical_strength_does_something() {
    let bare = words(Vec::new());
    for effect in CATALOGUE {
        let id = effect.card().id;
        // In this scene nothing is far enough, steep enough, or moves enough.
        let active = match id {
            "range-dropout" => Active::parse("range-dropout:z50_m=1.2"),
            "grazing-dropout" => Active::parse("grazing-dropout:theta50_deg=35"),
            "target-motion" => Active::parse("target-motion:velocity_mps=0.5"),
            _ => Active::typical(id),
        };
        let same = words(vec![active.unwrap()]) == bare;
        // White paper does not show the intensity effect; the wall behind is grey.
        assert!(!same, "{id}");
    }
}

/// Adding an effect leaves the random numbers of the other kinds of noise unchanged.
#[test]
fn adding_an_effect_changes_no_other_stream() {
    let others = [
        "frozen-noise",
        "temporal-correlation",
        "spatial-correlation",
        "fixed-pattern-noise",
        "row-noise",
    ];
    let base =
        others.iter().fold(Laboratory::wall(1.5, 0.0, 0.0).noise(0.002), |lab, e| lab.with(e));
    let before = base.view(4, 3).remove(2);
    let errors = base.disparity_errors(&before);
    let after = |effect: &str| base.clone().with(effect).view(4, 3).remove(2);

    let jitter = difference(&base.disparity_errors(&after("frame-jitter")), &errors);
    assert!(sd(&jitter) < 0.001, "one shift for all: {}", sd(&jitter));

    for effect in
        ["grazing-dropout:share=0.3,theta50_deg=0,width_deg=0.1", "range-dropout:share=0.3,z50_m=1"]
    {
        let lost = after(effect);
        let kept = lost.iter().zip(&before).filter(|(z, _)| z.is_finite());
        assert!(kept.clone().count() > 1000);
        assert!(kept.clone().all(|(a, b)| a == b), "{effect}: what is left is untouched");
    }

    let louder = base.disparity_errors(&after("vignetting:growth=1"));
    let middle = 120 * 320 + 160;
    assert!((louder[middle] - errors[middle]).abs() < 0.002, "no growth in the middle");

    let scaled = after("depth-scale:scale=1.1");
    let off = scaled.iter().zip(&before).map(|(a, b)| (a / 1.1 - b).abs()).fold(0.0, f64::max);
    assert!(off < 1.5e-4, "{off}");
}

/// Effects act in the order of light, not in the order of naming.
#[test]
fn the_order_of_naming_does_not_matter() {
    let mut all = typical_but("range-dropout");
    let forth = words(all.clone());
    all.reverse();
    assert_eq!(forth, words(all));
}

fn files(root: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(root).unwrap().map(Result::unwrap) {
        if entry.path().is_dir() {
            found.extend(files(&entry.path()));
        } else {
            found.push((entry.path(), std::fs::read(entry.path()).unwrap()));
        }
    }
    found.sort();
    found
}

/// Files of a recording with these effects, written on this many threads.
fn recording(threads: usize, effects: &[Active], conditions: bool) -> Vec<(PathBuf, Vec<u8>)> {
    let folder = tempfile::tempdir().unwrap();
    let board = Target::Board(Board { width_m: 0.6, height_m: 0.5 });
    let scenery = Scenery { wall_gap_m: Some(1.0), conditions, ..Scenery::bare(board) };
    let poses = kinoise::simulate::Grid { distances_m: vec![1.0, 1.5], tilts_rad: vec![0.0, 0.6] };
    let domain = kinoise::model::Domain { z_m: [0.2, 10.0], theta_rad: [0.0, 1.3] };
    let sigma = kinoise::SigmaModel::published(kinoise::Form::Paper, &PAPER_EQ1, domain);
    let shoot = Shoot {
        sensor: kinect_v1(4),
        views: plan_grid(&poses.views(), &scenery, 2, true, Seed(3)),
        physics: Physics::Formula { sigma, effects: effects.to_vec() },
        infrared: true,
        seed: Seed(3),
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let root = folder.path().join("recording");
    pool.install(|| shoot.write(&root, &|_, _| ())).unwrap();
    let relative = |(path, bytes): (PathBuf, Vec<u8>)| {
        (path.strip_prefix(&root).unwrap().to_path_buf(), bytes)
    };
    files(&root).into_iter().map(relative).collect()
}

#[test]
fn one_thread_and_two_give_the_same_bytes() {
    let all = typical_but("");
    assert_eq!(recording(1, &all, true), recording(2, &all, true));
}

/// Everything but the images is the same with all effects and with none; the room's light differs from view
/// to view either way.
#[test]
fn no_file_tells_what_was_switched_on() {
    let described = |effects: &[Active]| {
        let all = recording(2, effects, true);
        let told = |(path, _): &(PathBuf, Vec<u8>)| path.extension().is_none_or(|e| e != "png");
        all.into_iter().filter(told).collect::<Vec<_>>()
    };
    let bare = described(&[]);
    assert_eq!(bare, described(&typical_but("")));
    let lux: Vec<&[u8]> =
        bare.iter().filter(|(p, _)| p.ends_with("view.json")).map(|(_, b)| &b[..]).collect();
    assert_eq!(lux.len(), 4);
    assert!(lux.iter().all(|text| String::from_utf8_lossy(text).contains("ambient_lux")));
    assert_ne!(lux[0], lux[1]);
}
