//! The speckle simulation of a Kinect against physics.md; these tests know nothing of how the errors arise.
//!
//! Errors are disparities in px: measured minus true fx b / z. An image of 240 x 180 px with a Kinect's own
//! pixels keeps the numbers of physics.md and takes only seconds per test.
//! All seeds are fixed; the false-alarm probabilities say how often another seed would fail a test.

use kinoise::effects::Instant;
use kinoise::scene::{Bench, Board, Target};
use kinoise::simulate::speckle::{Causes, SpeckleSensor};
use kinoise::simulate::{Physics, Scenery, Shoot, kinect_v1, plan_grid};
use kinoise::{CalibrateOptions, Form, Seed};

use crate::common;
use crate::common::speckle::{FB, Watch, frontal, kinect, wall, watch};

fn causes(text: &[&str]) -> Causes {
    text.iter().fold(Causes::default(), |c, t| c.parse(t).expect("a cause"))
}

/// physics.md, 0: steps of 2.87 mm z^2. Deterministic as soon as a hundred depths occur.
#[test]
fn depths_come_in_steps_of_2_87_mm_z_squared() {
    for (step, expected) in [("step_px=0.125", 2.874e-3), ("step_px=0.25", 5.747e-3)] {
        let mut depths: Vec<f64> = Vec::new();
        for z in [1.0, 2.0, 3.5] {
            let watched = watch(&causes(&[step]), &wall(z, 40.0, 0.0), 1, 1);
            depths.extend(watched.depths.iter().filter(|z| z.is_finite()));
        }
        depths.sort_by(f64::total_cmp);
        depths.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
        let mut steps: Vec<f64> =
            depths.windows(2).map(|w| (w[1] - w[0]) / (w[0] * w[1])).collect();
        steps.sort_by(f64::total_cmp);
        assert!(steps.len() > 100, "{} depths", depths.len());
        assert!((steps[0] / expected - 1.0).abs() < 1e-3, "{} {expected}", steps[0]);
        assert!((steps[steps.len() / 2] / expected - 1.0).abs() < 1e-3, "no other step is common");
    }
}

/// physics.md, 4: correlations of about .75, .4 and 0 at lags 1, 4 and 9 of a 9 x 9 window; .91 at 1 along a
/// column; rounding to 1/8 px is white and takes a tenth of all. 43,000 px are 530 windows: the standard
/// error of a correlation is below 0.045, the margins are four of them; false alarm probability below 1e-3
/// in all.
#[test]
fn errors_hang_together_over_the_matching_window() {
    let nine = watch(&Causes::default(), &frontal(1.3), 1, 3);
    let along = |w: &Watch, lag| w.autocorrelation(lag, 0);
    let figures: Vec<f64> = [1, 4, 9, 13].map(|lag| along(&nine, lag)).into();
    println!(
        "9 px: u {figures:?}, v1 {:.2}, v9 {:.2}",
        nine.autocorrelation(0, 1),
        nine.autocorrelation(0, 9)
    );
    assert!((0.5..0.95).contains(&figures[0]) && (0.2..0.65).contains(&figures[1]), "{figures:?}");
    assert!(figures[2].abs() < 0.18 && figures[3].abs() < 0.18, "{figures:?}");
    assert!(nine.autocorrelation(0, 1) > 0.7 && nine.autocorrelation(0, 9).abs() < 0.2);
    let wide = watch(&causes(&["window_px=17"]), &frontal(1.3), 1, 3);
    println!(
        "17 px: u4 {:.2}, u9 {:.2}, u17 {:.2}",
        along(&wide, 4),
        along(&wide, 9),
        along(&wide, 17)
    );
    assert!(along(&wide, 9) > 0.2, "a wider window reaches farther: {}", along(&wide, 9));
}

/// physics.md, 5: temporal / static noise is .2 to .45 with ample light; the frozen pattern repeats in every
/// frame but not in another view. The standard deviation over 530 windows is known to 3 %; the margins are
/// more than ten of that.
#[test]
fn most_of_the_noise_stands_still_while_the_scene_does() {
    for z in [0.9, 1.3] {
        let watched = watch(&Causes::default(), &frontal(z), 8, 4);
        let ratio = watched.temporal_px() / watched.frozen_px();
        println!(
            "{z} m: frozen {:.3}, temporal {:.3} px",
            watched.frozen_px(),
            watched.temporal_px()
        );
        assert!((0.15..0.5).contains(&ratio), "{z} m: {ratio}");
        assert!((0.05..0.15).contains(&watched.frozen_px()), "sigma_d {}", watched.frozen_px());
    }
    let [a, b] = [4, 5].map(|seed| watch(&Causes::default(), &frontal(1.3), 2, seed));
    let (same, other) = (a.frame_likeness(&a, 0, 1), a.frame_likeness(&b, 0, 0));
    println!("likeness of frames {same:.2}, of views {other:.2}");
    assert!(same > 0.8 && other < same - 0.2, "frames {same}, views {other}");
    let still = watch(&causes(&["speckle=0"]), &frontal(1.3), 4, 4);
    let shaken = watch(&Causes::default(), &frontal(1.3), 4, 4);
    assert!(still.frozen_px() < 0.9 * shaken.frozen_px(), "speckle is a cause of it");
}

