//! Checks of the findings: held-out views, replication in halves, a second run, excess terms of the model,
//! and power.

pub mod again;
pub mod far_off;
pub mod heldout;
pub mod overstated;
pub mod power;
pub mod replication;
pub mod rms;
pub mod textures;
