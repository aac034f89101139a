//! Contents of a set, drawn at random from its order.

use rand::Rng;
use serde_json::{Value, json};

use super::choices::{age, cause, names, session, units_per_metre, window};
use super::confine::Gate;
use super::eye::World;
use super::kernels::{lot, seed_of};
use super::poses::{Plan, Session};
use super::question::{Asked, Hidden};
use super::{Cause, Cell, Draw, Unit};
use kinoise::error::{Error, Result};
use kinoise::io::sha256_hex;
use kinoise::model::{Effect, NoiseModel};
use kinoise::rng::{Seed, Stream};

/// What is asked for.
#[derive(Debug, Clone)]
pub struct Order {
    pub cell: Cell,
    /// From the catalogue or outside it; chosen at random where empty. Two for a pair.
    pub effects: Vec<String>,
    /// 1 is the middle of what real units show.
    pub strength: f64,
    pub seed: u64,
    pub views: Option<usize>,
    pub frames: Option<usize>,
    pub small: bool,
}

/// A recording to be taken, and its concealed truth.
pub struct Set {
    /// Reveals nothing.
    pub name: String,
    pub order: Order,
    pub unit: Unit,
    /// The unit as the model file describes it, which may be wrong.
    pub described: Unit,
    /// First those that the model knows, then the concealed ones.
    pub causes: Vec<Cause>,
    pub known_causes: usize,
    pub plans: Vec<Plan>,
    /// Bits per pixel of the infrared images; `None` without them.
    pub infrared_bits: Option<u8>,
    /// Whether grey patches are printed on the board.
    pub printed: bool,
    pub seed: Seed,
    pub session: Session,
    /// One for each cause after the known ones; the unit's ageing, where that is all.
    pub concealed: Vec<Concealed>,
    gate: Option<Gate>,
}

/// A cause that the model does not know.
#[derive(Debug, Clone)]
pub struct Concealed {
    name: String,
    /// State of the random stream, so that it can be drawn again at another strength.
    start: Stream,
    pub strength: f64,
    /// What knowing it is worth; `None` where that was not asked or cannot be said.
    pub nats: Option<f64>,
}

impl Set {
    /// Draws a set from the order's seed, at the order's strength.
    pub fn draw(order: Order) -> Result<Self> {
        let Order { cell, effects, strength, seed, .. } = &order;
        let text = format!("{cell:?}/{effects:?}/{strength}/{seed}");
        let width = if order.small { 320 } else { 640 };
        Self::of(order, width, &text)
    }

    /// The set that is `asked`, with the strength that is worth the nats asked for. Views and frames
    /// are drawn where not given. The same seed gives the same recording except for the strength of
    /// what is concealed.
    pub fn asked(asked: &Asked, views: Option<usize>, frames: Option<usize>) -> Result<Self> {
        let Asked { cell, seed, small, .. } = *asked;
        if matches!(cell, Cell::Amnesia | Cell::Halves) {
            return Err(Error::Argument {
                what: format!("the raytraced world has no cell {cell:?}"),
                remedy: "take that of real recordings",
            });
        }
        let text = format!("sealed/{cell:?}/{:?}/{seed}/{small}", asked.names);
        let effects = asked.names.clone();
        let order = Order { cell, effects, strength: 1.0, seed, views, frames, small };
        let mut set = Set::of(order, if small { 160 } else { 320 }, &text)?;
        set.name = sha256_hex(format!("opaque {text}/{:?}", asked.nats).as_bytes())[..10].into();
        // What cannot be seen has no strength at which it is seen.
        set.weigh(asked.nats.filter(|_| cell != Cell::Blind))?;
        Ok(set)
    }

    /// Draws a set from `text`; its images are `width` px wide.
    fn of(order: Order, width: usize, text: &str) -> Result<Self> {
        let digest = sha256_hex(text.as_bytes());
        let seed = seed_of(&digest);
        let mut rng = seed.stream("rays/set");
        let (cell, strength) = (order.cell, order.strength);
        let names = names(&order, &mut rng);
        let units_per_metre = units_per_metre(&names, &mut rng);
        let described = Unit::draw(width, units_per_metre, &mut rng);
        let mut unit = described.clone();
        let conceal = |name: &str, rng: &Stream| {
            let (name, start) = (name.to_string(), rng.clone());
            Concealed { name, start, strength, nats: None }
        };
        let mut concealed = Vec::new();
        if cell == Cell::Drift {
            concealed.push(conceal("", &rng));
            age(&mut unit, strength, &mut rng);
        }
        let session = session(&order, &names, &mut rng);
        let mut causes: Vec<Cause> = window(&order, &names, &mut rng).into_iter().collect();
        let known_causes = causes.len();
        for name in &names {
            concealed.push(conceal(name, &rng));
            let half_m = session.half_m();
            let draw = Draw { strength, shadow: 1.0, unit: &unit, half_m, seed };
            causes.push(cause(name, &draw, &mut rng)?);
        }
        let by_print = names.iter().any(|n| n == "intensity-dependent-noise");
        let lit = by_print || names.iter().any(|n| n == "ambient-light");
        let infrared_bits = (lit || rng.random::<f64>() < 0.2).then(|| lot(&[8, 16], &mut rng));
        let printed = by_print || infrared_bits.is_some() && rng.random::<bool>();
        let plans = session.draw(&unit, &mut rng);
        let gate = Gate::draw(cell, &plans, &unit, &causes[known_causes..], &mut rng);
        if let Some(gate) = &gate {
            for cause in causes.split_off(known_causes) {
                causes.push(gate.confine(cause)?);
            }
        }
        let name = sha256_hex(format!("opaque {digest}").as_bytes())[..10].into();
        Ok(Set {
            name,
            order,
            unit,
            described,
            causes,
            known_causes,
            plans,
            infrared_bits,
            printed,
            seed,
            session,
            concealed,
            gate,
        })
    }

