//! What a finding must stand: views kept aside, halves, the same tests again; what the model has too much, and what could have been seen.

pub mod ablation;
pub mod again;
pub mod far_off;
pub mod heldout;
pub mod overstated;
pub mod power;
pub mod replication;
pub mod rms;
pub mod textures;
