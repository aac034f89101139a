//! Pictures of a board before a wall, with an edge that is sharp, mixed or shaded by a known amount.

use rand::Rng;
use rand_distr::{Distribution, Normal};

use super::*;
use crate::camera::Camera;
use crate::diagnose::edges::EdgeLoss;
use crate::diagnose::edges::mixing::mixing;
use crate::diagnose::edges::shadow::{Band, Sides, band};
use crate::diagnose::missing::LEVEL;
use crate::diagnose::missing::report::shadow_finding;
use crate::frame::DepthCode;
use crate::plane::Plane;
use crate::rng::{Seed, Stream};
use crate::simulate::kinect_v1;

const WALL_M: f64 = 2.4;
const CODE: DepthCode = DepthCode::Metric { units_per_metre: 20_000.0, invalid: 0 };
/// Noise of the disparity, px.
const NOISE_PX: f64 = 0.05;
/// Columns and rows of the board in a picture of 320 x 240 px.
const BOARD: [std::ops::Range<isize>; 2] = [80..240, 60..180];
/// Distance of the region's end from the board's border, px.
const REGION_PX: isize = 3;
/// Border of the board: twice 160 and twice 120, less the corners that no line of the region meets.
const CROSSINGS: f64 = 2.0 * (154.0 + 114.0);

/// Pixels inwards from the board's border: 0 is its last, -1 the first beside it.
fn depth_in(u: isize, v: isize) -> isize {
    let inside =
        |x: isize, range: &std::ops::Range<isize>| (x - range.start).min(range.end - 1 - x);
    inside(u, &BOARD[0]).min(inside(v, &BOARD[1]))
}

/// Share of the other surface's depth that a pixel mixes in, by its way into the board; or nothing.
type Answer<'a> = &'a dyn Fn(isize, &mut Stream) -> Option<f64>;

/// A board at `z`, seen in three frames.
fn field(camera: &Camera, z: f64, rng: &mut Stream, answer: Answer<'_>) -> Field {
    let (width, height) = (camera.width, camera.height);
    let (rays, table) = (camera.rays(), CODE.table());
    let scale_px_m = camera.fx * 0.075;
    let place = |i: usize| ((i % width) as isize, (i / width) as isize);
    let pixels: Vec<u32> = (0..width * height)
        .filter(|&i| depth_in(place(i).0, place(i).1) >= REGION_PX)
        .map(|i| i as u32)
        .collect();
    let n = pixels.len();
    let plane = Plane::tilted(z, 0.0, 0.0);
    let mut field = Field {
        sigma: vec![NOISE_PX as f32; n],
        spread_px: NOISE_PX as f32,
        ..Field::unseen(plane, scale_px_m, [width, height], pixels)
    };
    let noise = Normal::new(0.0, NOISE_PX).unwrap();
    let [board, wall] = [z, WALL_M];
    for k in 0..3 {
        let mut frame = Frame { width, height, raw: vec![0; width * height] };
        for i in 0..width * height {
            let (u, v) = place(i);
            // Only the board's rows have a shadow, left of the board.
            let inside = depth_in(u, v);
            let left = u < BOARD[0].start && BOARD[1].contains(&v);
            let asked = if inside < 0 && !left { inside.min(-1000) } else { inside };
            let Some(share) = answer(asked, rng) else { continue };
            let own = if inside >= 0 { board } else { wall };
            let other = if inside >= 0 { wall } else { board };
            let mixed = scale_px_m / (own + share * (other - own));
            let disparity = mixed + noise.sample(rng);
            frame.raw[i] = CODE.raw(scale_px_m / disparity);
        }
        if k == 0 {
            field.edges = Edges::find(&field, &frame, &rays, &table);
        }
        let mut edges = std::mem::take(&mut field.edges);
        edges.add(&field, &frame, &rays, &table);
        field.edges = edges;
    }
    field
}

/// Ten views from 1 to 1.5 m, with the same answer.
fn views(seed: u64, answer: Answer<'_>) -> Vec<Field> {
    let camera = kinect_v1(2).camera;
    let mut rng = Seed(seed).stream("edges");
    (0..10).map(|k| field(&camera, 1.0 + 0.05 * f64::from(k), &mut rng, answer)).collect()
}

fn sides(fields: &[Field]) -> Vec<Sides> {
    fields.iter().map(|f| Sides::of(&f.edges, None)).collect()
}

#[test]
fn every_line_crosses_the_edge_twice() {
    let fields = views(1, &|_, _| Some(0.0));
    let edges = &fields[0].edges;
    assert_eq!(edges.inside[0].n, 2.0 * CROSSINGS);
    // 290 px x 0.075 m x (1/2.4 - 1/1).
    let step = edges.inside[0].step / edges.inside[0].n;
    assert!((step + 290.0 * 0.075 * (1.0 - 1.0 / 2.4)).abs() < 0.5, "{step}");
    let beside = edges.beside(0).unwrap();
    let width = beside.shaded / beside.rows;
    assert!(beside.lost == 0.0 && (width + step).abs() < 0.05, "{beside:?}");
}

