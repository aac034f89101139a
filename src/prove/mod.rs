//! The blind trial: makers of recordings whose left-out physics is sealed away.
//!
//! They share no formula with the catalogue and no code with the simulator or the diagnosis; only
//! the recording and the model file are common ground.

pub mod rays;
