//! Columns or rows with a constant error each: reported as such, and learnt. And rows with fresh errors.

use kinoise::diagnose::{DiagnoseOptions, Diagnosed, Status, Verdict, diagnose};
use kinoise::effects::Active;
use kinoise::io::{Assumed, open};
use kinoise::model::{Effect, UNEXPLAINED};
use kinoise::scene::Target;
use kinoise::simulate::{Grid, Physics, Shoot, kinect_v1};
use kinoise::terms::{Axis, Basis, Coordinate, Modulation, Statistic, Term};
use kinoise::{NoiseModel, Recording, Seed, SigmaModel};
use tempfile::TempDir;

/// A quarter of a Kinect's resolution in each direction.
const BINNING: usize = 4;
const SIZE: [usize; 2] = [160, 120];

/// A wall in twelve views of six frames.
fn wall(effects: Vec<Active>) -> (TempDir, Recording) {
    let folder = tempfile::tempdir().expect("a folder");
    let tilts_rad = vec![0.0, 0.3, 0.6];
    let poses = Grid { distances_m: vec![1.0, 1.5, 2.0, 2.5], tilts_rad }.views();
    let sigma = SigmaModel::paper();
    let (sensor, target) = (kinect_v1(BINNING), Target::Wall);
    let mut shoot = Shoot::plain(sensor, target, &poses, 6, sigma.clone(), Seed(11));
    shoot.physics = Physics::Formula { sigma, effects };
    shoot.write(folder.path(), &|_, _| ()).expect("written");
    let recording = open(folder.path(), &Assumed::default()).expect("a recording");
    (folder, recording)
}

/// Diagnosis with this error at each column (row), px, against the plain model.
fn diagnosis(over: Coordinate, error_px: impl Fn(usize) -> f64) -> Diagnosed {
    let nodes = if over == Coordinate::Row { SIZE[1] } else { SIZE[0] };
    let high = nodes as f64 - 1.0;
    let basis = Basis::Curve { over, low: 0.0, high, nodes, times: Modulation::One };
    let shape = vec![Term::bias(basis, (0..nodes).map(error_px).collect())];
    let effect = Effect { id: UNEXPLAINED.into(), shape, ..Effect::default() };
    let (_folder, recording) = wall(Active::all_of_model(&[effect]).expect("effects"));
    let options = DiagnoseOptions::default();
    diagnose(&recording, &NoiseModel::paper(), &options, &|_, _| ()).expect("diagnosed")
}

/// Two read-outs, one for even lines and one for odd: smooth curves cannot see them, but they are found even
/// at a few ten-thousandths of the noise's variance. At thirty times that height nothing is left either, and
/// no tails are found; held-out views are predicted better by about what lines of that height are worth.
#[test]
fn lines_of_two_readouts_are_seen_and_learnt() {
    let columns = (Coordinate::Column, Axis::Column);
    let rows = (Coordinate::Row, Axis::Row);
    for ((over, axis), height_px) in [(columns, 3e-4), (columns, 1e-2), (rows, 3e-4), (rows, 1e-2)]
    {
        let error_px = |line: usize| if line.is_multiple_of(2) { height_px } else { -height_px };
        let said = diagnosis(over, error_px).diagnosis;
        let found: Vec<_> =
            said.findings.iter().filter(|f| f.status != Status::NotIdentifiable).collect();
        let told: Vec<_> = found.iter().map(|f| (f.effect, f.statistic, f.axis)).collect();
        assert_eq!(told, [(None, Statistic::Bias, axis)]);
        let sigma_px = found[0].value("sigma_px").expect("a size");
        assert!((sigma_px / height_px - 1.0).abs() < 0.25, "{sigma_px}");
        let held = said.heldout.as_ref().expect("views kept aside");
        assert!(held.is_clear, "{:?}", held.gain_interval);
        let less_px2 = held.correction_rms_before_px.powi(2) - held.correction_rms_after_px.powi(2);
        // The noise, .02 px, of all held-out readings hides the gain of low ones.
        if height_px > 1e-3 {
            let noise_px = 0.02 / f64::sqrt((3 * 6 * SIZE[0] * SIZE[1]) as f64);
            let tolerance = 5.0 * 2.0 * height_px * noise_px + 2.5e-4f64.powi(2);
            assert!((less_px2 - height_px.powi(2)).abs() < tolerance, "{less_px2} of {height_px}");
        }
        assert_eq!(said.after.verdict, Verdict::Match, "{:?}", said.after.remaining);
        let [profile] = &found[0].terms[..] else { panic!("one profile") };
        let known = || profile.coefficients.iter().enumerate().filter(|(_, c)| **c != 0.0);
        let (n, along) = (known().count(), known().map(|(k, c)| c / error_px(k)).sum::<f64>());
        let height = along / n as f64;
        assert!(n > SIZE[1] / 2 && (height - 1.0).abs() < 0.25, "{height} of {n} {axis:?}");
    }
}

/// In half of the views and in three quarters: the noise is named, and it is no bias, even where a tilted
/// target's disparity changes with the row.
#[test]
fn rows_that_err_afresh_in_a_part_of_the_views_are_row_noise_and_no_bias() {
    let effect = Active::parse("row-noise:sigma_px=0.03").expect("an effect");
    let (_noisy, noisy) = wall(vec![effect]);
    let (_plain, plain) = wall(Vec::new());
    // In three quarters of the views the mean over all views is reported: .75 of the variance.
    for (some, told_px) in [(6, 0.03), (9, 0.026)] {
        let views = noisy.views[..some].iter().chain(&plain.views[some..]).cloned().collect();
        let recording = Recording { views, ..plain.clone() };
        let (model, options) = (NoiseModel::paper(), DiagnoseOptions::default());
        let said = diagnose(&recording, &model, &options, &|_, _| ()).expect("diagnosed").diagnosis;
        let rows = said.findings.iter().find(|f| f.effect == Some("row-noise")).expect("its name");
        assert_eq!(rows.status, Status::Named);
        let sigma_px = rows.value("sigma_px").expect("a size");
        assert!((sigma_px / told_px - 1.0).abs() < 0.1, "{sigma_px} in {some} views");
        let bias = said.findings.iter().filter(|f| f.status != Status::NotIdentifiable);
        let bias: Vec<_> = bias.filter(|f| f.statistic == Statistic::Bias).collect();
        assert!(bias.is_empty(), "{some}: {bias:?}");
    }
}
