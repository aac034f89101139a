//! A Kinect that sees dots and matches them; no error formula anywhere.
//!
//! ```text
//! pattern -> optics -> image -> matcher -> read-out -> 11-bit raw values
//!            (world)            (reference)
//! ```
//! Frames: the camera's optical frame (x right, y down, z forward, m). The projector stands at
//! (+baseline, 0, 0), turned as the camera: as on a Kinect v1, on the camera's right when looking
//! out, so that the shadow of a thing falls on its left. A point at depth z is seen
//! d = fx * baseline / z px to the right of where the projector sends its dot.
//!
//! What can be set are [`Causes`]; noise, steps, bias, holes and shadows follow.

mod causes;
mod correlation;
mod image;
mod matcher;
mod moment;
mod optics;
mod pattern;
mod readout;
mod reference;
mod sensor;

pub use causes::{Cause, Causes, KNOWN_CAUSES};
pub use sensor::{Filming, SpeckleSensor, SpeckleShot};
