//! The card of an effect: its fixed properties and its parameters.

use serde::Serialize;

use super::USUAL_PX;
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
    /// Correlation of the noise over frames: changes `noise`, of unit variance.
    NoiseInTime,
    /// The static part of the noise: changes `noise`, of unit variance.
    NoiseAtRest,
    /// Correlation of the noise between neighbours: changes `noise`, of unit variance.
    NoiseInSpace,
    /// Tails of the noise distribution: changes `noise`.
    NoiseTails,
    /// Errors of the match: changes `disparity`, px.
    Disparity,
    /// Pixels without a match: `disparity` becomes NaN.
    #[serde(rename = "Missing")]
    Dropout,
    /// The read-out of the match: rounds and shifts `disparity`.
    Quantiser,
    /// Conversion by the driver: changes `depth`.
    Driver,
    /// The stored value: rounds `depth`.
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

/// A parameter of an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// As given on the command line; it ends with the unit.
    pub name: &'static str,
    /// Accepted values.
    pub range: [f64; 2],
    /// Typical value, used where the user gives none.
    pub typical: f64,
    pub summary: &'static str,
}

impl Parameter {
    /// Unit, as the name ends with it; empty where it is a number.
    pub fn unit(&self) -> &'static str {
        match self.name.rsplit_once('_') {
            Some((_, "mps")) => "m/s",
            Some((_, unit @ ("px" | "m" | "s" | "deg"))) => unit,
            _ => "",
        }
    }
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
}

/// Description of an effect, for people and the command line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Card {
    pub id: &'static str,
    /// Name within a sentence.
    pub title: &'static str,
    pub stage: Stage,
    /// What it does, one sentence.
    pub summary: &'static str,
    /// The first is the strength.
    pub parameters: &'static [Parameter],
    /// Kinds of camera that it can affect.
    pub kinds: &'static [SensorKind],
    /// Strength at which the effect does nothing.
    pub identity: f64,
    pub statistic: &'static str,
    pub axis: &'static str,
    /// The effects most easily confused with it, by id, and what distinguishes them.
    pub confused_with: &'static str,
    pub reference: &'static str,
    /// Whether it may be a symptom of another cause when a recording is compared with a simulation: light,
    /// blur and window of a matcher change it.
    pub is_symptom: bool,
    /// Relative error of its parameters when a sensor follows another formula of the same physics (measured
    /// on ray-traced recordings).
    pub formula_error: f64,
    /// Prior standard deviation of a shape's coefficients, in their unit.
    pub usual: f64,
    /// Least share of the best unnamed curve's gain that it must reach, where that is lower than for other
    /// effects.
    pub must_explain: Option<f64>,
    /// Whether the axis that it follows was measured independently; it then wins ties.
    pub rests_on_a_measurement: bool,
}

impl Card {
    /// Defaults shared by most effects.
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
        usual: USUAL_PX,
        must_explain: None,
        rests_on_a_measurement: false,
    };

    /// Whether it can affect a camera of this kind; true where the kind is not known.
    pub fn applies_to(&self, kind: Option<SensorKind>) -> bool {
        kind.is_none_or(|kind| self.kinds.contains(&kind))
    }
}
