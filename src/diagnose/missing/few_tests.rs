use super::*;
use crate::diagnose::missing::cells::{Patch, cells};
use crate::terms::{Axis, PixelContext};
use rand::Rng;

const VIEWS: usize = 16;
const SIDE: f64 = 4.0;
const ACROSS: usize = 30;

/// Views of increasing tilt and, in another order, increasing distance, each a tenth farther on its right
/// than on its left. `lost` gives what a patch loses.
fn session(mut lost: impl FnMut(usize, usize) -> f64) -> (Vec<Vec<Patch>>, Extent) {
    let view = |view: usize| -> Vec<(usize, PixelContext)> {
        let theta = (4.5 * view as f64).to_radians();
        let z = 0.8 + 0.15 * (7 * view % VIEWS) as f64;
        let place = |i: usize| PixelContext {
            u: SIDE * (i % ACROSS) as f64 + 2.0,
            v: SIDE * (i / ACROSS) as f64 + 2.0,
            theta,
            z: z * (0.95 + 0.1 * (i % ACROSS) as f64 / ACROSS as f64),
            session_s: 60.0 * view as f64,
            edge: 30.0,
            side: SIDE,
            ..Default::default()
        };
        (0..ACROSS * ACROSS).map(|i| (i, place(i))).collect()
    };
    let patches: Vec<Vec<Patch>> = (0..VIEWS)
        .map(|v| {
            let patch = |(i, place)| Patch { place, lost: lost(v, i), asked: 64.0 };
            view(v).into_iter().map(patch).collect()
        })
        .collect();
    let reach = Extent::of(patches.iter().flatten().map(|p| &p.place));
    (patches, reach)
}

/// Place of a patch across its view, 0 (left) to 1.
fn right(i: usize) -> f64 {
    (i % ACROSS) as f64 / ACROSS as f64
}

/// Share lost, falling off exponentially over 0.06 of a view.
fn fall(over: f64) -> f64 {
    0.6 * (-over / 0.06).exp()
}

fn found((patches, reach): &(Vec<Vec<Patch>>, Extent)) -> Option<Axis> {
    few_losses(&cells(patches, &vec![1.0; patches.len()]), 8.0, reach, 0.001, Seed(1))
        .map(|(judged, _)| judged.shape.axis())
}

#[test]
fn the_foot_of_a_rise_is_seen_in_the_steepest_view_the_farthest_and_the_nearest() {
    let mut rng = Seed(5).stream("few");
    // 7 * view % 16 is largest for the tenth view and smallest for the first.
    type Rise<'a> = &'a dyn Fn(usize) -> f64;
    let cases: [(usize, Rise<'_>, Axis); 3] = [
        (VIEWS - 1, &|_| 0.08, Axis::Theta),
        (9, &|i| fall(1.0 - right(i)), Axis::Z),
        (0, &|i| fall(right(i)), Axis::Z),
    ];
    for (view, rise, axis) in cases {
        let lossy = session(|v, i| f64::from(u8::from(v == view && rng.random_bool(rise(i)))));
        assert_eq!(found(&lossy), Some(axis), "view {view}");
    }
}

/// At the farthest distance, but only in the later of the two views that reach it.
#[test]
fn a_foot_that_begins_in_the_midst_of_the_session_is_seen() {
    let mut rng = Seed(8).stream("few");
    let (mut patches, reach) =
        session(|v, i| f64::from(u8::from(v == 9 && rng.random_bool(fall(1.0 - right(i))))));
    let step = |patches: &[Vec<Patch>]| {
        let (judged, _) =
            few_losses(&cells(patches, &vec![1.0; patches.len()]), 8.0, &reach, 0.001, Seed(1))?;
        let Shape::Step(step) = judged.shape else { return None };
        Some((step.axis, step.since_s))
    };
    let twin: Vec<f64> = patches[9].iter().map(|c| c.place.z).collect();
    patches[2].iter_mut().zip(twin).for_each(|(c, z)| c.place.z = z);
    let (axis, start) = step(&patches).expect("found");
    assert!(axis == Axis::Z && start.is_some_and(|s| (120.0..540.0).contains(&s)), "{start:?}");
}

/// A clump counts once, views in the middle of both axes follow neither, and even losses follow nothing.
#[test]
fn clumps_other_views_and_even_losses_are_no_foot() {
    let mut rng = Seed(6).stream("few");
    let hole = |v: usize, i: usize| v == VIEWS - 1 && i % ACROSS < 5 && i / ACROSS < 5;
    assert_eq!(found(&session(|v, i| if hole(v, i) { 40.0 } else { 0.0 })), None);
    let mut some = |p: f64| f64::from(u8::from(rng.random_bool(p)));
    assert_eq!(found(&session(|v, _| if v == 8 { some(0.08) } else { 0.0 })), None);
    for _ in 0..5 {
        assert_eq!(found(&session(|_, _| some(0.01))), None);
    }
    assert_eq!(found(&session(|_, _| 0.0)), None);
}

/// Views differ by a factor of e without a cause, and so do their sides: the level asked for holds.
#[test]
fn views_that_differ_for_no_reason_seldom_look_like_a_foot() {
    let mut alarms = 0;
    for seed in 0..60 {
        let mut rng = Seed(seed).stream("few/null");
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let own: Vec<[f64; 2]> = (0..VIEWS).map(|_| [normal(), normal()]).collect();
        let lossy = session(|v, i| {
            let [level, slope] = own[v];
            let share = 0.004 * (level + slope * (2.0 * right(i) - 1.0)).exp();
            f64::from(u8::from(rng.random_bool(share.min(0.2))))
        });
        alarms += u32::from(found(&lossy).is_some());
    }
    assert!(alarms <= 1, "{alarms} of 60");
}
