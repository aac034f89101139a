//! What goes into a set: drawn at random from its order.

use rand::Rng;
use rand::seq::IndexedRandom;
use serde_json::json;

use super::causes_bias as bias;
use super::causes_driver as driver;
use super::causes_missing as missing;
use super::causes_noise as noise;
use super::causes_variance as variance;
use super::kernels::Window;
use super::outside::{OUTSIDE, outside};
use super::poses::{Plan, Session, Told};
use super::{Cause, Unit};
use crate::error::{Error, Result};
use crate::io::sha256_hex;
use crate::model::ModelEffect;
use crate::rng::{Seed, Stream};

/// Ids of effects.md, in its order.
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

/// What only reference distances show.
const BLIND: [&str; 3] = ["depth-scale", "disparity-offset", "thermal-drift"];

/// One of each kind for pairs that do not hide one another.
const PAIRED: [&[&str]; 5] = [
    &["pixel-locking", "column-banding", "radial-disparity-bias", "lens-distortion"],
    &["range-exponent", "slope-noise", "vignetting", "tilt-axis-anisotropy"],
    &["spatial-correlation", "row-noise", "frame-jitter", "temporal-correlation"],
    &["heavy-tails"],
    &["grazing-dropout", "range-dropout"],
];

/// What kind of question a set puts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Cell {
    Null,
    Single,
    Pair,
    Outside,
    Blind,
    Drift,
}

impl std::str::FromStr for Cell {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        serde_json::from_value::<String>(json!(text))
            .ok()
            .and_then(|t| match t.as_str() {
                "null" => Some(Cell::Null),
                "single" => Some(Cell::Single),
                "pair" => Some(Cell::Pair),
                "outside" => Some(Cell::Outside),
                "blind" => Some(Cell::Blind),
                "drift" => Some(Cell::Drift),
                _ => None,
            })
            .ok_or_else(|| format!("no cell is called \"{text}\""))
    }
}

/// What is asked for.
#[derive(Debug, Clone)]
pub struct Order {
    pub cell: Cell,
    /// Of the catalogue or from outside it; by lot where none is named. Two, for a pair.
    pub effects: Vec<String>,
    /// 1 is the middle of what real units show.
    pub strength: f64,
    pub seed: u64,
    pub views: Option<usize>,
    pub frames: Option<usize>,
    pub small: bool,
}

/// A recording to be taken, and its sealed truth.
pub struct Set {
    /// Says nothing.
    pub name: String,
    pub order: Order,
    pub unit: Unit,
    /// What the model file says, which may be wrong.
    pub described: Unit,
    pub known: Vec<ModelEffect>,
    /// Known and concealed, in no order.
    pub causes: Vec<Cause>,
    /// The first so many are known to the model.
    pub known_causes: usize,
    pub plans: Vec<Plan>,
    /// Bits of an infrared image.
    pub infrared_bits: Option<u8>,
    /// Patches of grey are printed on the board.
    pub printed: bool,
    pub seed: Seed,
}

impl Set {
    /// Drawn from the order's seed.
    ///
    /// # Errors
    /// When an effect is asked for that does not exist.
    pub fn draw(order: Order) -> Result<Self> {
        let text =
            format!("{:?}/{:?}/{}/{}", order.cell, order.effects, order.strength, order.seed);
        let digest = sha256_hex(text.as_bytes());
        let seed = Seed(u64::from_str_radix(&digest[..16], 16).unwrap_or(order.seed));
        let mut rng = seed.stream("rays/set");
        let names = names(&order, &mut rng);
        let units_per_metre = words(&names, &mut rng);
        let described = Unit::draw(order.small, units_per_metre, &mut rng);
        let mut unit = described.clone();
        if order.cell == Cell::Drift {
            age(&mut unit, order.strength, &mut rng);
        }
        let session = session(&order, &names, &mut rng);
        let window = window(&order, &names, &mut rng);
        let known = window.iter().map(known).collect();
        let known_causes = usize::from(window.is_some());
        let mut causes: Vec<Cause> = window.into_iter().collect();
        for name in &names {
            causes.push(cause(name, &order, &unit, &session, seed, &mut rng)?);
        }
        let lit = names
            .iter()
            .any(|n| ["intensity-dependent-noise", "ambient-light"].contains(&n.as_str()));
        let infrared_bits =
            (lit || rng.random::<f64>() < 0.2).then(|| bias::lot(&[8, 16], &mut rng));
        let by_print = names.iter().any(|n| n == "intensity-dependent-noise");
        let printed = by_print || infrared_bits.is_some() && rng.random::<bool>();
        let plans = session.draw(&unit, &mut rng);
        Ok(Set {
            name: sha256_hex(format!("opaque {digest}").as_bytes())[..10].into(),
            order,
            unit,
            described,
            known,
            causes,
            known_causes,
            plans,
            infrared_bits,
            printed,
            seed,
        })
    }

