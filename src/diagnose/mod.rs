//! When simulation and recording differ: where, why, and what is gained by knowing.

mod bias;
mod candidate;
mod evidence;
mod field;
mod search;
mod tiles;

pub use field::Field;
pub use search::{Found, Layer, search_bias};
