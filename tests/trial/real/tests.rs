//! Tests on a simulated recording in place of a real one, so that its causes are known.

use std::path::Path;
use std::sync::OnceLock;

use super::*;
use crate::raytraced::question::World;
use crate::raytraced::tests::files;
use kinoise::effects::Active;
use kinoise::model::SigmaModel;
use kinoise::scene::Target;
use kinoise::simulate::{Grid, Physics, Shoot, kinect_v1};

/// A data folder with one recording that has a bowl and noise that grows towards the rim.
fn data() -> &'static Path {
    static DATA: OnceLock<tempfile::TempDir> = OnceLock::new();
    DATA.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let grid = Grid {
            distances_m: vec![0.9, 1.4, 2.0],
            tilts_rad: [0f64, 20.0, 40.0, 55.0].map(f64::to_radians).to_vec(),
        };
        let (sigma, sensor) = (SigmaModel::paper(), kinect_v1(2));
        let views = grid.views();
        let mut shoot = Shoot::plain(sensor, Target::Wall, &views, 2, sigma.clone(), Seed(3));
        let effects = ["radial-disparity-bias:k_px=0.4", "vignetting:growth=1.0"]
            .map(|text| Active::parse(text).unwrap())
            .to_vec();
        shoot.physics = Physics::Formula { sigma, effects };
        shoot.write(&folder.path().join("unit/recording"), &|_, _| ()).unwrap();
        folder
    })
    .path()
}

fn known() -> &'static [Arc<Full>] {
    static KNOWN: OnceLock<Vec<Arc<Full>>> = OnceLock::new();
    KNOWN.get_or_init(|| learn(data()).unwrap())
}

fn of(cell: Cell, name: &str, seed: u64) -> Result<Box<dyn ConcealedSet>> {
    let names = if name.is_empty() { Vec::new() } else { vec![name.into()] };
    conceal(&Asked { world: World::Real, cell, names, nats: None, seed, small: false }, known())
}

#[test]
fn a_recording_is_found_wherever_it_lies() {
    let inner = data().join("unit/recording");
    for folder in [data().to_path_buf(), data().join("unit"), inner.clone()] {
        assert_eq!(recordings(&folder), [inner.clone()], "{}", folder.display());
    }
    assert!(learn(Path::new("/nowhere")).is_err());
}

/// Both causes are there (the bowl is worth thousands of nats), and each is struck alone.
#[test]
fn amnesia_strikes_one_term_and_touches_no_word() {
    let full = &known()[0];
    for (name, statistic) in [("radial-disparity-bias", "bias"), ("vignetting", "variance")] {
        let set = of(Cell::Amnesia, name, 5).unwrap();
        let Truth { hidden, base, .. } = set.truth();
        assert_eq!((hidden[0].names[0].as_str(), hidden[0].statistic.as_str()), (name, statistic));
        assert!(hidden[0].nats.unwrap() > 50.0, "{:?}", hidden[0].nats);
        let left = full.model.effects.iter().map(|e| &e.id).filter(|id| *id != name);
        assert_eq!(base["known"], json!(left.collect::<Vec<_>>()));
        let (views, files) = (base["views"].as_array().unwrap(), files(&*set));
        assert!(views.len() < full.recording.views.len());
        for (n, view) in views.iter().enumerate() {
            let real = full.recording.views.iter().find(|v| v.name == *view).unwrap();
            let frame = fs::read(&real.depth[1].path).unwrap();
            assert_eq!(files[&format!("recording/{n:04}/depth/0001.png")], frame);
        }
    }
    assert!(of(Cell::Amnesia, "row-noise", 5).is_err());
}

#[test]
fn a_half_goes_with_the_model_of_the_other_and_the_same_seed_gives_the_same_bytes() {
    let half = of(Cell::Halves, "", 4).unwrap();
    assert!(half.truth().hidden.is_empty());
    assert_eq!(half.truth().base["views"].as_array().unwrap().len(), 6);
    let model = &files(&*half)["model.json"];
    let model: serde_json::Value = serde_json::from_slice(model).unwrap();
    assert_eq!(model["fit"]["views"], 6);
    let bytes = |seed| files(&*of(Cell::Amnesia, "vignetting", seed).unwrap());
    assert_eq!(bytes(1), bytes(1));
    assert_ne!(bytes(1), bytes(2));
}
