//! One cause on its own, for recordings that a real sensor took.

use super::choices::cause;
use super::poses::{Session, Told};
use super::{Cause, Unit};
use kinoise::error::Result;
use kinoise::rng::Seed;

pub(crate) use super::kernels::{Window, fresh, white};

/// The cause of this name at this strength; its form is drawn from `seed` and the name, and is the
/// same at every strength.
///
/// # Errors
/// When there is no such cause.
pub(crate) fn alone(name: &str, strength: f64, unit: &Unit, seed: Seed) -> Result<Cause> {
    let session = Session {
        views: 0,
        frames: 1,
        half: None,
        gap_m: 1.0,
        steepest: 0.0,
        region: Told::Nothing,
        reference_m: None,
        conditions: false,
    };
    let mut rng = seed.stream(&format!("rays/alone/{name}"));
    cause(name, [strength, strength], unit, &session, seed, &mut rng)
}
