//! What could be missing: a shape with, or without, the name of its cause.

use crate::effects::{self, Bounds, Effect, USUAL_PX};
use crate::terms::{Basis, Statistic};

/// A term that is tried.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Id in the catalogue; `None` for a curve without a name.
    pub family: Option<&'static str>,
    pub basis: Basis,
}

/// The sigma model's own parameters: nothing is missing, they are off.
pub const RECALIBRATE: &str = "recalibrate";

impl Candidate {
    pub fn named(family: &'static str, basis: Basis) -> Self {
        Candidate { family: Some(family), basis }
    }

    pub fn curve(basis: Basis) -> Self {
        Candidate { family: None, basis }
    }

    /// All that the catalogue's effects may look like.
    pub fn of_catalogue(statistic: Statistic, bounds: &Bounds) -> Vec<Self> {
        let of = |effect: &'static dyn Effect| {
            let id = effect.card().id;
            effect.shapes(bounds).into_iter().map(move |shape| Candidate::named(id, shape))
        };
        effects::that_change(statistic).into_iter().flat_map(of).collect()
    }

    /// The cause that it is the shape of.
    pub fn effect(&self) -> Option<&'static dyn Effect> {
        effects::find(self.family?)
    }

    /// See [`Effect::usual`].
    pub fn usual(&self, k: usize) -> f64 {
        self.effect().map_or(USUAL_PX, |e| e.usual(k))
    }
}
