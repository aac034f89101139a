//! The blind trial: sets whose left-out physics is sealed away, a solver that sees nothing else,
//! and a judge who opens the seals afterwards.
//!
//! The makers of sets share no formula with the catalogue and no code with the diagnosis; only the
//! recording and the model file are common ground.

pub mod baselines;
pub mod gain;
mod gains;
mod question;
pub mod rays;

pub use gains::{Gain, Gains, Method};
pub use question::*;
