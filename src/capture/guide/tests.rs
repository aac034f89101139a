use super::*;
use crate::capture::advice::Advice;
use crate::capture::screen::{Status, render};
use crate::capture::wanted::{PAPER_DISTANCES_M, PAPER_TILTS_DEG};
use crate::capture::watch::Watcher;
use crate::plane::Plane;
use crate::rng::Seed;
use crate::scene::{Bench, Board, Target};
use crate::simulate::{FormulaSensor, kinect_v1};
use crate::{Form, SigmaModel};

const SHUTTER: Shutter = Shutter { frames: 3, hold: 2 };

fn seen(z: f64, tilt_deg: f64) -> Sighting {
    let corners = [(-0.3, -0.2), (0.3, -0.2), (-0.3, 0.2), (0.3, 0.2)];
    Sighting { plane: Plane::tilted(z, tilt_deg.to_radians(), 0.0), corners }
}

fn guide(distances_m: &[f64], tilts_deg: &[f64]) -> Guide {
    let tilts: Vec<f64> = tilts_deg.iter().map(|t| t.to_radians()).collect();
    Guide::new(Wanted::grid(distances_m, &tilts), SHUTTER)
}

/// One letter per event: b(egun) k(eep) f(inished) a(bandoned) r(ejected) d(rift) . (done), - for none.
fn story(guide: &mut Guide, sights: impl IntoIterator<Item = Result<Sighting, String>>) -> String {
    let mut story = String::new();
    for (k, sight) in sights.into_iter().enumerate() {
        let events = guide.see(k as f64 / 30.0, sight);
        if events.is_empty() {
            story.push('-');
        }
        story.extend(events.iter().map(|event| match event {
            Event::Begun(_) => 'b',
            Event::Keep => 'k',
            Event::Finished(_) => 'f',
            Event::Abandoned { .. } => 'a',
            Event::Rejected(_) => 'r',
            Event::Drift(_) => 'd',
            Event::Done => '.',
        }));
        story.push(' ');
    }
    story.trim_end().into()
}

#[test]
fn a_view_is_taken_by_itself_once_the_target_holds_still() {
    let mut g = guide(&[1.0, 2.0], &[0.0]);
    let first = std::iter::repeat_n(Ok(seen(1.05, 1.0)), 6);
    assert_eq!(story(&mut g, first), "- bk k kf - -", "once, not again");
    let carried = (1..=8).map(|k| Ok(seen(1.05 + 0.1 * f64::from(k), 1.0)));
    assert_eq!(story(&mut g, carried), "- - - - - - - -", "moving");
    let second = std::iter::repeat_n(Ok(seen(1.95, 1.0)), 4);
    assert_eq!(story(&mut g, second), "- bk k kf.");
}

#[test]
fn a_view_in_which_the_target_moves_or_is_lost_is_thrown_away_and_taken_anew() {
    let mut g = guide(&[1.0, 3.0], &[0.0]);
    let still = || Ok(seen(1.0, 0.0));
    // 3 mm at 1 m is more than two thirds of a step.
    let sights = [still(), still(), Ok(seen(1.003, 0.0)), Ok(seen(1.003, 0.0))];
    assert_eq!(story(&mut g, sights), "- bk a bk");
    let sights = [Err("a hand".into()), still(), still(), still(), still()];
    assert_eq!(story(&mut g, sights), "a - bk k kf");
    assert_eq!(g.wanted().views[0].state, ViewState::Taken);
}

#[test]
fn a_slow_drift_of_the_hand_is_motion_too() {
    let mut g = guide(&[1.0], &[0.0]);
    g = Guide::new(g.wanted().clone(), Shutter { frames: 100, hold: 2 });
    let sinking = (0..30).map(|k| Ok(seen(1.0 + 2e-4 * f64::from(k), 0.0)));
    assert!(story(&mut g, sinking).contains('a'));
}

#[test]
fn off_the_grid_nothing_is_taken_and_the_way_is_shown() {
    let mut g = guide(&[1.0, 1.5], &[0.0, 30.0]);
    assert_eq!(story(&mut g, std::iter::repeat_n(Ok(seen(1.25, 15.0)), 4)), "- - - -");
    assert_eq!(Advice::of(&g).word, "NEAR 25");
    story(&mut g, [Ok(seen(1.1, 12.0))]);
    assert_eq!(Advice::of(&g).word, "TILT -12°");
    story(&mut g, [Ok(seen(1.1, 2.0))]);
    assert_eq!(Advice::of(&g).word, "HOLD");
    story(&mut g, [Err("nothing flat".into())]);
    assert_eq!(Advice::of(&g).word, "AIM");
}

#[test]
fn a_bad_view_is_taken_again_and_one_that_cannot_be_had_is_skipped() {
    let mut g = guide(&[1.0, 2.0], &[0.0]);
    let still = || std::iter::repeat_n(Ok(seen(1.0, 0.0)), 4);
    story(&mut g, still());
    assert_eq!(g.obey(Command::Again), [Event::Rejected("z100-t00".into())]);
    assert_eq!(g.wanted().views[0].state, ViewState::Open);
    assert!(g.obey(Command::Again).is_empty(), "it is gone already");
    assert_eq!(story(&mut g, still()), "- bk k kf");
    g.obey(Command::Skip);
    assert_eq!(g.wanted().views[1].state, ViewState::Skipped);
    assert!(g.wanted().is_done());
}

