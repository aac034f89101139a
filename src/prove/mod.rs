//! The blind trial: sets whose left-out physics is sealed away, a solver that sees nothing else,
//! and a judge who opens the seals afterwards.
//!
//! The makers of sets share no formula with the catalogue and no code with the diagnosis; only the
//! recording and the model file are common ground.

mod question;
pub mod rays;
pub mod real;

pub use question::*;
