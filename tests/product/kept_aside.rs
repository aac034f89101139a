//! Gain of noise textures and tails on held-out views.

use kinoise::diagnose::{DiagnoseOptions, Diagnosis, HeldOut, Status, Verdict, diagnose};
use kinoise::effects::Active;
use kinoise::io::{Assumed, open};
use kinoise::scene::Target;
use kinoise::simulate::{Grid, Physics, Shoot, kinect_v1};
use kinoise::{NoiseModel, Seed, SigmaModel};

/// Diagnosis of a wall in fifteen views of eight frames with this effect, against the plain model.
fn diagnosis(effect: &str) -> Diagnosis {
    let folder = tempfile::tempdir().expect("a folder");
    let poses =
        Grid { distances_m: vec![1.0, 1.5, 2.0, 2.5, 3.0], tilts_rad: vec![0.0, 0.4, 0.8] }.views();
    let sigma = SigmaModel::paper();
    let mut shoot = Shoot::plain(kinect_v1(4), Target::Wall, &poses, 8, sigma.clone(), Seed(3));
    let effects = vec![Active::parse(effect).expect("an effect")];
    shoot.physics = Physics::Formula { sigma, effects };
    shoot.write(folder.path(), &|_, _| ()).expect("written");
    let recording = open(folder.path(), &Assumed::default()).expect("a recording");
    let options = DiagnoseOptions::default();
    diagnose(&recording, &NoiseModel::paper(), &options, &|_, _| ()).expect("diagnosed").diagnosis
}

fn first_and_held(said: &Diagnosis) -> (Option<&'static str>, &HeldOut) {
    assert_eq!(said.verdict, Verdict::Mismatch);
    (said.findings[0].effect, said.heldout.as_ref().expect("views kept aside"))
}

#[test]
fn textures_and_tails_gain_on_views_kept_aside() {
    for effect in [
        "spatial-correlation:length_px=3",
        "temporal-correlation:rho=0.5",
        "heavy-tails:fraction=0.02,scale=8",
    ] {
        let said = diagnosis(effect);
        let (first, held) = first_and_held(&said);
        assert_eq!(first, effect.split(':').next());
        assert!(held.is_clear, "{effect}: {:?}", held.gain_interval);
        // These effects change no mean, so nothing is corrected.
        assert_eq!(held.bias_gain_interval, [0.0; 2], "{effect}");
        assert_eq!(held.rms_mm_before, held.rms_mm_after, "{effect}");
    }
}

/// Quantisation steps and dropouts have no score; this must not be reported as no gain.
#[test]
fn what_has_no_score_is_not_told_as_no_gain() {
    for effect in ["disparity-quantisation:step_px=0.125", "range-dropout:z50_m=2,width_m=0.4"] {
        let said = diagnosis(effect);
        let (first, held) = first_and_held(&said);
        assert_eq!(first, effect.split(':').next());
        // Other findings may occur by chance; one of the size of the noise has a score.
        let told = || said.findings.iter().filter(|f| f.status != Status::NotIdentifiable);
        let all: Vec<_> = told().map(|f| (f.effect, f.statistic, f.axis)).collect();
        assert!(!said.findings[0].is_scored(), "{all:?}");
        assert_eq!(held.is_nothing(), !told().any(|f| f.is_scored()), "{all:?}: {held:?}");
    }
}
