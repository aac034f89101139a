//! What goes into a set: drawn at random from its order.

use rand::Rng;
use serde_json::{Value, json};

use super::causes_bias::lot;
use super::choices::{age, cause, names, session, window, words};
use super::eye::World;
use super::gate::Gate;
use super::poses::{Plan, Session};
use super::weigh::Concealed;
use super::{Cause, Cell, Unit};
use kinoise::error::Result;
use kinoise::io::sha256_hex;
use kinoise::model::Effect;
use kinoise::rng::{Seed, Stream};

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
    pub known: Vec<Effect>,
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
    pub(super) session: Session,
    /// One for each cause after the known; the ageing of the unit, where that is all.
    pub(super) concealed: Vec<Concealed>,
    pub(super) gate: Option<Gate>,
}

impl Set {
    /// Drawn from the order's seed.
    ///
    /// # Errors
    /// When an effect is asked for that does not exist.
    pub fn draw(order: Order) -> Result<Self> {
        let text =
            format!("{:?}/{:?}/{}/{}", order.cell, order.effects, order.strength, order.seed);
        let width = if order.small { 320 } else { 640 };
        Self::of(order, width, &text)
    }

    /// Drawn from `text`; the picture is `width` px wide.
    pub(super) fn of(order: Order, width: usize, text: &str) -> Result<Self> {
        let digest = sha256_hex(text.as_bytes());
        let seed = Seed(u64::from_str_radix(&digest[..16], 16).unwrap_or(order.seed));
        let mut rng = seed.stream("rays/set");
        let names = names(&order, &mut rng);
        let units_per_metre = words(&names, &mut rng);
        let described = Unit::draw(width, units_per_metre, &mut rng);
        let mut unit = described.clone();
        let conceal = |name: &str, rng: &Stream| Concealed {
            name: name.into(),
            start: rng.clone(),
            strength: order.strength,
            nats: None,
        };
        let mut concealed = Vec::new();
        if order.cell == Cell::Drift {
            concealed.push(conceal("", &rng));
            age(&mut unit, order.strength, &mut rng);
        }
        let session = session(&order, &names, &mut rng);
        let window = window(&order, &names, &mut rng);
        let known = window.iter().map(known).collect();
        let known_causes = usize::from(window.is_some());
        let mut causes: Vec<Cause> = window.into_iter().collect();
        for name in &names {
            concealed.push(conceal(name, &rng));
            let strength = [order.strength, 1.0];
            causes.push(cause(name, strength, &unit, &session, seed, &mut rng)?);
        }
        let lit = names
            .iter()
            .any(|n| ["intensity-dependent-noise", "ambient-light"].contains(&n.as_str()));
        let infrared_bits = (lit || rng.random::<f64>() < 0.2).then(|| lot(&[8, 16], &mut rng));
        let by_print = names.iter().any(|n| n == "intensity-dependent-noise");
        let printed = by_print || infrared_bits.is_some() && rng.random::<bool>();
        let plans = session.draw(&unit, &mut rng);
        let gate = Gate::draw(order.cell, &plans, &unit, &mut rng);
        let mut set = Set {
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
            session,
            concealed,
            gate,
        };
        if let Some(gate) = set.gate.clone() {
            let free = set.causes.split_off(known_causes);
            for cause in free {
                set.causes.push(gate.confine(cause)?);
            }
        }
        Ok(set)
    }

    /// What looks where only the known causes act.
    pub(super) fn world(&self) -> World<'_> {
        World {
            unit: &self.unit,
            causes: &self.causes[..self.known_causes],
            printed: self.printed,
            edged: self.causes.iter().any(|c| c.label.axis == "edge-distance"),
        }
    }

    /// What is sealed: the answer, and how it was made.
    pub fn truth(&self) -> Value {
        let nats = self.concealed.iter().map(|c| json!({"nats": c.nats, "strength": c.strength}));
        let effect = |(cause, nats): (&Cause, Value)| {
            let mut all = json!(cause.label);
            all["nats"] = nats["nats"].clone();
            all["strength"] = nats["strength"].clone();
            all
        };
        let mut effects: Vec<Value> =
            self.causes[self.known_causes..].iter().zip(nats).map(effect).collect();
        if self.order.cell == Cell::Drift {
            effects.push(
                json!({"id": null, "form": "recalibrate", "statistic": "variance", "axis": "z",
                "also": [], "interval": null, "parameters": {"sigma": self.unit.sigma},
                "nats": self.concealed[0].nats, "strength": self.concealed[0].strength}),
            );
        }
        json!({
            "name": self.name, "cell": self.order.cell, "strength": self.order.strength,
            "seed": self.order.seed, "effects": effects, "base": self.base(),
            "views": self.plans.iter().map(|p| json!({
                "z_m": p.stage.board.depth(0.0, 0.0), "theta_rad": p.stage.theta, "azimuth_rad": p.stage.azimuth,
                "session_s": p.session_s, "lux": p.lux, "temperature_c": p.temperature_c,
            })).collect::<Vec<_>>(),
        })
    }

    /// How the recording was taken.
    pub(super) fn base(&self) -> Value {
        let notes = self.plans.first().map(|p| &p.notes);
        json!({
            "known": self.causes[..self.known_causes].iter().map(|c| json!(c.label)).collect::<Vec<_>>(),
            "strengths": self.concealed.iter().map(|c| c.strength).collect::<Vec<_>>(),
            "confined": self.gate.as_ref().map(|gate| format!("{gate:?}")),
            "sigma": self.described.sigma,
            "views": self.plans.len(),
            "frames": self.plans.first().map(|p| p.stamps.len()),
            "units_per_metre": super::shoot::units(&self.unit),
            "wall": self.plans.first().is_some_and(|p| p.stage.board.half.is_none()),
            "reference": notes.is_some_and(|n| n.reference_distance_m.is_some()),
            "region": notes.is_some_and(|n| n.region.is_some()),
            "infrared_bits": self.infrared_bits, "printed": self.printed,
        })
    }
}

fn known(cause: &Cause) -> Effect {
    Effect {
        id: "spatial-correlation".into(),
        parameters: cause.label.parameters.clone(),
        ..Effect::default()
    }
}
