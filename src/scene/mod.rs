//! What there is to see: surfaces in front of a camera, and what every pixel sees of them.
//!
//! Optical frame of the camera: x right, y down, z forward, metres.

mod bench;
mod world;

pub use bench::{Bench, Board, PATCH_SIDE_M, Patch, Print, Target, WHITE};
pub use world::{Hit, Seen, Surface, TargetFrame, World};
