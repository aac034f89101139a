//! Recordings that no sensor took: by formula, by speckle, or as a film of a room.
//!
//! A [`Shoot`] is a list of [`ViewPlan`]s and a sensor. Its physics is sigma(z, theta) with the
//! effects of the catalogue ([`FormulaSensor`]), or a Kinect of dots and a matcher in which errors
//! arise by themselves ([`speckle`]). Output is written in the recording layout and read back by the
//! same reader as real data; nothing in it says what was switched on.

mod formula;
mod grid;
mod like;
mod plan;
pub mod room;
mod shoot;
pub mod speckle;

pub use formula::{FormulaSensor, Shooting, Shot, shoot};
pub use grid::{Grid, GridView, RATE_HZ, kinect_v1};
pub use like::{plan_like, plan_on};
pub use plan::{Scenery, ViewPlan, plan_grid};
pub use shoot::{Physics, Shoot};
