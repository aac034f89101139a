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
mod desk;
mod film;
mod furnish;
mod grounds;
mod inks;
mod light;
mod paint;
mod papers;
mod path;
mod place;
mod prints;
mod render;
mod resample;
mod shape;
mod surroundings;
mod texture;
mod tiles;

pub use crate::trajectory::{Pose, Trajectory, read_trajectory};
pub use body::Body;
pub use film::{Film, Shutter};
pub use furnish::{CEILING_M, FLOOR_M};
pub use paint::{Lay, Paint, Skin};
pub use path::{around_the_desks, looking};
pub use place::{CLEARANCE_M, Placement, place};
pub use render::{Picture, RoomCamera};
pub use resample::{Gap, Resampled, resample};
pub use shape::{Shape, Touch};
pub use texture::Texture;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::scene::{Hit, Surface, World};
use body::Staged;

/// Bodies and the textures on them. One body is a [`Shape::Shell`] when there are walls.
#[derive(Debug, Clone, PartialEq)]
pub struct Room {
    pub bodies: Vec<Body>,
    pub textures: Vec<Texture>,
}

impl Room {
    /// How far a point is from the nearest surface, m, with that body's index; negative inside
    /// furniture and behind walls.
    pub fn clearance(&self, point: &Vector3<f64>) -> (f64, usize) {
        let all = self.bodies.iter().enumerate().map(|(i, b)| (b.clearance(point), i));
        all.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, 0))
    }
}

/// The number of a body's face among [`World::surfaces`].
fn surface(body: usize, face: usize) -> u16 {
    (body * Shape::FACES + face) as u16
}

impl World for Room {
    fn cast(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Hit> {
        let bundle = Isometry3::from_parts(Translation3::from(*origin), UnitQuaternion::identity());
        let meet = |(index, body): (usize, &Body)| {
            let staged = Staged::new(body, &bundle);
            let touch = staged.touch(direction)?;
            Some(Hit {
                t: touch.t,
                normal: staged.normal(&staged.point(direction, touch.t), touch.face),
                surface: surface(index, touch.face),
                albedo: f64::from(body.paint(touch.face).infrared),
            })
        };
        self.bodies.iter().enumerate().filter_map(meet).min_by(|a, b| a.t.total_cmp(&b.t))
    }

    /// None is the calibration target, and a tilt lasts for one pose only.
    fn surfaces(&self) -> Vec<Surface> {
        let any = Surface { is_target: false, theta_rad: None };
        vec![any; self.bodies.len() * Shape::FACES]
    }
}
