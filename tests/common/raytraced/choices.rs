//! Random choices where an order leaves them open; what each effect needs of a session; effects by name.

use rand::Rng;
use rand::seq::IndexedRandom;

use super::kernels::{Window, lot};
use super::outside::OUTSIDE;
use super::poses::{Marked, Session};
use super::set::Order;
use super::{Cause, Cell, Draw, Unit, causes_bias, causes_noise, outside};
use kinoise::error::{Error, Result};
use kinoise::rng::Stream;

/// Ids of the library's effects, in the catalogue's order.
pub const CATALOGUE: [&str; 29] = [
    "disparity-quantisation",
    "depth-rounding",
    "pixel-locking",
    "column-banding",
    "radial-disparity-bias",
    "lens-distortion",
    "range-not-depth",
    "depth-scale",
    "disparity-offset",
    "thermal-drift",
    "target-bow",
    "target-motion",
    "fixed-pattern-noise",
    "edge-mixing",
    "range-exponent",
    "slope-noise",
    "tilt-axis-anisotropy",
    "vignetting",
    "intensity-dependent-noise",
    "ambient-light",
    "heavy-tails",
    "spatial-correlation",
    "temporal-correlation",
    "frozen-noise",
    "row-noise",
    "frame-jitter",
    "grazing-dropout",
    "range-dropout",
    "occlusion-shadow",
];

const EDGED: [&str; 2] = ["edge-mixing", "occlusion-shadow"];

/// Effects that only reference distances show.
const BLIND: [&str; 3] = ["depth-scale", "disparity-offset", "thermal-drift"];

/// Groups for pairs and triples: effects of different groups do not hide one another.
const PAIRED: [&[&str]; 5] = [
    &["pixel-locking", "column-banding", "radial-disparity-bias", "lens-distortion"],
    &["range-exponent", "slope-noise", "vignetting", "tilt-axis-anisotropy"],
    &["spatial-correlation", "row-noise", "frame-jitter", "temporal-correlation"],
    &["heavy-tails"],
    &["grazing-dropout", "range-dropout"],
];

/// Pairs that look alike until their axes are told apart.
const MIMICS: [[&str; 2]; 9] = [
    ["radial-disparity-bias", "lens-distortion"],
    ["radial-disparity-bias", "target-bow"],
    ["pixel-locking", "column-banding"],
    ["vignetting", "tilt-axis-anisotropy"],
    ["range-exponent", "ambient-light"],
    ["slope-noise", "range-exponent"],
    ["frozen-noise", "fixed-pattern-noise"],
    ["heavy-tails", "vignetting"],
    ["grazing-dropout", "range-dropout"],
];

/// Effects that still show, and that a session can have, in some views only: interference, vibration, a
/// frame sent again, a filter left on, another board, surface, background or light.
pub const BY_VIEW: [&str; 19] = [
    "pixel-locking",
    "column-banding",
    "radial-disparity-bias",
    "target-bow",
    "target-motion",
    "fixed-pattern-noise",
    "edge-mixing",
    "slope-noise",
    "tilt-axis-anisotropy",
    "vignetting",
    "heavy-tails",
    "spatial-correlation",
    "temporal-correlation",
    "frozen-noise",
    "row-noise",
    "frame-jitter",
    "grazing-dropout",
    "range-dropout",
    "occlusion-shadow",
];
/// The same for far distances, in every view only where it sees them.
const BY_DISTANCE: [&str; 5] = [
    "pixel-locking",
    "column-banding",
    "radial-disparity-bias",
    "vignetting",
    "tilt-axis-anisotropy",
];
/// The same for a region: half a chip's amplifiers, a lens that is sharp on one side.
const BY_REGION: [&str; 7] = [
    "pixel-locking",
    "column-banding",
    "fixed-pattern-noise",
    "edge-mixing",
    "vignetting",
    "range-exponent",
    "range-dropout",
];
/// The same for late times: what warms up, comes loose, fades or is switched on.
pub const BY_TIME: [&str; 16] = [
    "pixel-locking",
    "column-banding",
    "radial-disparity-bias",
    "target-motion",
    "fixed-pattern-noise",
    "edge-mixing",
    "range-exponent",
    "slope-noise",
    "vignetting",
    "heavy-tails",
    "spatial-correlation",
    "temporal-correlation",
    "frozen-noise",
    "row-noise",
    "frame-jitter",
    "range-dropout",
];

