//! When simulation and recording differ: where, why, and what is gained by knowing.

mod bias;
mod candidate;
mod evidence;
mod field;
mod layers;
mod search;
mod smooth;
mod tiles;
mod variance;

pub use field::Field;
pub use layers::Layers;
pub use search::Found;