#[test]
fn without_anything_behind_there_is_no_edge() {
    let nothing = views(2, &|inside, _| (inside >= 0).then_some(0.0));
    assert!(nothing.iter().all(|f| f.edges.inside[0].n == 0.0), "nothing is measured behind");
    let same = views(2, &|inside, _| Some(f64::from(u8::from(inside < 0))));
    assert!(same.iter().all(|f| f.edges.inside[0].n == 0.0), "the same plane goes on");
}

/// The last pixel takes a hundredth of the step: 0.1 px at 0.05 px of noise over 5000 pixels. The footprint
/// that mixes in as much follows from w / (w - 1/2) = 1 / (1 - 2/100). Part of a footprint of 1 px does so
/// too and is not excluded.
#[test]
fn a_hundredth_of_the_step_is_seen_and_sized() {
    let mixed = |inside: isize, _: &mut Stream| Some(if inside == 0 { 0.01 } else { 0.0 });
    let found = mixing(&views(3, &mixed), None, LEVEL).expect("a mixed edge");
    assert_eq!(found.families, ["edge-mixing"]);
    let width = &found.parameters["width_px"];
    let [value, error] = ["value", "std_error"].map(|k| width[k].as_f64().unwrap());
    let truth = 0.5 / (1.0 - 2.0 * 0.01);
    assert!((value - truth).abs() < 0.002, "{value}");
    assert!((0.9..1.1).contains(&(error / (1.0 - truth))), "{value} +- {error}");
}

/// Shares of the catalogue's own footprint, 4 px to either side.
#[test]
fn a_full_footprint_is_given_its_width() {
    let mixed = |inside: isize, _: &mut Stream| {
        let distance = if inside >= 0 { inside as f64 } else { -1.0 - inside as f64 } + 0.5;
        Some(0.5 * (1.0 - distance / 4.0).max(0.0))
    };
    let found = mixing(&views(4, &mixed), None, LEVEL).expect("a mixed edge");
    let width = found.parameters["width_px"]["value"].as_f64().unwrap();
    assert!((width - 4.0).abs() < 0.2, "{width}");
}

/// Number of 40 sets of views with a mixed edge at a level of 5 %.
fn mixed_of_40(first_seed: u64, answer: Answer<'_>) -> usize {
    let mixed = |seed: &u64| mixing(&views(*seed, answer), None, 0.05).is_some();
    (first_seed..first_seed + 40).filter(mixed).count()
}

/// At a level of 5 % two of 40 sharp edges may be found mixed; eight are one in a thousand.
#[test]
fn sharp_edges_are_told_as_often_as_the_level_says() {
    let count = mixed_of_40(100, &|_, _| Some(0.0));
    assert!(count <= 7, "{count} of 40");
}

/// One reading in twenty is off by up to the step, either way.
#[test]
fn gross_errors_beside_the_edge_are_no_mixing() {
    let gross = |_: isize, rng: &mut Stream| {
        Some(if rng.random_bool(0.05) { rng.random_range(-1.0..1.0) } else { 0.0 })
    };
    let count = mixed_of_40(200, &gross);
    assert!(count <= 7, "{count} of 40");
}

#[test]
fn what_the_twin_has_too_is_no_news() {
    let mixed = |inside: isize, _: &mut Stream| Some(if inside == 0 { 0.05 } else { 0.0 });
    let (real, twin) = (views(5, &mixed), views(6, &mixed));
    assert!(mixing(&real, None, LEVEL).is_some());
    assert!(mixing(&real, Some(&twin), LEVEL).is_none());
}

/// A pixel beside the board is lost once in 50 times.
#[test]
fn a_shadow_that_loses_one_reading_in_fifty_is_seen() {
    let camera = kinect_v1(2).camera;
    let mut rng = Seed(7).stream("shadow");
    let fields: Vec<Field> = (0..10)
        .map(|k| {
            let z = 1.0 + 0.05 * f64::from(k);
            let reach = camera.fx * 0.075 * (1.0 / z - 1.0 / WALL_M);
            let dark = move |inside: isize, rng: &mut Stream| {
                let shaded = inside < 0 && (-inside as f64) < reach + 0.5;
                (!(shaded && rng.random::<f64>() < 0.02)).then_some(0.0)
            };
            field(&camera, z, &mut rng, &dark)
        })
        .collect();
    let found = band(&sides(&fields), LEVEL).expect("a shadow");
    assert!(found.lawful && found.side == 0, "{found:?}");
    let [share, error] = found.share;
    assert!((share - 0.02).abs() < 4.0 * error && error < 0.004, "{share} +- {error}");
}

#[test]
fn losses_on_both_sides_or_everywhere_are_no_shadow() {
    let anywhere = |_: isize, rng: &mut Stream| (rng.random::<f64>() > 0.05).then_some(0.0);
    assert!(band(&sides(&views(8, &anywhere)), LEVEL).is_none());
}

