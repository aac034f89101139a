//! What is known about an effect before it acts.

use serde::Serialize;

use crate::sensors::SensorKind;

/// Where in the light's path an effect acts, in order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub enum Stage {
    /// The target's shape and motion: changes `depth`.
    Surface,
    /// What a pixel looks at: changes `depth`.
    Optics,
    /// How noisy a pixel is, and the light that makes it so: changes `sigma` and `light`.
    Variance,
    /// How the noise hangs together over frames: changes `noise`, of unit variance.
    NoiseInTime,
    /// The part of the noise that stands still: changes `noise`, of unit variance.
    NoiseAtRest,
    /// How neighbours share their noise: changes `noise`, of unit variance.
    NoiseInSpace,
    /// How far single pixels stray: changes `noise`.
    NoiseTails,
    /// Errors of the match: changes `disparity`, px.
    Disparity,
    /// Pixels without an answer: `disparity` becomes NaN.
    #[serde(rename = "Missing")]
    Dropout,
    /// The read-out of the match: rounds and shifts `disparity`.
    Quantiser,
    /// What the driver makes of it: changes `depth`.
    Driver,
    /// The stored number: rounds `depth`.
    Word,
}

impl Stage {
    pub const ALL: [Stage; 12] = [
        Stage::Surface,
        Stage::Optics,
        Stage::Variance,
        Stage::NoiseInTime,
        Stage::NoiseAtRest,
        Stage::NoiseInSpace,
        Stage::NoiseTails,
        Stage::Disparity,
        Stage::Dropout,
        Stage::Quantiser,
        Stage::Driver,
        Stage::Word,
    ];
}

/// A knob.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// As given on the command line; it ends with the unit.
    pub name: &'static str,
    pub unit: &'static str,
    /// What is accepted.
    pub range: [f64; 2],
    /// A typical size; used where the user names none.
    pub typical: f64,
    pub summary: &'static str,
}

/// Values of an effect's parameters, in the card's order.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings(pub(super) Vec<f64>);

impl Settings {
    pub fn typical(card: &Card) -> Self {
        Settings(card.parameters.iter().map(|p| p.typical).collect())
    }

    /// The value of the card's parameter number `index`.
    pub fn at(&self, index: usize) -> f64 {
        self.0[index]
    }

    /// The value of the card's parameter of this name.
    pub fn named(&self, card: &Card, name: &str) -> Option<f64> {
        let index = card.parameters.iter().position(|p| p.name == name)?;
        self.0.get(index).copied()
    }
}

/// The face of an effect for people and for the command line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Card {
    pub id: &'static str,
    /// What it is called in the middle of a sentence.
    pub title: &'static str,
    pub stage: Stage,
    /// What it does, one sentence.
    pub summary: &'static str,
    /// The first is the strength.
    pub parameters: &'static [Parameter],
    /// The cameras that it can happen to.
    pub kinds: &'static [SensorKind],
    /// The strength at which nature is as if the effect were not there.
    pub identity: f64,
    pub statistic: &'static str,
    pub axis: &'static str,
    /// The effects it is taken for most easily, by id, and what distinguishes them.
    pub confused_with: &'static str,
    pub reference: &'static str,
    /// May it be a symptom of another cause where a recording is held against a simulation? Light,
    /// blur and window of a matcher change it.
    pub is_symptom: bool,
    /// With another formula of the same physics its parameters come out different by this share
    /// (measured on ray-traced recordings).
    pub formula_error: f64,
}

impl Card {
    /// What most effects have in common; the rest is each card's own.
    pub const BASE: Card = Card {
        id: "",
        title: "",
        stage: Stage::Surface,
        summary: "",
        parameters: &[],
        kinds: SensorKind::ALL,
        identity: 0.0,
        statistic: "",
        axis: "",
        confused_with: "",
        reference: "",
        is_symptom: false,
        formula_error: 0.0,
    };

    /// Can it happen to a camera of this kind? To one that is not known all can.
    pub fn applies_to(&self, kind: Option<SensorKind>) -> bool {
        kind.is_none_or(|kind| self.kinds.contains(&kind))
    }
}