/// physics.md, 4.4: flat up to 70 degrees at 1 m (g = 0.2), then x 2.5 and dropout at g = 0.35.
/// The projector's light compensates for the cosine, so that only the tilt acts. A temporal sigma from 8
/// frames and 400 windows is known to 2 %.
#[test]
fn temporal_noise_is_flat_and_then_explodes_with_dropout() {
    let tilted = |degrees: f64| {
        let light = format!("light={}", 2.0 / degrees.to_radians().cos());
        watch(&causes(&[&light]), &wall(1.0, degrees, 90.0), 8, 5)
    };
    let shots: Vec<(f64, Watch)> = [0.0, 50.0, 65.0, 78.0].map(|t| (t, tilted(t))).into();
    for (t, w) in &shots {
        println!(
            "{t}: temporal {:.4}, frozen {:.3} px, missing {:.3}",
            w.temporal_px(),
            w.frozen_px(),
            w.missing()
        );
    }
    let temporal: Vec<f64> = shots.iter().map(|(_, w)| w.temporal_px()).collect();
    assert!(temporal[1] < 1.4 * temporal[0] && temporal[2] < 1.8 * temporal[0], "{temporal:?}");
    assert!(temporal[3] > 2.0 * temporal[0], "{temporal:?}");
    assert!(shots[2].1.missing() < 0.01 && shots[3].1.missing() > 0.02);
    let dim = watch(&causes(&["light=1"]), &wall(1.0, 78.0, 90.0), 2, 5);
    println!("dim {:.3}", dim.missing());
    assert!(dim.missing() > 0.1, "at its own light it loses more: {}", dim.missing());
}

/// physics.md, 8: sigma_d^2 = sigma_0^2 + (~1.0 px g)^2 with g = b tan(theta) / z. A sigma is known to 3 %,
/// a difference of squares to 10 %.
#[test]
fn static_noise_grows_with_tan_theta_over_z() {
    let flat = |z| watch(&Causes::default(), &frontal(z), 2, 6).frozen_px();
    let mut factors = Vec::new();
    for (z, degrees) in [(0.8, 60.0), (1.0, 60.0), (1.0, 70.0), (1.5, 70.0), (1.5, 76.0)] {
        let watched = watch(&Causes::default(), &wall(z, degrees, 90.0), 2, 6);
        let g = 0.075 * f64::to_radians(degrees).tan() / z;
        let excess = (watched.frozen_px().powi(2) - flat(z).powi(2)).sqrt();
        println!("{z} m, {degrees} deg, g {g:.3}: excess {excess:.3} px, {:.2} g", excess / g);
        factors.push(excess / g);
    }
    let (low, high) = factors.iter().fold((f64::MAX, 0f64), |(l, h), &f| (l.min(f), h.max(f)));
    assert!(low > 0.7 && high < 1.6, "about one pixel times g: {factors:?}");
    assert!(high / low < 1.5, "g alone says it: {factors:?}");
}

/// physics.md, 38: fx b (1/z1 - 1/z2), 21.8 px in front of a wall at 2 m and 32.6 px at 4 m, on the left
/// only (the projector is on the right). Eight boards put the edges on different dots; their scatter gives
/// the error of a mean.
///
/// The infrared image shows the band itself, less the tails of the dots at both edges: a column counts as lit
/// at a tenth of the wall's light, which a dot of standard deviation s produces 1.28 s from the wall's edge,
/// and (the board being 4 or 16 times brighter) 1.96 s or 2.5 s from the board's. Dots of FWHM 1 to 2 px
/// (s = 0.43 to 0.85 px) take 1.4 to 3.2 px.
///
/// In depth, windows across the edges find matches: the band is narrower by up to a window, and more so the
/// brighter the wall, so that its growth of 10.9 px is accurate to a pixel only.
#[test]
fn the_shadow_is_on_one_side_and_as_wide_as_geometry_says() {
    let boards = (0..8).map(|k| 0.040 + 0.007 * f64::from(k));
    let bands: Vec<[Band; 2]> =
        boards.map(|half_m| [2.0, 4.0].map(|wall_m| beside_a_board(half_m, wall_m))).collect();
    let mean = |of: &dyn Fn(&[Band; 2]) -> f64| {
        mean_and_error(&bands.iter().map(of).collect::<Vec<f64>>())
    };
    let [(near, e2), (far, e4)] = [0, 1].map(|wall| mean(&|b| b[wall].dark));
    println!("dark before 2 m {near:.2} +- {e2:.2} px, before 4 m {far:.2} +- {e4:.2} px");
    for (seen, error, whole) in [(near, e2, 21.75), (far, e4, 32.625)] {
        assert!(error < 0.5, "precise enough to say anything: {error}");
        let lost = whole - seen;
        assert!((1.4 - 3.0 * error..3.2 + 3.0 * error).contains(&lost), "{seen} of {whole}");
    }
    assert!((far - near - 10.875).abs() < 0.5 + 3.0 * e2.hypot(e4), "{near} {far}");
    let (width, _) = mean(&|b| b[0].missing);
    let (grown, error) = mean(&|b| b[1].missing - b[0].missing);
    println!("missing {width:.1} px, grows by {grown:.2} +- {error:.2} px");
    assert!((grown - 10.9).abs() < 1.0 + 3.0 * error, "{grown} +- {error}");
    assert!((21.75 - 9.0..21.75 + 1.0).contains(&width), "at most a window less: {width}");
    let lit_side = bands.iter().flatten().map(|b| b.lit_side).fold(0.0, f64::max);
    assert!(lit_side < 2.0, "no shadow on the right: {lit_side} px");
}

