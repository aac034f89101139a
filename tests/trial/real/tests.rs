//! Oracles: a recording that was simulated stands for a real one, its causes known.

use std::path::Path;
use std::sync::OnceLock;

use super::*;
use crate::raytraced::kernels::{Window, fresh};
use crate::raytraced::question::World;
use crate::raytraced::tests::files;
use kinoise::effects::Active;
use kinoise::frame::Frame;
use kinoise::model::SigmaModel;
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

fn asked(cell: Cell, name: &str, seed: u64) -> Asked {
    let names = if name.is_empty() { Vec::new() } else { vec![name.into()] };
    Asked { world: World::Real, cell, names, nats: None, seed, small: false }
}

fn known() -> Arc<Full> {
    full(&recordings(data())[0]).unwrap()
}

#[test]
fn a_recording_is_found_wherever_it_lies() {
    let inner = data().join("unit/recording");
    for folder in [data().to_path_buf(), data().join("unit"), inner.clone()] {
        assert_eq!(recordings(&folder), [inner.clone()], "{}", folder.display());
    }
    assert!(conceal(&asked(Cell::Amnesia, "", 1), Path::new("/nowhere")).is_err());
    assert!(conceal(&asked(Cell::Pair, "", 1), data()).is_err());
}

/// Both causes are there (the bowl is worth thousands of nats), and each is struck alone.
#[test]
fn amnesia_strikes_one_term_and_touches_no_word() {
    let full = known();
    for (name, statistic) in [("radial-disparity-bias", "bias"), ("vignetting", "variance")] {
        let set = conceal(&asked(Cell::Amnesia, name, 5), data()).unwrap();
        let Truth { hidden, base, .. } = set.truth();
        assert_eq!((hidden[0].names[0].as_str(), hidden[0].statistic.as_str()), (name, statistic));
        assert!(hidden[0].nats.unwrap() > 50.0, "{:?}", hidden[0].nats);
        let left = full.model.effects.iter().map(|e| &e.id).filter(|id| *id != name);
        assert_eq!(base["known"], json!(left.collect::<Vec<_>>()));
        let (views, files) = (base["views"].as_array().unwrap(), files(&*set));
        assert!(views.len() < full.recording.views.len());
        for (n, view) in views.iter().enumerate() {
            let real = full.recording.views.iter().find(|v| v.name == *view).unwrap();
            let mut source = FrameSource::new(320, 240);
            let frame = encode_png16_quickly(&source.read(&real.depth[1].path).unwrap()).unwrap();
            assert_eq!(files[&format!("recording/{n:04}/depth/0001.png")], frame);
        }
    }
    assert!(conceal(&asked(Cell::Amnesia, "row-noise", 5), data()).is_err());
}

#[test]
fn a_half_goes_with_the_model_of_the_other_and_the_same_seed_gives_the_same_bytes() {
    let half = conceal(&asked(Cell::Halves, "", 4), data()).unwrap();
    assert!(half.truth().hidden.is_empty());
    assert_eq!(half.truth().base["views"].as_array().unwrap().len(), 6);
    let model = &files(&*half)["model.json"];
    let model: serde_json::Value = serde_json::from_slice(model).unwrap();
    assert_eq!(model["fit"]["views"], 6);
    let bytes = |seed| files(&*conceal(&asked(Cell::Transplant, "", seed), data()).unwrap());
    assert_eq!(bytes(1), bytes(1));
    assert_ne!(bytes(1), bytes(2));
}

/// Noise that hangs together, as stored words with and without an error of 0.37 of a step: what is
/// added afterwards is told from what was there before the rounding by nothing. The mean of 10 fields
/// has a standard error of 0.002 steps; drawn blindly the variance would be 0.17 too large.
#[test]
fn an_error_added_to_words_is_as_if_it_had_come_before_them() {
    let (width, height) = (320, 240);
    let mut sums = [[0.0; 3]; 2];
    for view in 0..10 {
        let clock = Clock { seed: Seed(8), view, frame: 0, view_s: 0.0, width };
        let mut noise = fresh(&clock, width * height);
        Window::bell(6.0).blur(&mut noise, width);
        // A plane that leans, in steps.
        let exact = |i: usize| 600.0 + 0.31 * (i % width) as f32 + 0.17 * (i / width) as f32;
        let stored = |shift: f32| -> Vec<u16> {
            (0..noise.len()).map(|i| (exact(i) + 0.45 * noise[i] + shift).round() as u16).collect()
        };
        let off = |words: &[u16]| -> Vec<f32> {
            (0..words.len()).map(|i| f32::from(words[i]) - exact(i)).collect()
        };
        let frame = Frame { width, height, raw: stored(0.0) };
        let valid = vec![true; noise.len()];
        let places = dither::places(&frame, &valid, &off(&frame.raw), &mut clock.stream("x"));
        let values = frame.raw.iter().zip(&places).map(|(w, place)| f32::from(*w) + place);
        let added: Vec<u16> = values.map(|value| (value + 0.37).round() as u16).collect();
        for (sum, words) in sums.iter_mut().zip([added, stored(0.37)]) {
            let field = off(&words);
            let n = field.len() as f32;
            let mean = field.iter().sum::<f32>() / n;
            let variance = field.iter().map(|x| (x - mean).powi(2)).sum::<f32>() / n;
            let pairs = (0..field.len() - 1).filter(|i| (i + 1) % width > 0);
            let lagged = pairs.map(|i| (field[i] - mean) * (field[i + 1] - mean)).sum::<f32>() / n;
            let found = [mean, variance, lagged / variance];
            sum.iter_mut().zip(found).for_each(|(s, x)| *s += x / 10.0);
        }
    }
    let [added, before] = sums;
    assert!((added[0] - 0.37).abs() < 0.01, "{added:?}");
    assert!((added[1] / before[1] - 1.0).abs() < 0.06, "{added:?} {before:?}");
    assert!((added[2] - before[2]).abs() < 0.05, "{added:?} {before:?}");
}

/// Twice the standard deviation is four times the variance; a tenth of the pixels is lost.
#[test]
fn more_noise_and_fewer_answers() {
    use crate::raytraced::{loss, spread};
    let full = known();
    let plan = full.plan(0);
    let eye = Eye::new(full.world(), &plan);
    let code = full.recording.sensor.code;
    let fb = eye.world.unit.disparity_px_m();
    let frame = FrameSource::new(320, 240).read(&full.recording.views[0].depth[0].path).unwrap();
    let causes =
        [spread("twice", "", "", &[], |_, _| 2.0), loss("a tenth", "", "", &[], |_, _| 0.1)];
    let clock = Clock { seed: Seed(3), view: 0, frame: 0, view_s: 0.0, width: 320 };
    let words = added::add(&causes, &full, &eye, &frame, &clock).raw;
    let (mut n, mut kept, mut squares) = (0.0, 0.0, 0.0);
    for (&i, sigma) in full.seen[0].pixels.iter().zip(&full.seen[0].sigma_px) {
        let disparity = |word: u16| code.metres(word).map(|z| fb / z);
        let Some(before) = disparity(frame.raw[i as usize]) else { continue };
        n += 1.0;
        if let Some(after) = disparity(words[i as usize]) {
            kept += 1.0;
            squares += ((after - before) / f64::from(*sigma)).powi(2);
        }
    }
    assert!((kept / n - 0.9f64).abs() < 0.005, "{kept} of {n}");
    // Three sigma squared come on top, and what two roundings leave.
    assert!((2.9..3.8).contains(&(squares / kept)), "{}", squares / kept);
}