    /// What is sealed: the answer, and how it was made.
    pub fn truth(&self) -> serde_json::Value {
        let mut effects: Vec<serde_json::Value> =
            self.causes[self.known_causes..].iter().map(|c| json!(c.label)).collect();
        if self.order.cell == Cell::Drift {
            effects.push(
                json!({"id": null, "form": "recalibrate", "statistic": "variance", "axis": "z",
                "also": [], "interval": null, "parameters": {"sigma": self.unit.sigma}}),
            );
        }
        let notes = self.plans.first().map(|p| &p.notes);
        json!({
            "name": self.name, "cell": self.order.cell, "strength": self.order.strength,
            "seed": self.order.seed, "effects": effects,
            "base": {
                "known": self.causes[..self.known_causes].iter().map(|c| json!(c.label)).collect::<Vec<_>>(),
                "sigma": self.described.sigma,
                "views": self.plans.len(),
                "frames": self.plans.first().map(|p| p.stamps.len()),
                "units_per_metre": super::shoot::units(&self.unit),
                "wall": self.plans.first().is_some_and(|p| p.stage.board.half.is_none()),
                "reference": notes.is_some_and(|n| n.reference_distance_m.is_some()),
                "region": notes.is_some_and(|n| n.region.is_some()),
                "infrared_bits": self.infrared_bits, "printed": self.printed,
            },
            "views": self.plans.iter().map(|p| json!({
                "z_m": p.stage.board.depth(0.0, 0.0), "theta_rad": p.stage.theta, "azimuth_rad": p.stage.azimuth,
                "session_s": p.session_s, "lux": p.lux, "temperature_c": p.temperature_c,
            })).collect::<Vec<_>>(),
        })
    }
}

fn names(order: &Order, rng: &mut Stream) -> Vec<String> {
    if !order.effects.is_empty() || matches!(order.cell, Cell::Null | Cell::Drift) {
        return order.effects.clone();
    }
    let one =
        |list: &[&str], rng: &mut Stream| list.choose(rng).map_or(String::new(), |n| (*n).into());
    match order.cell {
        Cell::Single => vec![one(&CATALOGUE, rng)],
        Cell::Outside => vec![one(&OUTSIDE, rng)],
        Cell::Blind => vec![one(&BLIND, rng)],
        _ => PAIRED.choose_multiple(rng, 2).map(|group| one(group, rng)).collect(),
    }
}

fn any(names: &[String], of: &[&str]) -> bool {
    names.iter().any(|n| of.contains(&n.as_str()))
}

fn words(names: &[String], rng: &mut Stream) -> f64 {
    let coarse =
        rng.random::<f64>() < 0.25 && !any(names, &["depth-rounding", "disparity-quantisation"]);
    if coarse { 1000.0 } else { 5000.0 }
}

fn session(order: &Order, names: &[String], rng: &mut Stream) -> Session {
    let edged = any(names, &["edge-mixing", "occlusion-shadow"]);
    let boarded = edged || any(names, &["target-bow", "dirty-board"]);
    let steep = any(names, &["grazing-dropout"]);
    let leaning = any(names, &["slope-noise", "tilt-axis-anisotropy", "lens-distortion"]);
    let on_board = boarded || steep || rng.random::<f64>() < if leaning { 0.75 } else { 0.5 };
    let half = on_board.then(|| [rng.random_range(0.5..0.7), rng.random_range(0.4..0.5)]);
    let told = bias::lot(&[Told::Nothing, Told::Nothing, Told::Outline, Told::Rectangle], rng);
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
            Told::Nothing
        } else if boarded {
            Told::Outline
        } else {
            told
        },
        reference_m: (references && order.cell != Cell::Blind).then_some(0.001),
        conditions: any(names, &["ambient-light", "warm-noise"]) || rng.random::<f64>() < 0.3,
    }
}

