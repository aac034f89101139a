//! Oracles: a recording that was simulated stands for a real one, its causes known.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use super::amnesia::strike;
use super::full::{Full, full};
use super::{halves, recordings, seal, some};
use crate::{Asked, Cell, World};
use kinoise::effects::Active;
use kinoise::error::Error;
use kinoise::io::{Assumed, FrameSource, open};
use kinoise::model::{Effect, NoiseModel, SigmaModel};
use kinoise::rng::Seed;
use kinoise::scene::Target;
use kinoise::simulate::{Grid, Physics, Shoot, kinect_v1};

/// A folder of data in which one recording has a bowl and noise that grows to the rim.
fn data() -> &'static Path {
    static DATA: OnceLock<tempfile::TempDir> = OnceLock::new();
    DATA.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let grid = Grid {
            distances_m: vec![0.9, 1.4, 2.0],
            tilts_rad: [0f64, 20.0, 40.0, 55.0].map(f64::to_radians).to_vec(),
        };
        let sigma = SigmaModel::paper();
        let mut shoot =
            Shoot::plain(kinect_v1(2), Target::Wall, &grid.views(), 2, sigma.clone(), Seed(3));
        let effects = ["radial-disparity-bias:k_px=0.4", "vignetting:growth=1.0"]
            .map(|text| Active::parse(text).unwrap())
            .to_vec();
        shoot.physics = Physics::Formula { sigma, effects };
        shoot.write(&folder.path().join("unit/recording"), &|_, _| ()).unwrap();
        folder
    })
    .path()
}

fn asked(cell: Cell, name: &str, seed: u64) -> Asked {
    let names = if name.is_empty() { Vec::new() } else { vec![name.into()] };
    Asked { world: World::Real, cell, names, nats: None, seed, small: false }
}

/// Every file below a folder with its bytes, in name order.
fn files(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(here) = folders.pop() {
        for entry in fs::read_dir(here).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).unwrap().to_path_buf();
                found.push((name, fs::read(path).unwrap()));
            }
        }
    }
    found.sort();
    found
}

pub(super) fn known() -> std::sync::Arc<Full> {
    full(&recordings(data())[0]).unwrap()
}

#[test]
fn where_nothing_real_is_one_is_told() {
    let empty = tempfile::tempdir().unwrap();
    assert!(recordings(empty.path()).is_empty());
    assert!(recordings(Path::new("/nowhere")).is_empty());
    for cell in [Cell::Amnesia, Cell::Transplant, Cell::Halves] {
        let error = seal(&asked(cell, "", 1), empty.path()).err().unwrap();
        assert!(matches!(error, Error::Argument { .. }), "{error}");
    }
    let error = seal(&asked(Cell::Pair, "", 1), data()).err().unwrap();
    assert!(error.to_string().contains("pair"), "{error}");
}

#[test]
fn a_recording_is_found_wherever_it_lies() {
    let inner = data().join("unit/recording");
    for folder in [data().to_path_buf(), data().join("unit"), inner.clone()] {
        let found = recordings(&folder);
        assert_eq!(found.len(), 1, "{}", folder.display());
        assert_eq!(found[0].path, inner);
    }
}

/// Both causes are there (the bowl is worth thousands of nats), and each is struck alone.
#[test]
fn amnesia_strikes_one_term_and_touches_no_word() {
    let full = known();
    let all: Vec<usize> = (0..full.recording.views.len()).collect();
    for (name, statistic) in [("radial-disparity-bias", "bias"), ("vignetting", "variance")] {
        let asked = asked(Cell::Amnesia, name, 5);
        let mut rng = Seed(1).stream("x");
        let (model, hidden) = strike(&full, &asked, 1.0, &mut rng).unwrap();
        assert_eq!((hidden.names[0].as_str(), hidden.statistic.as_str()), (name, statistic));
        assert!(hidden.nats.unwrap() > 50.0, "{:?}", hidden.nats);
        assert!(model.effects.iter().all(|e| e.id != name));
        let left: Vec<&Effect> = full.model.effects.iter().filter(|e| e.id != name).collect();
        assert_eq!(model.effects.iter().collect::<Vec<_>>(), left);
        assert_eq!(full.measured(&all), full.measured(&all[1..]) + full.measured(&all[..1]));

        let out = tempfile::tempdir().unwrap();
        let set = seal(&asked, data()).unwrap();
        set.write(out.path()).unwrap();
        let written = NoiseModel::read(&out.path().join("model.json")).unwrap();
        assert_eq!(written.effects, model.effects);
        let recording = open(&out.path().join("recording"), &Assumed::default()).unwrap();
        let names = set.truth().base["views"].clone();
        assert_eq!(recording.views.len(), names.as_array().unwrap().len());
        assert!(recording.views.len() < all.len());
        for (view, name) in recording.views.iter().zip(names.as_array().unwrap()) {
            let real = full.recording.views.iter().find(|v| v.name == *name).unwrap();
            assert_eq!((view.depth.len(), &view.notes.region), (2, &real.notes.region));
            let mut source = FrameSource::new(320, 240);
            for (mine, theirs) in view.depth.iter().zip(&real.depth) {
                assert_eq!(source.read(&mine.path).unwrap(), source.read(&theirs.path).unwrap());
            }
        }
    }
    let error = strike(&full, &asked(Cell::Amnesia, "row-noise", 5), 1.0, &mut Seed(1).stream("x"));
    assert!(error.unwrap_err().to_string().contains("vignetting"), "told what there is");
}

#[test]
fn halves_are_disjoint_and_cover_all() {
    let mut seen = std::collections::HashSet::new();
    for seed in 0..20 {
        let [a, b] = halves(13, &mut Seed(seed).stream("halves"));
        assert_eq!((a.len(), b.len()), (6, 7));
        let mut both = [a.clone(), b].concat();
        both.sort_unstable();
        assert_eq!(both, (0..13).collect::<Vec<_>>());
        seen.insert(a);
        let taken = some(13, &mut Seed(seed).stream("some"));
        assert!((8..=12).contains(&taken.len()) && taken.is_sorted());
    }
    assert!(seen.len() > 15, "dealt anew each time");
}

#[test]
fn a_half_goes_with_the_model_of_the_other() {
    let set = seal(&asked(Cell::Halves, "", 4), data()).unwrap();
    let truth = set.truth();
    assert!(truth.hidden.is_empty());
    assert_eq!(truth.base["views"].as_array().unwrap().len(), 6);
    let out = tempfile::tempdir().unwrap();
    set.write(out.path()).unwrap();
    let model = NoiseModel::read(&out.path().join("model.json")).unwrap();
    assert_eq!(model.fit.views, 6);
}

/// Not even the hour of the day shows.
#[test]
fn the_same_seed_gives_the_same_bytes_and_another_seed_others() {
    let bytes = |seed, cell| {
        let out = tempfile::tempdir().unwrap();
        seal(&asked(cell, "", seed), data()).unwrap().write(out.path()).unwrap();
        files(out.path())
    };
    for cell in [Cell::Amnesia, Cell::Transplant] {
        let first = bytes(1, cell);
        assert_eq!(first, bytes(1, cell));
        assert_ne!(first, bytes(2, cell));
        let tops: Vec<&str> = first.iter().filter_map(|(p, _)| p.iter().next()?.to_str()).collect();
        assert!(tops.iter().all(|top| ["recording", "model.json"].contains(top)));
    }
}
