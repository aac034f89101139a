use super::*;
use crate::terms::PixelContext;
use rand::Rng;

const VIEWS: usize = 16;
const SIDE: f64 = 4.0;
const ACROSS: usize = 30;

/// Views ever steeper and, in another order, ever farther; `lost` says what a patch loses.
fn session(mut lost: impl FnMut(usize, usize) -> f64) -> (Vec<Vec<Cell>>, Extent) {
    let view = |view: usize| -> Vec<(usize, PixelContext)> {
        let theta = (4.5 * view as f64).to_radians();
        let z = 0.8 + 0.15 * (7 * view % VIEWS) as f64;
        let place = |i: usize| PixelContext {
            u: SIDE * (i % ACROSS) as f64 + 2.0,
            v: SIDE * (i / ACROSS) as f64 + 2.0,
            theta,
            z,
            edge: 30.0,
            side: SIDE,
            ..Default::default()
        };
        (0..ACROSS * ACROSS).map(|i| (i, place(i))).collect()
    };
    let cells: Vec<Vec<Cell>> = (0..VIEWS)
        .map(|v| {
            let cell = |(i, place)| Cell { place, lost: lost(v, i), asked: 64.0 };
            view(v).into_iter().map(cell).collect()
        })
        .collect();
    let reach = Extent::of(cells.iter().flatten().map(|c| &c.place));
    (cells, reach)
}

fn found((cells, reach): &(Vec<Vec<Cell>>, Extent)) -> Option<Axis> {
    few_losses(cells, 8.0, reach, 0.001, Seed(1)).map(|(judged, _)| judged.shape.axis())
}

#[test]
fn the_foot_of_a_rise_is_seen_in_the_steepest_view_and_in_the_farthest() {
    let mut rng = Seed(5).stream("few");
    // Of seven times its number modulo 16 the tenth view has the most.
    for (view, axis) in [(VIEWS - 1, Axis::Theta), (9, Axis::Z)] {
        let lossy = session(|v, _| f64::from(u8::from(v == view && rng.random_bool(0.08))));
        assert_eq!(found(&lossy), Some(axis), "view {view}");
    }
}

/// A clump counts once, views in the middle of both axes follow none, and what is lost alike in
/// all views follows nothing.
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

/// Views that differ for no reason by a factor of e: the level that was asked for holds.
#[test]
fn views_that_differ_for_no_reason_seldom_look_like_a_foot() {
    let mut alarms = 0;
    for seed in 0..60 {
        let mut rng = Seed(seed).stream("few/null");
        let levels: Vec<f64> = (0..VIEWS)
            .map(|_| {
                let normal: f64 = StandardNormal.sample(&mut rng);
                (0.004 * normal.exp()).min(0.2)
            })
            .collect();
        let lossy = session(|v, _| f64::from(u8::from(rng.random_bool(levels[v]))));
        alarms += u32::from(found(&lossy).is_some());
    }
    assert!(alarms <= 1, "{alarms} of 60");
}
