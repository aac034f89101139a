//! Pictures of a board before a wall, whose edge is sharp or mixed over a known width.

use super::super::lattice::RawHistogram;
use super::super::shadow::Shadow;
use super::*;
use crate::camera::Camera;
use crate::frame::DepthCode;
use crate::plane::Plane;
use crate::simulate::kinect_v1;

const BOARD_M: f64 = 1.2;
const WALL_M: f64 = 2.4;
const CODE: DepthCode = DepthCode::Metric { units_per_metre: 5000.0, invalid: 0 };
/// The board's place in a picture of 320 x 240 px.
const BOARD: [std::ops::Range<usize>; 2] = [80..240, 60..180];

/// Columns and rows from the board's border, 0 on it.
fn off(u: usize, v: usize) -> usize {
    let beyond = |x: usize, range: &std::ops::Range<usize>| {
        if x < range.start { range.start - x } else { (x + 1).saturating_sub(range.end) }
    };
    beyond(u, &BOARD[0]).max(beyond(v, &BOARD[1]))
}

/// Depth beside the board by the number of px off it; the wall where there is none.
fn picture(camera: &Camera, beside: impl Fn(usize) -> Option<f64>) -> (Field, Frame) {
    let (width, height) = (camera.width, camera.height);
    let plane = Plane::tilted(BOARD_M, 0.0, 0.0);
    let mut frame = Frame { width, height, raw: vec![0; width * height] };
    let mut pixels = Vec::new();
    for v in 0..height {
        for u in 0..width {
            let away = off(u, v);
            let z = if away == 0 { BOARD_M } else { beside(away).unwrap_or(WALL_M) };
            frame.raw[v * width + u] = CODE.raw(z);
            if away == 0 {
                pixels.push((v * width + u) as u32);
            }
        }
    }
    let n = pixels.len();
    let field = Field {
        name: "view".into(),
        time_s: 0.0,
        plane,
        scale_px_m: camera.fx * 0.075,
        width,
        height,
        pixels,
        sigma: vec![0.1; n],
        spread_px: 0.1,
        mean: vec![0.0; n],
        square: vec![0.01; n],
        count: vec![1; n],
        measured: vec![1; n],
        first: Vec::new(),
        frames: Vec::new(),
        lines: Vec::new(),
        reference_distance_m: None,
        flatness_m: None,
        temperature_c: None,
        ambient_lux: None,
        light: Vec::new(),
        words: RawHistogram::none(),
        told: false,
        shadow: Shadow::default(),
        rim: None,
    };
    (field, frame)
}

fn rim(beside: impl Fn(usize) -> Option<f64>) -> (Field, Option<Rim>) {
    let camera = kinect_v1(2).camera;
    assert_eq!((camera.width, camera.height), (320, 240));
    let (field, frame) = picture(&camera, beside);
    let rim = Rim::around(&field, &frame, &camera.rays(), &CODE.table());
    (field, rim)
}

/// The border's pixels: twice 160 and twice 120.
const CROSSINGS: f64 = 560.0;

#[test]
fn a_sharp_edge_has_no_pixel_in_between() {
    let found = rim(|_| None).1.expect("an edge all round");
    assert_eq!(found, Rim { mixed_px: 0.0, crossings: CROSSINGS });
}

#[test]
fn mixed_pixels_are_counted_and_lost_ones_are_not() {
    // From the board to the wall in four steps, three of them in between.
    let mixed = |away: usize| (away <= 3).then_some(BOARD_M + 0.3 * away as f64);
    let found = rim(mixed).1.expect("an edge all round");
    assert_eq!(found, Rim { mixed_px: 3.0, crossings: CROSSINGS });
    let lost = rim(|away| (away <= 3).then_some(0.0)).1.expect("an edge all round");
    assert_eq!(lost.mixed_px, 0.0);
}

#[test]
fn without_anything_behind_there_is_no_edge() {
    assert_eq!(rim(|_| Some(0.0)).1, None, "nothing is measured behind");
    assert_eq!(rim(|_| Some(BOARD_M)).1, None, "the same plane goes on");
    assert_eq!(rim(|_| Some(0.8)).1, None, "what is in front is not behind");
}

fn views(mixed_px: &[f64]) -> Vec<Field> {
    let (field, _) = rim(|_| None);
    let of = |&mixed_px: &f64| Field {
        rim: Some(Rim { mixed_px, crossings: CROSSINGS }),
        ..field.clone()
    };
    mixed_px.iter().map(of).collect()
}

#[test]
fn mixing_is_told_when_the_views_agree_on_it() {
    let found = mixing(&views(&[2.8, 3.1, 3.0, 2.9, 3.2]), 1e-3).expect("a mixed edge");
    assert_eq!(found.families, ["edge-mixing"]);
    let width = &found.parameters["width_px"];
    let [value, error] = ["value", "std_error"].map(|k| width[k].as_f64().unwrap());
    assert!((value - 3.0).abs() < 1e-9, "the mean of the five: {value}");
    // Standard deviation 0.158 over the root of five.
    assert!((error - 0.0707).abs() < 1e-3, "{error}");
    assert!(mixing(&views(&[0.0; 5]), 1e-3).is_none());
    assert!(mixing(&views(&[0.0, 0.0, 0.0, 9.0, 0.0]), 1e-3).is_none(), "one view is a stray");
    assert!(mixing(&views(&[3.0, 3.1]), 1e-3).is_none(), "two views are no rule");
    assert!(mixing(&[], 1e-3).is_none());
}