/// What a board at 1 m hides of a wall, px per row.
struct Band {
    /// Columns without light on the left.
    dark: f64,
    /// Pixels without depth on the right, and how many more there are on the left.
    lit_side: f64,
    missing: f64,
}

fn beside_a_board(half_m: f64, wall_m: f64) -> Band {
    let mut bench = Bench { wall_m: Some(wall_m), ..frontal(1.0) };
    bench.target = Target::Board(Board { width_m: 2.0 * half_m, height_m: 1.0 });
    // Bright enough that only the shadow is dark.
    let watched = watch(&causes(&["light=4"]), &bench, 1, 7);
    let silent = watch(&causes(&["light=4", "read_noise_dn=0"]), &bench, 1, 7);
    let edge = half_m * 580.0;
    let reach = edge + 40.0;
    let missing =
        |from: f64, to: f64| watched.missing_per_row((119.5 + from, 119.5 + to), (10, 170));
    let lit_side = missing(0.0, reach);
    Band {
        dark: silent.dark_columns((119.5 - reach, 119.5)),
        lit_side,
        missing: missing(-reach, 0.0) - lit_side,
    }
}

fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let square: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    (mean, (square / (n - 1.0) / n).sqrt())
}

/// physics.md, 10: the projector meets a wall at 70 degrees and 1 m at 70 -+ 4.3 degrees; the light differs
/// by a factor of 1.52, and the dropout with it. Not so for pitch. 2,000 dots with a coefficient of
/// variation of 0.7 give 2 %.
#[test]
fn yaw_has_two_sides_and_pitch_has_not() {
    let look = |azimuth: f64| watch(&Causes::default(), &wall(1.0, 72.0, azimuth), 1, 8);
    let [away, towards, down, up] = [0.0, 180.0, 90.0, -90.0].map(look);
    let light = |azimuth: f64| {
        watch(&causes(&["read_noise_dn=0"]), &wall(1.0, 70.0, azimuth), 1, 8).middle_light_dn()
    };
    let ratio = light(0.0) / light(180.0);
    println!(
        "light {ratio:.2}; missing {:.3} {:.3}, pitch {:.3} {:.3}",
        away.missing(),
        towards.missing(),
        down.missing(),
        up.missing()
    );
    assert!((ratio / 1.52 - 1.0).abs() < 0.1, "{ratio}");
    assert!(towards.missing() > 1.3 * away.missing());
    assert!((up.missing() - down.missing()).abs() < 0.5 * (towards.missing() - away.missing()));
}

/// physics.md, 25: an error odd in u about the projector's axis, (u - u_p) dlam / lam; physics.md, 24: the
/// baseline's expansion scales every disparity. Pixel locking (physics.md, 3) changes the slope by 5 % and a
/// mean by up to 0.06 px; the noise is small compared with that (7e-5 in the slope).
#[test]
fn warmth_turns_the_plane_and_scales_the_depth() {
    let hot = ["warm_up_k=15", "warm_up_s=1"];
    let slope = |extra: &[&str]| {
        let causes = causes(&[&hot[..], extra].concat());
        watch_late(&causes).slope_per_px()
    };
    let laser = slope(&["expansion_per_k=0", "wavelength_nm_per_k=0.3"]);
    let expected = 15.0 * 0.3 / 830.0;
    println!("slope {laser:.2e} px a px, expected {expected:.2e}");
    assert!((laser / expected - 1.0).abs() < 0.12, "{laser} {expected}");
    let metal = ["wavelength_nm_per_k=0", "expansion_per_k=0.0003"];
    let mean = |text: &[&str]| watch_late(&causes(text)).mean_px();
    let shift = mean(&[&hot[..], &metal].concat()) - mean(&metal);
    assert!((shift - 0.0045 * FB / 2.0).abs() < 0.12, "{shift}");
}