    /// The `k`th concealed cause at another strength.
    pub fn at_strength(&self, k: usize, strength: f64) -> Result<Cause> {
        let Concealed { name, start, .. } = &self.concealed[k];
        let (shadow, half_m) = (strength.min(1.0), self.session.half_m());
        let draw = Draw { strength, shadow, unit: &self.unit, half_m, seed: self.seed };
        let cause = cause(name, &draw, &mut start.clone())?;
        match &self.gate {
            Some(gate) => gate.confine(cause),
            None => Ok(cause),
        }
    }

    /// The described unit, aged by `strength`.
    pub fn aged(&self, strength: f64) -> Unit {
        let mut unit = self.described.clone();
        age(&mut unit, strength, &mut self.concealed[0].start.clone());
        unit
    }

    /// The world in which only the known causes act.
    pub fn world(&self) -> World<'_> {
        World {
            unit: &self.unit,
            causes: &self.causes[..self.known_causes],
            printed: self.printed,
            edged: self.causes.iter().any(|c| c.label.axis == "edge-distance"),
        }
    }

    /// Model file of the unit: what is known of it.
    pub fn model(&self) -> Result<NoiseModel> {
        let known = self.causes[..self.known_causes].iter().map(|cause| Effect {
            id: cause.label.names[0].clone(),
            parameters: cause.label.parameters.clone(),
            ..Effect::default()
        });
        self.described.model(known.collect())
    }

    /// What the model does not know.
    pub fn hidden(&self) -> Vec<Hidden> {
        let mut all: Vec<Hidden> =
            self.causes[self.known_causes..].iter().map(|cause| cause.label.clone()).collect();
        if self.order.cell == Cell::Drift {
            let mut aged = Hidden::new(&[], "recalibrate", ["variance", "z"]);
            aged.parameters.insert("sigma".into(), json!(self.unit.sigma));
            all.push(aged);
        }
        all.iter_mut().zip(&self.concealed).for_each(|(hidden, c)| hidden.nats = c.nats);
        all
    }

    /// The answer and how the set was made.
    pub fn truth(&self) -> Value {
        let hidden = self.hidden();
        let effects = hidden.iter().zip(&self.concealed).map(|(hidden, concealed)| {
            let mut all = written(hidden);
            all["nats"] = json!(concealed.nats);
            all["strength"] = json!(concealed.strength);
            all
        });
        json!({
            "name": self.name, "cell": self.order.cell, "strength": self.order.strength,
            "seed": self.order.seed, "effects": effects.collect::<Vec<_>>(), "base": self.base(),
            "views": self.plans.iter().map(|p| json!({
                "z_m": p.stage.board.depth(0.0, 0.0), "theta_rad": p.stage.theta,
                "azimuth_rad": p.stage.azimuth, "session_s": p.session_s, "lux": p.lux,
                "temperature_c": p.temperature_c,
            })).collect::<Vec<_>>(),
        })
    }

    /// How the recording was made.
    pub fn base(&self) -> Value {
        let known = &self.causes[..self.known_causes];
        let notes = self.plans.first().map(|p| &p.notes);
        json!({
            "known": known.iter().map(|c| written(&c.label)).collect::<Vec<_>>(),
            "strengths": self.concealed.iter().map(|c| c.strength).collect::<Vec<_>>(),
            "confined": self.gate.as_ref().map(|gate| format!("{gate:?}")),
            "sigma": self.described.sigma,
            "views": self.plans.len(),
            "frames": self.plans.first().map(|p| p.stamps.len()),
            "units_per_metre": self.unit.units_per_metre(),
            "wall": self.plans.first().is_some_and(|p| p.stage.board.half.is_none()),
            "reference": notes.is_some_and(|n| n.reference_distance_m.is_some()),
            "region": notes.is_some_and(|n| n.region.is_some()),
            "infrared_bits": self.infrared_bits, "printed": self.printed,
        })
    }
}

fn written(hidden: &Hidden) -> Value {
    json!({
        "id": hidden.names.first(), "form": hidden.form, "statistic": hidden.statistic,
        "axis": hidden.axis, "also": hidden.also, "interval": hidden.interval,
        "parameters": hidden.parameters,
    })
}