pub fn names(order: &Order, rng: &mut Stream) -> Vec<String> {
    if !order.effects.is_empty() || matches!(order.cell, Cell::Null | Cell::Drift) {
        return order.effects.clone();
    }
    let one =
        |list: &[&str], rng: &mut Stream| list.choose(rng).map_or(String::new(), |n| (*n).into());
    match order.cell {
        Cell::Single => vec![one(&CATALOGUE, rng)],
        Cell::Outside => vec![one(&OUTSIDE, rng)],
        Cell::Blind | Cell::Referenced => vec![one(&BLIND, rng)],
        Cell::FewViews => vec![one(&BY_VIEW, rng)],
        Cell::Far => vec![one(&BY_DISTANCE, rng)],
        Cell::Region => vec![one(&BY_REGION, rng)],
        Cell::Late => vec![one(&BY_TIME, rng)],
        Cell::Mimic => lot(&MIMICS, rng).map(String::from).to_vec(),
        cell => {
            let many = if cell == Cell::Triple { 3 } else { 2 };
            PAIRED.choose_multiple(rng, many).map(|group| one(group, rng)).collect()
        }
    }
}

fn any(names: &[String], of: &[&str]) -> bool {
    names.iter().any(|n| of.contains(&n.as_str()))
}

pub fn units_per_metre(names: &[String], rng: &mut Stream) -> f64 {
    let coarse =
        rng.random::<f64>() < 0.25 && !any(names, &["depth-rounding", "disparity-quantisation"]);
    if coarse { 1000.0 } else { 5000.0 }
}

pub fn session(order: &Order, names: &[String], rng: &mut Stream) -> Session {
    let edged = any(names, &EDGED);
    let boarded = edged || any(names, &["target-bow", "dirty-board"]);
    let steep = any(names, &["grazing-dropout"]);
    let leaning = any(names, &["slope-noise", "tilt-axis-anisotropy", "lens-distortion"]);
    let on_board = boarded || steep || rng.random::<f64>() < if leaning { 0.75 } else { 0.5 };
    let half = on_board.then(|| [rng.random_range(0.5..0.7), rng.random_range(0.4..0.5)]);
    let marked = lot(&[Marked::Nothing, Marked::Nothing, Marked::Outline, Marked::Rectangle], rng);
    let references = any(names, &BLIND) || rng.random::<f64>() < 0.25;
    let gap_m = if any(names, &["occlusion-shadow"]) {
        0.8 * order.strength.powf(1.3)
    } else {
        rng.random_range(0.6..2.0)
    };
    Session {
        views: order.views.unwrap_or_else(|| rng.random_range(10..=24)),
        frames: order.frames.unwrap_or(4),
        half,
        gap_m,
        steepest: if steep { 74f64 } else { 65.0 }.to_radians(),
        region: if edged {
            Marked::Nothing
        } else if boarded {
            Marked::Outline
        } else {
            marked
        },
        reference_m: (references && order.cell != Cell::Blind).then_some(0.001),
        conditions: any(names, &["ambient-light", "warm-noise"]) || rng.random::<f64>() < 0.3,
    }
}

/// Noise correlation that the model knows of, if any.
pub fn window(order: &Order, names: &[String], rng: &mut Stream) -> Option<Cause> {
    let own = any(names, &["spatial-correlation", "slope-noise", "heavy-tails"]);
    let chance = if order.cell == Cell::Null { 0.5 } else { 0.2 };
    if rng.random::<f64>() >= chance || own {
        return None;
    }
    let side = lot(&[3.0, 5.0, 7.0, 9.0], rng);
    let flat = "flat window";
    let form = lot(&[flat, flat, flat, "gaussian window", "triangular window"], rng);
    let window = match form {
        "gaussian window" => Window::bell(side),
        "triangular window" => Window::tent(side),
        _ => Window::flat(side),
    };
    Some(causes_noise::windowed(form, window, 1.0))
}

/// Changes the unit's sigma, so that it is no longer what its model says.
pub fn age(unit: &mut Unit, strength: f64, rng: &mut Stream) {
    let change = 0.25 * strength;
    let factor = if rng.random::<bool>() { 1.0 + change } else { 1.0 / (1.0 + change) };
    unit.sigma[1] *= factor;
    unit.sigma[0] *= factor.powf(rng.random_range(-0.5..1.0));
}

/// The cause of this name. What is drawn from `rng` does not depend on the strength.
pub fn cause(name: &str, of: &Draw<'_>, rng: &mut Stream) -> Result<Cause> {
    causes_bias::cause(name, of, rng)
        .or_else(|| causes_noise::cause(name, of, rng))
        .or_else(|| outside::cause(name, of, rng))
        .ok_or_else(|| Error::Argument {
            what: format!("no effect is called \"{name}\""),
            remedy: "take one that `kinoise effects` lists, or one of those outside the catalogue",
        })
}
