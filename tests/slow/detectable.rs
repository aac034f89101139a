//! The stated smallest detectable sizes of effects, checked by simulation.

use kinoise::diagnose::{DiagnoseOptions, Diagnosis, Verdict, diagnose};
use kinoise::effects::Active;
use kinoise::scene::Target;
use kinoise::simulate::{Grid, Physics, Shoot, kinect_v1};
use kinoise::{NoiseModel, Seed, SigmaModel, io};

fn seen(effect: Option<&str>, seed: u64) -> Diagnosis {
    let folder = tempfile::tempdir().expect("a folder");
    let distances_m = vec![0.8, 1.2, 1.8, 2.6, 3.6];
    let poses = Grid { distances_m, tilts_rad: vec![0.0, 0.3, 0.6] }.views();
    let sigma = SigmaModel::paper();
    let mut shoot = Shoot::plain(kinect_v1(4), Target::Wall, &poses, 2, sigma.clone(), Seed(seed));
    let effects = effect.into_iter().map(|e| Active::parse(e).expect("an effect")).collect();
    shoot.physics = Physics::Formula { sigma, effects };
    shoot.write(folder.path(), &|_, _| ()).expect("written");
    let recording = io::open(folder.path(), &io::Assumed::default()).expect("read");
    let options = DiagnoseOptions { seed: Seed(seed), ..DiagnoseOptions::default() };
    diagnose(&recording, &NoiseModel::paper(), &options, &|_, _| ()).expect("diagnosed").diagnosis
}

/// 40 recordings each of an effect at the minimum that a clean one states for a power of 80 %. At that rate
/// fewer than 24 detections occur once in 250 tests, and more than 38 once in 700. Bands are detected more
/// often than stated, 40 times in 40: for them the minimum is an upper bound.
#[test]
fn an_effect_at_its_stated_minimum_is_seen_four_times_in_five() {
    const SETS: u64 = 40;
    let clean = seen(None, 1);
    assert_eq!(clean.verdict, Verdict::Match);
    for (effect, name, others, most) in [
        ("radial-disparity-bias", "k_px", "", 38),
        ("column-banding", "amplitude_px", ",period_px=20", SETS as usize),
        ("vignetting", "growth", "", 38),
    ] {
        let stated = clean.detectable.iter().find(|d| d.effect == effect).expect("stated");
        let least = stated.minimum[name].as_f64().expect("a number");
        let spec = format!("{effect}:{name}={least}{others}");
        let found =
            (0..SETS).filter(|s| seen(Some(&spec), 100 + s).verdict == Verdict::Mismatch).count();
        println!("{spec}: seen in {found} of {SETS}");
        assert!((24..=most).contains(&found), "{spec}: seen in {found} of {SETS}");
    }
}
