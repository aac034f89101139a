//! Tests that take minutes, run by `./run test --slow`: the diagnosis on ray-traced sets, which share no
//! formula with it, and on odd ones; ablation of its parts; coverage over hundreds of recordings; a new
//! effect in its own build.
//!
//! A single long test stays with its siblings as `#[ignore = "slow: ..."]`; `./run test --slow` runs those
//! too.

#![forbid(unsafe_code)]

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/rays.rs"]
mod rays;
#[allow(dead_code, unused_imports)] // the trial uses all of it
#[path = "../common/raytraced/mod.rs"]
mod raytraced;

mod demos;
mod detectable;
mod diagnose;
mod diagnose_ablation;
mod diagnose_honesty;
mod diagnose_odd;
mod intervals;
#[cfg(target_os = "linux")] // peak memory is read from /proc
mod memory;
#[cfg(unix)] // links folders
mod new_effect;
mod recovery;
mod reproduce;