/// Correlation that the model knows of.
fn window(order: &Order, names: &[String], rng: &mut Stream) -> Option<Cause> {
    let own = any(names, &["spatial-correlation", "slope-noise", "heavy-tails"]);
    let chance = if order.cell == Cell::Null { 0.5 } else { 0.2 };
    if rng.random::<f64>() >= chance || own {
        return None;
    }
    let side = bias::lot(&[3.0, 5.0, 7.0, 9.0], rng);
    let (form, window) = bias::lot(&[0, 0, 0, 1, 2], rng).pipe(|kind| match kind {
        0 => ("flat window", Window::flat(side)),
        1 => ("gaussian window", Window::bell(side)),
        _ => ("triangular window", Window::tent(side)),
    });
    Some(noise::windowed(form, window))
}

trait Pipe: Sized {
    fn pipe<T>(self, f: impl FnOnce(Self) -> T) -> T {
        f(self)
    }
}
impl Pipe for i32 {}

fn known(cause: &Cause) -> ModelEffect {
    ModelEffect { id: "spatial-correlation".into(), parameters: cause.label.parameters.clone() }
}

/// The unit is no longer what its model says.
fn age(unit: &mut Unit, strength: f64, rng: &mut Stream) {
    let change = 0.25 * strength;
    let factor = if rng.random::<bool>() { 1.0 + change } else { 1.0 / (1.0 + change) };
    unit.sigma[1] *= factor;
    unit.sigma[0] *= factor.powf(rng.random_range(-0.5..1.0));
}

fn cause(
    name: &str,
    order: &Order,
    unit: &Unit,
    session: &Session,
    seed: Seed,
    rng: &mut Stream,
) -> Result<Cause> {
    let s = order.strength;
    let half = session.half.map_or(0.6, |h| h[0]);
    Ok(match name {
        "disparity-quantisation" => driver::disparity_quantisation(s, unit, rng),
        "depth-rounding" => driver::depth_rounding(s),
        "pixel-locking" => bias::pixel_locking(s, unit, rng),
        "column-banding" => bias::column_banding(s, unit, rng),
        "radial-disparity-bias" => bias::radial_disparity_bias(s, unit, rng),
        "lens-distortion" => bias::lens_distortion(s, rng),
        "range-not-depth" => driver::range_not_depth(s),
        "depth-scale" => driver::depth_scale(s, unit, rng),
        "disparity-offset" => driver::disparity_offset(s, unit, rng),
        "thermal-drift" => driver::thermal_drift(s, rng),
        "target-bow" => bias::target_bow(s, half, rng),
        "target-motion" => bias::target_motion(s, rng),
        "fixed-pattern-noise" => bias::fixed_pattern_noise(s, unit, seed),
        "edge-mixing" => bias::edge_mixing(s, unit),
        "range-exponent" => variance::range_exponent(s, rng),
        "slope-noise" => variance::slope_noise(s, unit),
        "tilt-axis-anisotropy" => variance::tilt_axis_anisotropy(s),
        "vignetting" => variance::vignetting(s, unit, rng),
        "intensity-dependent-noise" => variance::intensity_dependent_noise(s),
        "ambient-light" => variance::ambient_light(s, rng),
        "heavy-tails" => noise::heavy_tails(s, rng),
        "spatial-correlation" => noise::spatial_correlation(s, rng),
        "temporal-correlation" => noise::temporal_correlation(s),
        "frozen-noise" => noise::frozen_noise(s),
        "row-noise" => noise::row_noise(s, unit),
        "frame-jitter" => noise::frame_jitter(s, unit, rng),
        "grazing-dropout" => missing::grazing_dropout(s, rng),
        "range-dropout" => missing::range_dropout(s, rng),
        "occlusion-shadow" => missing::occlusion_shadow(unit),
        other => outside(other, s, unit, rng).ok_or_else(|| Error::Argument {
            what: format!("no effect is called \"{other}\""),
            remedy: "take one of effects.md, or of those outside it",
        })?,
    })
}