/// The frame at 100 time constants.
fn watch_late(causes: &Causes) -> Watch {
    let sensor = SpeckleSensor::new(&kinect(), causes.clone()).unwrap();
    let instant = Instant { view: 0, frame: 0, session_s: 100.0, view_s: 0.0 };
    Watch::take(&sensor, &frontal(2.0), &[instant], Seed(9))
}

/// physics.md, 19: the reference image was taken through the same lens, so the error vanishes at the
/// reference (2 m) and grows away from it: (d distortion / dx)(d - d_ref).
#[test]
fn an_unknown_lens_shows_away_from_the_reference_only() {
    let rms = |z: f64, lens: &str| {
        let watched = watch(&causes(&[lens, "speckle=0", "read_noise_dn=0"]), &frontal(z), 1, 10);
        watched.smooth_px()
    };
    let [there, near, far] = [2.0, 1.0, 3.5].map(|z| rms(z, "lens_k1=-0.3") - rms(z, "lens_k1=0"));
    println!("smooth error by the lens: 2 m {there:.3}, 1 m {near:.3}, 3.5 m {far:.3} px");
    assert!(there.abs() < 0.02 && near > 0.1 && far > 0.03, "{there} {near} {far}");
}

/// At 525 px a corner's ray is at 0.76, and a lens of k1 = -0.3 folds the image at 0.70.
#[test]
fn a_lens_that_folds_the_image_is_refused() {
    let sensor = kinoise::simulate::room::Film::kinect(1);
    let made = SpeckleSensor::new(&sensor, causes(&["lens_k1=-0.3"]));
    let error = made.err().expect("a refusal").to_string();
    assert!(error.starts_with("lens_k1 = -0.3") && error.contains("smaller"), "{error}");
}

fn small_shoot(frames: usize, shrink: usize, causes: Causes) -> Shoot {
    let poses = common::grid(&[1.0, 1.5, 2.0], &[0.0, 30.0]).views();
    Shoot {
        sensor: kinect_v1(shrink),
        views: plan_grid(&poses, &Scenery::bare(Target::Wall), frames, true, Seed(11)),
        physics: Physics::Speckle { causes },
        infrared: true,
        seed: Seed(11),
    }
}

/// Deterministic: integer sums, and random streams by name.
#[test]
fn the_same_seed_gives_the_same_bytes_on_one_thread_and_two() {
    let bytes = |threads: usize| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        let moving = causes(&["motion_mps=0.1", "warm_up_k=3", "ambient_dn=20", "lens_k1=-0.1"]);
        pool.install(|| {
            small_shoot(2, 4, moving).write(folder.path(), &|_, _| ()).expect("written")
        });
        let mut files: Vec<(String, Vec<u8>)> = Vec::new();
        for view in ["0000", "0003", "0005"] {
            for file in ["depth/0000.png", "depth/0001.png", "ir/0001.png"] {
                let name = format!("{view}/{file}");
                files.push((name.clone(), std::fs::read(folder.path().join(name)).expect("there")));
            }
        }
        files.push((
            "recording.json".into(),
            std::fs::read(folder.path().join("recording.json")).expect("there"),
        ));
        files
    };
    let (one, two) = (bytes(1), bytes(2));
    one.iter().zip(&two).for_each(|(a, b)| assert!(a == b, "{} differs", a.0));
    assert_ne!(one[0].1, one[1].1, "frames differ");
}

/// physics.md, 0: published disparity noise is .07 to .12 px. One recording, a fit with one parameter.
#[test]
fn a_calibration_finds_a_kinects_disparity_noise() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let root = folder.path().join("recording");
    small_shoot(2, 2, Causes::default()).write(&root, &|_, _| ()).expect("written");
    let recording = kinoise::io::open(&root, &kinoise::io::Assumed::default()).expect("opens");
    assert!(recording.sensor.camera.distortion.is_none());
    let options = CalibrateOptions { form: Some(Form::Disparity), ..Default::default() };
    let views =
        kinoise::measure_recording(&recording, &options.measure, &|_, _| ()).expect("measured");
    let calibration = kinoise::model_of(&recording, &views, &options).expect("fitted");
    let sigma_d =
        calibration.model.sigma.parameters[0] * recording.sensor.disparity_px_m().expect("known");
    println!("sigma_d {sigma_d:.3} px");
    assert!((0.05..0.15).contains(&sigma_d), "{sigma_d}");
}
