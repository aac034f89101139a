//! What could be missing: a shape with, or without, the name of its cause.

use crate::terms::Basis;

/// A term that is tried.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Id of effects.md; `None` for a curve without a name.
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
}
