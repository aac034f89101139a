//! What is known about an effect before it acts.

/// Where in the light's path an effect acts, in order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// The target's shape and motion: changes `depth`.
    Surface,
    /// Lens and light: changes `depth` (which ray a pixel has) and `light`.
    Optics,
    /// How noisy a pixel is: changes `sigma`.
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
    Missing,
    /// The read-out of the match: rounds `disparity`.
    Quantiser,
    /// What the driver makes of it: changes `depth`.
    Driver,
}

impl Stage {
    pub const ALL: [Stage; 11] = [
        Stage::Surface,
        Stage::Optics,
        Stage::Variance,
        Stage::NoiseInTime,
        Stage::NoiseAtRest,
        Stage::NoiseInSpace,
        Stage::NoiseTails,
        Stage::Disparity,
        Stage::Missing,
        Stage::Quantiser,
        Stage::Driver,
    ];
}

/// A knob.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// With its unit, as in effects.md.
    pub name: &'static str,
    pub unit: &'static str,
    /// What is accepted.
    pub range: [f64; 2],
    /// A typical size; used where the user names none.
    pub typical: f64,
    pub words: &'static str,
}

/// The face of an effect for people and for the command line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Card {
    pub id: &'static str,
    pub stage: Stage,
    /// What was left out when it is missing, one sentence.
    pub words: &'static str,
    /// The first is the strength: at zero the effect does nothing.
    pub parameters: &'static [Parameter],
    pub statistic: &'static str,
    pub axis: &'static str,
    /// Ids of the effects it is taken for most easily, and what tells them apart.
    pub confused_with: &'static str,
    pub reference: &'static str,
}
