//! Tests of minutes, started by `./run test --slow`: the diagnosis on ray-traced sets, which share no
//! formula with it, and on odd ones; coverage over hundreds of recordings.

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/rays.rs"]
mod rays;
#[path = "../common/raytraced/mod.rs"]
mod raytraced;

mod diagnose;
mod diagnose_honesty;
mod diagnose_odd;