/// The suggestion stays with a view until another is much nearer; the view being taken may be another.
#[test]
fn keys_are_about_what_is_being_taken() {
    let mut g = Guide::new(Wanted::any(), SHUTTER);
    let at = |z: f64, n| std::iter::repeat_n(Ok(seen(z, 0.0)), n);
    assert_eq!(story(&mut g, at(1.0, 4).chain(at(1.4, 3))), "- bk k kf - bk k");
    let events = g.obey(Command::Skip);
    assert!(
        matches!(&events[..], [Event::Abandoned { view, .. }] if view == "z140-t00"),
        "{events:?}"
    );
    assert_eq!(story(&mut g, at(1.4, 4)), "- - - -", "skipped for good");
    assert_eq!(story(&mut g, at(1.8, 3)), "- bk k");
    let events = g.obey(Command::Again);
    assert!(
        matches!(&events[..], [Event::Abandoned { .. }, Event::Rejected(view)] if view == "z100-t00"),
        "{events:?}"
    );
    assert_eq!(g.wanted().views.len(), 2, "a new view that failed is wanted by nobody");
    story(&mut g, at(2.2, 3));
    assert!(matches!(g.leave(), Some(Event::Abandoned { .. })));
    assert_eq!(g.wanted().views.len(), 2);
}

#[test]
fn with_any_pose_wanted_each_new_one_is_a_view_and_an_abandoned_one_is_none() {
    let mut g = Guide::new(Wanted::any(), SHUTTER);
    let at = |z: f64, n| std::iter::repeat_n(Ok(seen(z, 20.0)), n);
    assert_eq!(story(&mut g, at(1.3, 6)), "- bk k kf - -");
    assert_eq!(story(&mut g, at(1.6, 3).chain(at(1.9, 1))), "- bk k a");
    assert_eq!(g.wanted().views.len(), 1);
    assert_eq!(g.wanted().views[0].name, "z130-t20-a000");
    let mut again = Wanted::any();
    again.mark_taken(&["z130-t20-a000".into()]);
    let mut g = Guide::new(again, SHUTTER);
    assert_eq!(story(&mut g, at(1.31, 4)), "- - - -", "known from the folder's name");
}

/// The watcher on simulated frames: the pose to 3 mm and 0.5 degrees (the board has tens of thousands of
/// pixels), and stillness despite noise.
#[test]
fn from_frames_to_events() {
    let sensor = kinect_v1(2);
    let rays = sensor.camera.rays();
    let sigma = SigmaModel::published(
        Form::Paper,
        &crate::model::PAPER_EQ1,
        crate::model::Domain { z_m: [0.2, 10.0], theta_rad: [0.0, 1.37] },
    );
    let camera =
        FormulaSensor { sensor: &sensor, rays: &rays, sigma: &sigma, effects: &[], seed: Seed(4) };
    let mut g = guide(&[1.0, 1.5], &[0.0, 40.0]);
    let mut watcher = Watcher::new(&sensor);
    for (view, (z, tilt)) in [(1.0, 0.0f64), (1.5, 40.0)].into_iter().enumerate() {
        let plane = Plane::tilted(z, tilt.to_radians(), 0.4);
        let board = Target::Board(Board { width_m: 1.0, height_m: 0.8 });
        let seen = crate::scene::Seen::of(&Bench::bare(plane, board), &sensor.camera, &rays);
        let mut shooting = camera.begin(&seen);
        let sights: Vec<_> = (0..5)
            .map(|frame| {
                let instant = crate::effects::Instant { view, frame, session_s: 0.0, view_s: 0.0 };
                watcher.look(&shooting.shoot(instant).depth)
            })
            .collect();
        let pose = sights[4].as_ref().expect("a board").pose();
        assert!((pose.z_m - z).abs() < 0.003, "{pose:?}");
        assert!((pose.theta_rad.to_degrees() - tilt).abs() < 0.5, "{pose:?}");
        assert_eq!(story(&mut g, sights), "- bk k kf -");
    }
    let blank = crate::Frame { width: 320, height: 240, raw: vec![0; 320 * 240] };
    assert!(watcher.look(&blank).is_err());
}

fn screen(guide: &Guide, status: &Status) -> String {
    let lines = render(guide, status, 80, 24);
    assert!(lines.len() <= 24 && lines.iter().all(|l| l.text.chars().count() <= 80));
    lines.iter().map(|l| format!("{}\n", l.text.trim_end())).collect()
}

#[test]
fn the_screen() {
    let mut g = guide(&PAPER_DISTANCES_M, &PAPER_TILTS_DEG);
    let mut status = Status { title: "kinect   Kinect for Xbox 360".into(), ..Default::default() };
    story(&mut g, std::iter::repeat_n(Ok(seen(1.02, 11.0)), 4));
    story(&mut g, [Ok(seen(1.25, 12.0))]);
    insta::assert_snapshot!("carry", screen(&g, &status));
    story(&mut g, std::iter::repeat_n(Ok(seen(1.52, 9.0)), 2));
    insta::assert_snapshot!("stay", screen(&g, &status));
    status.flash = Some("z150-t10".into());
    status.news = "z150-t10 taken".into();
    insta::assert_snapshot!("taken", screen(&g, &status));
    (status.flash, status.silent_s) = (None, Some(3));
    assert!(screen(&g, &status).contains("none for 3 s"), "a stream that stands still");
}
