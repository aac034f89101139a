//! The views as the searches see them: residuals about planes, tiles and blocks, and the known terms.

pub mod between;
pub mod blocks;
mod board;
pub mod box_sums;
pub mod column_steps;
pub mod exposure;
pub mod field;
pub mod inflation;
pub mod infrared;
pub mod known;
pub mod known_error;
pub mod layers;
pub mod learnt;
pub mod light;
pub mod margins;
pub mod reading;
pub mod samples;
pub mod surveyed_view;
pub mod thinned;
pub mod tiles;