fn shadows(width: impl Fn(f64) -> [f64; 2]) -> Vec<Sides> {
    let of = |k: i32| {
        let shaded = 2.0 * f64::from(k);
        let [left, right] = width(shaded).map(f64::round);
        let side = |lost: f64| {
            let [lost, shaded] = [lost, shaded].map(|px| 100.0 * px);
            let counts = [[4.0 * lost, 4.0 * shaded], [0.0, 3200.0]];
            Some(EdgeLoss { lost, shaded, rows: 100.0, counts })
        };
        Sides([side(left), side(right)])
    };
    (4..14).map(of).collect()
}

#[test]
fn a_band_is_a_shadow_when_it_is_on_one_side_and_as_wide_as_it_must_be() {
    let found = band(&shadows(|e| [0.9 * e, 0.0]), LEVEL).unwrap();
    assert!(found.lawful && found.side == 0 && (found.share[0] - 0.9).abs() < 0.05);
    assert_eq!(band(&shadows(|e| [0.0, e]), LEVEL).unwrap().side, 1);
    assert!(!band(&shadows(|e| [e, 0.9 * e]), LEVEL).unwrap().lawful, "on both sides");
    assert!(!band(&shadows(|e| [0.0, 3.0 * e]), LEVEL).unwrap().lawful, "too wide");
    assert!(band(&shadows(|_| [0.0, 0.0]), LEVEL).is_none());
    assert!(band(&shadows(|e| [f64::from(e > 25.0), 0.0]), LEVEL).is_none(), "a stray pixel");
}

/// The last three of ten views lose on the right what the geometry predicts; one pixel each would be no shadow.
#[test]
fn a_shadow_of_some_views_is_told_with_how_many() {
    let last = |e: f64| if e > 21.0 { 0.9 * e } else { 0.0 };
    let found = band(&shadows(|e| [0.0, last(e)]), LEVEL).expect("a shadow");
    assert_eq!((found.of_some, found.side), (Some([3, 10]), 1));
    assert!(found.lawful && (found.share[0] - 0.9).abs() < 0.05, "{found:?}");
    let nameless = shadow_finding(Band { lawful: false, ..found }, &[]).shape.expect("a shape");
    assert!(nameless.ends_with(" px, in 3 of 10 views"), "{nameless}");
    let lines = |e: f64| if e > 21.0 { 1.0 } else { 0.0 };
    assert!(
        band(&shadows(|e| [0.0, lines(e)]), LEVEL).is_none(),
        "a line is what a border errs by"
    );
}

/// Twelve views with a few lost readings each, as in a shadow of some thousandths: told where the background
/// beyond loses none, but not where it loses as many, nor where one view alone loses them.
#[test]
fn a_thin_shadow_is_seen_by_the_counts() {
    let thin = |within: [f64; 12], beyond: f64| {
        let view = |n: f64| {
            let left = EdgeLoss {
                lost: n / 4.0,
                shaded: 100.0,
                rows: 60.0,
                counts: [[n, 400.0], [beyond, 2000.0]],
            };
            Sides([Some(left), None])
        };
        band(&within.map(view), LEVEL)
    };
    let few = [0.0, 1.0, 0.0, 2.0, 1.0, 0.0, 3.0, 0.0, 1.0, 0.0, 3.0, 1.0];
    let found = thin(few, 0.0).expect("a shadow");
    assert!(found.lawful && found.of_some.is_none() && found.share[0] < 0.01, "{found:?}");
    assert!(thin(few, 5.0).is_none(), "as much is lost beyond it");
    let mut one = [0.0; 12];
    one[3] = 14.0;
    assert!(thin(one, 0.0).is_none(), "in one view");
}

/// Three views are enough for a shadow of several pixels, but not for the border error, nor for one object
/// before the wall.
#[test]
fn a_shadow_of_three_views_is_seen() {
    let of_three = |width: &dyn Fn(f64) -> f64| {
        let views = shadows(|e| [width(e), 0.0]);
        band(&views[..3], LEVEL)
    };
    let found = of_three(&|e| 0.7 * e).expect("6, 7 and 8 px");
    assert!(found.lawful && found.of_some.is_none() && (found.share[0] - 0.7).abs() < 0.05);
    assert!(of_three(&|_| 1.0).is_none(), "a pixel each");
    assert!(of_three(&|e| if e > 11.0 { 30.0 } else { 0.0 }).is_none(), "in one view");
}

/// Four of fourteen views have footprints of 4 px to either side.
#[test]
fn mixing_of_some_views_is_told_with_how_many() {
    let mixed = |inside: isize, _: &mut Stream| {
        let seen = 0.5 * (1.0 - (inside as f64 + 0.5) / 4.0).max(0.0);
        Some(if inside >= 0 { seen } else { 0.0 })
    };
    let clean = |_: isize, _: &mut Stream| Some(0.0);
    let mut all = views(21, &clean);
    all.truncate(10);
    let mut some = views(22, &mixed);
    some.truncate(4);
    all.extend(some);
    let found = mixing(&all, None, LEVEL).expect("mixing");
    assert!(found.families == ["edge-mixing"]);
    let words = found.words.unwrap();
    assert!(found.of_some == Some([4, 14]) && words.ends_with("in 4 of 14 views"), "{words}");
}
