//! An office filmed along a path: colour, depth and where the camera was.
//!
//! Room frame: origin on the floor in the room's middle, x and y level, z up, metres. Poses are
//! `world_from_camera` (the world is the room) with the camera's optical frame: x right, y down,
//! z forward.
//!
//! ```text
//! TUM file -trajectory-> samples -resample-> poses -place-> poses in the Room
//!                                    Room + pose -render-> Picture -FormulaSensor-> depth words
//! ```

mod body;
mod canvas;
mod film;
mod furniture;
mod material;
mod office;
mod path;
mod place;
mod printed;
mod render;
mod shading;
mod shape;
mod texture;
mod textures;

pub use crate::trajectory::{Pose, Trajectory, read_trajectory};
pub use body::{Body, Room};
pub use film::{Film, Shutter};
pub use material::{Mapping, Material};
pub use office::{CEILING_M, FLOOR_M};
pub use path::{Gap, Resampled, around_the_desks, looking, resample};
pub use place::{CLEARANCE_M, Placement, place};
pub use render::{Picture, RoomCamera};
pub use shape::{Intersection, Shape};
pub use texture::Texture;
