//! Recordings that nobody took: by formula (`formula`), or by light (`speckle`).
//!
//! A [`Shoot`] is a list of [`ViewPlan`]s and a sensor. Output is written in the recording layout
//! and read back by the same reader as real data; nothing in it tells what was switched on.

mod formula;
mod grid;
mod kinect;
mod like;
mod plan;
pub mod room;
mod shoot;
pub(crate) mod sigma_table;
pub mod speckle;

pub use formula::{FormulaSensor, Shooting, Shot, shoot};
pub use grid::{Grid, GridView};
pub use kinect::kinect_v1;
pub use like::{plan_like, plan_on};
pub use plan::{RATE_HZ, Scenery, ViewPlan, plan_grid};
pub use shoot::{Physics, Shoot};
